"""Any study, any keys: fit and whoever starts from `build` (the diagnosis) have the same rigid parameters."""

import json
from functools import lru_cache

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.signal
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from small_arm import ARM

import generated
from ident.equations.build import build
from ident.equations.fitted import FittedModel
from ident.equations.placing import terms_of
from ident.equations.prepared import prepare_study
from ident.errors import IdentError, StudyError
from ident.estimation.fit import fit_study
from ident.estimation.shapes import extend
from ident.estimation.solving import estimate_all
from ident.recordings.study import FilterSettings, RecordingEntry, Study, study_from
from modelgen.effects.registry import catalogue

pytestmark = pytest.mark.unexamined

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


GAINS = [2.0, 1.5, 0.5]
CATALOGUE = catalogue()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("keys")
    (folder / "small.yaml").write_text(ARM)
    (folder / "own").mkdir()
    (folder / "own" / "drag.py").write_text(OWN)
    model = generated.load(str(folder / "small.yaml"), "C")
    rng = np.random.default_rng(0)
    chi = rng.normal(size=len(model.parameters)) * 0.3
    chi[[name.startswith("Off") for name in model.parameters]] = 0.003  # hardly to be seen: may be cancelled
    for name in ("run", "other"):
        t = np.arange(2400) / 100.0
        pace = np.interp(t, [0, 1.5, 2.5], [0, 0, 1])  # at rest first
        time, gained = np.cumsum(pace) / 100.0, np.gradient(pace, t)[:, None]
        w, phase = 2 * np.pi * np.arange(1, 5) * 0.12, rng.uniform(0, 6, (4, 3))
        a = rng.normal(size=(4, 3)) * 0.6 / np.arange(1, 5)[:, None]
        angle = w[:, None, None] * time[None, :, None] + phase[:, None, :]
        q = np.einsum("kj,knj->nj", a, np.sin(angle))
        slope = np.einsum("kj,knj->nj", a * w[:, None], np.cos(angle))
        dq = slope * pace[:, None]
        ddq = (
            np.einsum("kj,knj->nj", -a * w[:, None] ** 2, np.sin(angle)) * pace[:, None] ** 2 + slope * gained
        )
        noise = scipy.signal.lfilter([0.015], [1, -0.95], rng.normal(size=(len(t), 6)), axis=0)
        tau = model.torque(q, dq, ddq, chi) + noise
        tau[:, 1] += 0.7 * np.abs(dq[:, 1]) * dq[:, 1]
        columns = {"t": t} | {f"q{j + 1}": q[:, j] for j in range(3)}
        columns |= {channel: tau[:, k] for k, channel in enumerate(model.channels)}
        columns |= {f"i{j + 1}": tau[:, j] / GAINS[j] for j in range(3)}
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
        maybe["drive_gains"] = st.sampled_from([GAINS, *(["identify"] if model in "CD" else [])])
    chosen = draw(st.lists(st.sampled_from(sorted(maybe)), unique=True, max_size=6))
    filters = {
        "decimation_cutoff_hz": draw(st.sampled_from([2.0, 4.0])),
        "order": draw(st.sampled_from([2, 4])),
        **({"sign_velocity": 0.05} if draw(st.booleans()) else {}),
        **({"sign_cutoff_hz": 15.0} if draw(st.booleans()) else {}),
        **({"resample_hz": 80.0} if draw(st.booleans()) else {}),
    }
    second = {"file": "other.parquet", "use": draw(st.sampled_from(["identify", "validate"]))}
    second |= {"payload": "L"} if draw(st.booleans()) else {}
    second |= {"from": 2.0, "to": 22.0} if draw(st.booleans()) else {}
    keys = {name: draw(maybe[name]) for name in chosen}
    if "payload" in second and draw(st.booleans()):
        keys["payload_mass"] = {"L": 2.0}
    if model != "A" and draw(st.booleans()):
        keys |= {"positions": "joint", "stiffness": [2000.0, 1500.0, 1000.0]}
    return {
        "robot": "small.yaml",
        "model": model,
        "recordings": [{"file": "run.parquet"}, second],
        "filter": filters,
    } | keys


def first_rows(study):
    """The rows that the diagnosis of a study begins with, before any width of dry friction is looked for."""
    from ident.diagnosis import opening

    class Enough(Exception):
        pass

    def first(problem, rows, segments):
        raise Enough(problem, rows, segments)

    real, opening.first_state = opening.first_state, first
    try:
        opening.opened(prepare_study(study))
    except Enough as found:
        return found.args
    finally:
        opening.first_state = real


