"""Any study, any keys: fit and whoever starts from `build` (the diagnosis) have the same rigid parameters."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_arm import ARM

import generated
from ident.equations.build import build
from ident.equations.placing import terms_of
from ident.equations.prepared import prepare_study
from ident.errors import StudyError
from ident.estimation.fit import fit_study
from ident.estimation.shapes import extend
from ident.estimation.solving import estimate_all
from ident.recordings.study import study_from

OWN = '''
import sympy as sp
from modelgen.effects import SIGNALS, Effect, LinearParameter

class Drag(Effect):
    """Drag of the air."""

    name = "drag"
    summary, signature, source = "drag", "grows with the square of the rate", "none"
    terms = {"Fw": sp.Abs(SIGNALS.dq) * SIGNALS.dq}
    linear = (LinearParameter("Fw", "N m s^2/rad^2", 0.0, 50.0, "positive"),)
    typical = {"Fw": 1.0}
'''


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("keys")
    (folder / "small.yaml").write_text(ARM)
    (folder / "own").mkdir()
    (folder / "own" / "drag.py").write_text(OWN)
    model = generated.load(str(folder / "small.yaml"), "C")
    rng = np.random.default_rng(0)
    chi = rng.normal(size=len(model.parameters)) * 0.3
    for name in ("run", "other"):
        t = np.arange(2400) / 100.0
        w, phase = 2 * np.pi * np.arange(1, 5) * 0.12, rng.uniform(0, 6, (4, 3))
        a = rng.normal(size=(4, 3)) * 0.6 / np.arange(1, 5)[:, None]
        angle = w[:, None, None] * t[None, :, None] + phase[:, None, :]
        q = np.einsum("kj,knj->nj", a, np.sin(angle))
        dq = np.einsum("kj,knj->nj", a * w[:, None], np.cos(angle))
        ddq = np.einsum("kj,knj->nj", -a * w[:, None] ** 2, np.sin(angle))
        tau = model.torque(q, dq, ddq, chi) + 0.05 * rng.normal(size=(len(t), 6))
        tau[:, 1] += 0.7 * np.abs(dq[:, 1]) * dq[:, 1]
        columns = {"t": t} | {f"q{j + 1}": q[:, j] for j in range(3)}
        columns |= {channel: tau[:, k] for k, channel in enumerate(model.channels)}
        pq.write_table(pa.table(columns), folder / f"{name}.parquet")
    return folder


@st.composite
def studies(draw):
    model = draw(st.sampled_from("ABCD"))
    side = {"A": "tau_m", "B": "tau_l"}.get(model)
    maybe = {
        "without": st.sampled_from([["offset"], ["coulomb_friction:2"], ["viscous_friction"]]),
        "robust": st.just("huber"),
        "bounds": st.just("physical"),
        "gravity": st.sampled_from([[0, 0, -9.81], [9.81, 0, 0]]),
        "turn_over": st.sampled_from([[0.1, 0.1, 0.0], [0.02, 0.0, 0.3]]),
        "reduction": st.just(False),
        "effective_rows": st.just(False),
        "trim_rest": st.just(False),
        "reduction_alpha": st.sampled_from([0.01, 0.2]),
        "alpha": st.just(0.05),
        "estimator": st.just("wls"),
        "effects_folder": st.just("own"),
        "effects": st.sampled_from([["spring:1"], ["asymmetric_friction:2"], ["stribeck_friction:3:vs=0.1"]]),
    }
    if side:
        maybe["channels"] = st.just([f"{side}1", f"{side}2"])
    if model in "BC":
        maybe["link_inertia"] = st.just(True)
    if model != "B":
        maybe["coupled_drives"] = st.just([[2, 3]])
    chosen = draw(st.lists(st.sampled_from(sorted(maybe)), unique=True, max_size=6))
    filters = {
        "decimation_cutoff_hz": draw(st.sampled_from([2.0, 4.0])),
        "order": draw(st.sampled_from([2, 4])),
        **({"sign_velocity": 0.05} if draw(st.booleans()) else {}),
        **({"sign_cutoff_hz": 15.0} if draw(st.booleans()) else {}),
    }
    second = {"file": "other.parquet", "use": draw(st.sampled_from(["identify", "validate"]))}
    second |= {"payload": "L"} if draw(st.booleans()) else {}
    keys = {name: draw(maybe[name]) for name in chosen}
    return {
        "robot": "small.yaml",
        "model": model,
        "recordings": [{"file": "run.parquet"}, second],
        "filter": filters,
    } | keys


@settings(max_examples=12, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(keys=studies())
def test_fit_and_diagnosis_start_from_the_same_rows(folder, keys):
    study = study_from(keys, folder / "study.yaml")
    cutoff = keys["filter"]["decimation_cutoff_hz"]
    try:
        fit = fit_study(study)
    except StudyError as error:  # an effect that this model does not show: said with its key
        assert "effects[1]" in str(error)
        return
    prepared = prepare_study(study)
    systems = build(prepared, cutoff)
    extended = extend(prepared, systems, cutoff)
    fitted = [system for system in extended.systems if system.role == "identify"]
    estimate, _ = estimate_all(fitted, study, extended.columns, extended.allowed, extended.held)
    scale = np.maximum(np.abs(fit.full.chi), fit.full.std)
    assert np.all(np.abs(estimate.chi - fit.full.chi) <= 1e-9 * scale)
    assert fit.columns.parameters == extended.columns.parameters


def test_a_users_own_effect_is_part_of_the_fit(folder):
    keys = {"robot": "small.yaml", "recordings": [{"file": "run.parquet"}], "effects_folder": "own"}
    keys |= {"filter": {"decimation_cutoff_hz": 3.0}}
    study = study_from(keys | {"effects": ["drag:2"]}, folder / "study.yaml")
    result = fit_study(study)
    k = result.columns.parameters.index("drag:2.Fw")
    assert abs(result.estimate.chi[k] - 0.7) < 4 * result.std[k] and result.std[k] < 0.05
    with pytest.raises(StudyError, match="effects_folder"):
        prepare_study(study.with_(effects_folder="nowhere"))


def test_terms_of_a_study_say_themselves_again(folder):
    """What the extended study holds is read back as the same terms."""
    from ident.equations.placing import entry_of, layout_of

    keys = {"robot": "small.yaml", "recordings": [{"file": "run.parquet"}]}
    effects = [
        "stribeck_friction:3:vs=0.1",
        {"effect": "joint_coupling", "joint": 1, "source_joint": 2, "Fv": 0.2},
    ]
    study = study_from(keys | {"effects": effects}, folder / "study.yaml")
    prepared = prepare_study(study)
    layout = layout_of(study, prepared.columns)
    terms = terms_of(study, prepared.columns, layout)
    said = [entry_of(term, prepared.columns.need.joints) for term in terms]
    again = terms_of(study_from(keys | {"effects": said}, study.file), prepared.columns, layout)
    assert [(t.label, t.place, dict(t.theta), t.size) for t in again] == [
        (t.label, t.place, dict(t.theta), t.size) for t in terms
    ]
