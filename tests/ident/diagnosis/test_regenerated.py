"""Findings as columns of a regenerated model: the C agrees with what was fitted; what is none is named."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_arm import ARM

import generated
from generated.errors import GeneratedError
from ident.diagnosis import regenerated
from ident.diagnosis.intervals import covariances
from ident.diagnosis.model_view import build_view
from ident.diagnosis.regenerated import model_files, regenerate, with_regenerated, write_model
from ident.diagnosis.rows import build_rows
from ident.diagnosis.scoring import make_folds
from ident.diagnosis.state import Found, first_state, refit
from ident.diagnosis.terms import Term
from modelgen.effects import catalogue
from modelgen.geometry.robot_file import load_robot


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "small.yaml"
    path.write_text(ARM)
    return str(path)


def recordings(model):
    rng = np.random.default_rng(4)
    chi = rng.uniform(0.3, 2.0, len(model.parameters))
    out = []
    for label, role in (("a", "identify"), ("b", "validate")):
        t = np.arange(0, 15, 0.004)
        q, dq, ddq = np.zeros((3, len(t), 3))
        for j in range(3):
            for h in range(1, 5):
                w, a, phase = 0.6 * h + 0.1 * j, 0.5 / h, rng.uniform(0, 6)
                q[:, j] += a * np.sin(w * t + phase)
                dq[:, j] += a * w * np.cos(w * t + phase)
                ddq[:, j] -= a * w * w * np.sin(w * t + phase)
        tau = model.torque(q, dq, ddq, chi, sign=np.tanh(dq / 2e-3))
        tau[:, 1] += 0.8 * np.exp(-((dq[:, 1] / 0.1) ** 2)) * np.tanh(dq[:, 1] / 2e-3)
        tau += rng.normal(size=tau.shape) * 0.02
        tau_m, tau_l = tau[:, :3], tau[:, 3:] if tau.shape[1] > 3 else None
        out.append(SimpleNamespace(label=label, role=role, payload=None, t=t, q=q, tau_m=tau_m, tau_l=tau_l))
    return out


def fitted(path, name, terms, without=()):
    """The state with these terms added, and findings as `regenerate` reads them."""
    model = generated.load(path, name)
    rows = build_rows(recordings(model), tuple(model.channels), 10.0)
    view = build_view(model, rows.fine, load_robot(path), rows.runs, {}, without)
    state = first_state(rows, view, make_folds(rows.run, rows.t, [r.role for r in rows.runs]))
    found = [Found(t, {}, np.full(len(t.terms), 1e-3)) for t in terms]
    state = refit(state, found)
    spread = covariances(state)
    return state, [
        SimpleNamespace(term=t, joints=(t.joint + 1,), covariance=spread.get(t.key)) for t in terms
    ]


def term(effect, joint, channels, terms=None, source=None, **theta):
    value = catalogue()[effect]
    return Term(value, joint, channels, terms or value.linear_names, theta, source)


def test_columns_and_torque_of_the_generated_model_are_those_of_the_fit(arm):
    terms = [
        term("stribeck_friction", 1, (1,), vs=0.1),
        term("hysteresis", 0, (0,), width=0.01),
        term("load_dependent_friction", 2, (2,)),
        term("torque_ripple", 2, (2,), wavenumber=9.0),
        term("gear_ripple", 2, (2,), wavenumber=4.0),
        term("joint_coupling", 2, (2,), ("Fv", "Fc"), source=1),
        term("offset_drift", 0, (0,)),
        term("drive_gain_error", 1, (1,)),
    ]  # fmt: skip
    state, findings = fitted(arm, "A", terms)
    made = regenerate(arm, "A", findings, state)
    assert made.requests[0] == "stribeck_friction:2" and len(made.effects) == 7
    assert "joint_coupling:3:source_joint=2" in made.requests
    assert made.column_difference < 1e-9 and made.torque_difference < 1e-9
    assert [(n.effect, n.joints) for n in made.not_columns] == [("drive_gain_error", (2,))]
    told = {v.name: v for v in (*made.parameters, *made.fixed)}
    assert told["Fs2"].value == pytest.approx(0.8, abs=0.1) and told["Fs2"].unit == "N m"
    assert told["vs2"].value == 0.1 and told["vs2"].std > 0
    assert {"t", "tau_link3", "z1"} <= set(made.signals)
    assert {v.value for v in made.fixed if v.name.startswith("wavenumber3")} == {4.0, 9.0}


def test_a_term_that_the_study_left_out_is_the_models_own_column(arm):
    terms = [term("coulomb_friction", 0, (0,)), term("coulomb_friction", 0, (3,))]
    state, findings = fitted(arm, "C", terms, ("coulomb_friction:1",))
    made = regenerate(arm, "C", findings, state)
    assert made.effects == ("coulomb_friction:1",) and made.requests == ()
    assert made.torque_difference < 1e-9
    values = {v.name: v.value for v in made.parameters}
    motor, sensor = (float(f.coefficients[0]) for f in state.found)
    assert (values["Fcm1"] + values["Fcl1"], values["Fcl1"]) == pytest.approx((motor, sensor))


def test_friction_before_and_behind_the_gear(arm):
    terms = [term("stribeck_friction", 1, (1,), vs=0.2), term("stribeck_friction", 1, (1, 4), vs=0.1)]
    state, findings = fitted(arm, "C", terms)
    made = regenerate(arm, "C", findings, state)
    assert made.requests == ("stribeck_friction:2", "stribeck_friction:2:side=link")
    assert made.column_difference < 1e-9 and made.torque_difference < 1e-9
    assert {v.name: v.value for v in made.fixed} == {"vs2": 0.2, "vs2_2": 0.1}


def test_files_and_what_happens_on_failure(arm, tmp_path, monkeypatch):
    state, findings = fitted(arm, "A", [term("stribeck_friction", 1, (1,), vs=0.1)])
    made = regenerate(arm, "A", findings, state)
    files = model_files(made)
    assert set(files) == {
        *(f"A_stribeck_friction_2.{suffix}" for suffix in ("c", "h", "json")), "parameters.json"
    }  # fmt: skip
    told = json.loads(files["parameters.json"])
    assert list(told["parameters"]) == json.loads(files["A_stribeck_friction_2.json"])["parameters"]
    assert told["extra_inputs"]["vs2"]["value"] == 0.1 and told["parameters"]["Fs2"]["unit"] == "N m"

    from ident.diagnosis import Diagnosis

    study = SimpleNamespace(robot_source=arm, model="A", payloads=())
    outcome = SimpleNamespace(last=state)
    given = Diagnosis("small", "A", (), "effect", tuple(findings), (), {}, {}, {}, outcome, study)
    done = write_model(with_regenerated(given), tmp_path / "model")
    assert done.regenerated.effects == ("stribeck_friction:2",) and not done.notes
    assert (tmp_path / "model" / "A_stribeck_friction_2.c").is_file()

    def refuse(*_, **__):
        raise GeneratedError("no")

    monkeypatch.setattr(regenerated.generated, "load", refuse)
    lost = with_regenerated(replace(given, regenerated=None))
    assert lost.findings == given.findings and lost.regenerated is None and "not regenerated" in lost.notes[0]