@settings(
    max_examples=15,
    deadline=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.generate],
)
@given(keys=studies())
def test_fit_and_diagnosis_start_from_the_same_rows(folder, keys):
    cutoff = keys["filter"]["decimation_cutoff_hz"]
    # the diagnosis filters positions at four times the cut-off of its rows, and opens at its own cut-off
    fits = study_from(
        keys | {"filter": keys["filter"] | {"position_cutoff_hz": 4 * cutoff}}, folder / "study.yaml"
    )
    opens = study_from(
        keys | {"filter": keys["filter"] | {"position_cutoff_hz": cutoff}}, folder / "study.yaml"
    )
    try:
        fit = fit_study(fits)
    except StudyError as error:  # an effect that this model does not show: said with its key
        assert "effects" in str(error)
        return
    prepared = prepare_study(fits)
    systems = build(prepared, cutoff)
    extended = extend(prepared, systems, cutoff)
    fitted = [system for system in extended.systems if system.role == "identify"]
    estimate, _ = estimate_all(fitted, fits, extended.columns, extended.allowed, extended.held)
    scale = np.maximum(np.abs(fit.full.chi), fit.full.std)
    assert np.all(np.abs(estimate.chi - fit.full.chi) <= 1e-9 * scale)
    assert fit.columns.parameters == extended.columns.parameters

    problem, rows, segments = first_rows(opens)
    assert problem.columns.parameters == prepared.columns.parameters
    b = len(problem.columns.parameters)
    for c, (places, values) in enumerate(rows.base):
        W = np.zeros((len(rows.t), b))
        W[:, places] = values
        use = rows.use[c]
        theirs = np.vstack([s.dense(part, c, b) for s in systems for part in s.segments])
        weight = np.hstack([part.weight[c] for s in systems for part in s.segments])[use]
        Y = np.hstack([part.Y[c] for s in systems for part in s.segments])[use] / weight
        assert np.allclose(W[use], theirs[use] / weight[:, None], rtol=1e-9, atol=1e-9 * np.abs(W[use]).max())
        assert np.allclose(rows.Y[c][use], Y, rtol=1e-9, atol=1e-9 * np.abs(Y).max(initial=1e-9))

    # what effects ask of the model, put on the rows, is the rows' own W chi: no column of the study lacks
    rigid = np.linspace(-1.0, 1.5, b)
    rigid[list(problem.columns.gain_columns.values())] = 0.0
    model = FittedModel(problem.columns, problem.robot, rigid, {s.label: s.vs for s in segments})
    torque = [model.torque(s.motion) for s in segments]
    if keys.get("positions") == "joint":
        return  # a stretch holds one position a joint: rotors go with it there
    for c, (places, values) in enumerate(rows.base):
        joint = problem.columns.joint_of[c]
        made = np.concatenate([s.decimate(tau[:, [c]], joint)[:, 0] for s, tau in zip(segments, torque)])
        made, own = (made * rows.scale[c])[rows.use[c]], (values @ rigid[places])[rows.use[c]]
        assert np.linalg.norm(made - own) < 1e-3 * np.linalg.norm(own)


BASE = {
    "robot": "small.yaml",
    "model": "C",
    "recordings": [{"file": "run.parquet"}, {"file": "other.parquet", "use": "validate"}],
    "filter": {"decimation_cutoff_hz": 2.0},
}
TURNING = {"turn_over": [0.01, 0, 0]}
LOADED = {"recordings": [{"file": "run.parquet"}, {"file": "other.parquet", "payload": "L"}]}
STUDY = {
    "model": {"model": "A"},
    "drive_gains": {"drive_gains": [1.0, 1.0, 1.0]},
    "columns": {"columns": {"tau_m1": {"scale": 2.0}}},
    "without": {"without": ["offset:2"]},
    "link_inertia": {"link_inertia": True},
    "coupled_drives": {"coupled_drives": [[2, 3]]},
    "positions": {"positions": "joint", "stiffness": [1e3] * 3},
    "payload_mass": LOADED | {"payload_mass": {"L": 2.0}},
    "bounds": {"bounds": "physical"},
    "robust": {"robust": "huber"},
    "reduction": {"reduction": False},
    "reduction_alpha": {"reduction_alpha": 0.9999},
    "effective_rows": {"effective_rows": False},
    "trim_rest": {"trim_rest": False},
    "effects": {"effects": ["spring:1"]},
    "gravity": {"gravity": [9.81, 0, 0]},
    "channels": {"channels": ["tau_m1", "tau_l2"]},
    "estimator": {"estimator": "irls"},
    "forgetting": {"estimator": "recursive", "forgetting": 0.5},
    "controller": {"estimator": "iv", "controller": {}},
    "turn_over": {"turn_over": [0.3, 0, 0]},
    "presliding": {"presliding": [0.1, 0, 0]},
    "instant_sign": TURNING | {"instant_sign": [True, False, False]},
    "folder": {"folder": "elsewhere"},
    "joints": {"joints": ["a", "b"]},
}
FILTER = {
    "position_cutoff_hz": 5.0,
    "decimation_cutoff_hz": 3.0,
    "sign_cutoff_hz": 5.0,
    "sign_velocity": 0.3,
    "path": "sign",
    "order": 2,
    "resample_hz": 80.0,
}
ENTRY = {
    "file": "other.parquet",
    "use": "test",
    "payload": "L",
    "name": "night",
    "from_s": 3.0,
    "to_s": 20.0,
    "rate_hz": 50.0,
    "columns": {"q1": {"sign": -1}},
}
ELSEWHERE = {
    "robot", "file", "recordings", "filter", "exact", "episode",  # what a study is; of URDFs, of data sets
    "stiffness", "effects_folder", "alpha",  # with positions: joint; the user's own effect below; diagnosis
    "effort", "topic", "decimal",  # of JointStates, of bags, of text
}  # fmt: skip


def test_every_key_has_its_line():
    assert set(Study.model_fields) <= set(STUDY) | ELSEWHERE
    assert set(FilterSettings.model_fields) == set(FILTER)
    assert set(RecordingEntry.model_fields) <= set(ENTRY) | ELSEWHERE


def seen(folder, keys):
    """What a fit says, or the sentence of its refusal; most cases begin with the same study."""
    return _seen(folder, json.dumps(keys))


@lru_cache(maxsize=4)
def _seen(folder, keys):
    try:
        fit = fit_study(study_from(json.loads(keys), folder / "study.yaml"))
    except IdentError as error:
        return str(error)
    runs = [(system.label, system.role, system.samples) for system in fit.systems]
    numbers = [fit.estimate.chi.tolist(), fit.std.tolist(), fit.relative_error, fit.full_rate_error]
    return fit.columns.parameters, fit.notes, [str(check) for check in fit.checks], runs, numbers


def third(keys):
    """A study with one recording more, with these keys."""
    entry = {"file": "run.parquet", "name": "b"} | {
        {"from_s": "from", "to_s": "to"}.get(k, k): keys[k] for k in keys
    }
    return BASE | {"recordings": [*BASE["recordings"], entry]}


BESIDE = {"payload_mass": LOADED, "instant_sign": TURNING}  # what these keys are said of
REMEMBERS = {"effects": [{"effect": "hysteresis", "joint": 1, "width": 0.01, "fixed": ["width"]}]}
CHANGES = [
    *((BASE | BESIDE.get(key, {}), BASE | more) for key, more in STUDY.items()),
    *(
        (BASE | its, BASE | its | {"filter": BASE["filter"] | {key: value}})
        for key, value in FILTER.items()
        for its in [REMEMBERS if key == "path" else {}]
    ),
    *((third({}), third({key: value})) for key, value in ENTRY.items()),
]


@pytest.mark.parametrize("case", CHANGES, ids=[*STUDY, *FILTER, *ENTRY])
def test_every_key_acts_or_is_refused(folder, case):
    before, after = case
    assert seen(folder, after) != seen(folder, before)


def test_how_a_turn_over_is_recorded_is_said_beside_one(folder):
    assert "turn_over: or presliding:" in seen(folder, BASE | {"instant_sign": [True, False, False]})


def test_a_users_own_effect_is_part_of_the_fit(folder):
    keys = {"robot": "small.yaml", "recordings": [{"file": "run.parquet"}], "effects_folder": "own"}
    keys |= {"filter": {"decimation_cutoff_hz": 3.0}}
    study = study_from(keys | {"effects": ["drag:2"]}, folder / "study.yaml")
    result = fit_study(study)
    k = result.columns.parameters.index("drag:2.Fw")
    assert abs(result.estimate.chi[k] - 0.7) < 4 * result.std[k] and result.std[k] < 0.1
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


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_every_effect_at_each_of_its_places_says_itself_again(folder, name):
    """Of a tilted base the first moments of link 1, which the file's gravity hides, were refused."""
    from ident.equations.placing import entry_of, layout_of

    keys = {"robot": "small.yaml", "recordings": [{"file": "run.parquet"}]}
    own = CATALOGUE[name].replaces  # a term of the model itself
    if own:
        keys["without"] = [f"{name}:3"]
    study = study_from(keys, folder / "study.yaml")
    columns = prepare_study(study).columns
    layout, joints = layout_of(study, columns), columns.need.joints
    recording = {"recording": "run"} if CATALOGUE[name].windowed else {}
    for place in CATALOGUE[name].places(layout):
        if own and joints[place.joint] != 3:
            continue
        where = {"joint": place.joint, "source_joint": place.source}
        where = {key: joints[number] for key, number in where.items() if number is not None}
        where |= {"side": place.side} if place.side else {}
        where |= {"link": place.link} if place.link else {}
        asked = study_from(keys | {"effects": [{"effect": name, **where, **recording}]}, study.file)
        (term,) = terms_of(asked, columns, layout)
        (again,) = terms_of(
            study_from(keys | {"effects": [entry_of(term, joints)]}, study.file), columns, layout
        )
        assert (again.place, again.linear, dict(again.theta), again.size) == (
            term.place,
            term.linear,
            dict(term.theta),
            term.size,
        )
