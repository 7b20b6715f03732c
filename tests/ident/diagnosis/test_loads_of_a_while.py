"""A contact for a while and a body from a moment on: their windows, and nothing where none is."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from planted import ON_RECORDINGS, thinned, ur10e, with_fault
from planted import planted as with_change

import ident
from benchmarks.exam.make_cases import make_case
from benchmarks.planted_faults import BASES, DATA, Fault, carried, planted
from ident.diagnosis import loop
from ident.diagnosis.diagnosis import diagnose_study
from ident.diagnosis.evidence.evidence import Evidence
from ident.diagnosis.evidence.leading import outside_metric
from ident.diagnosis.evidence.metric import acting, whole
from ident.diagnosis.evidence.refine import Refined, fit_sizes, refine
from ident.diagnosis.evidence.settled import settled, with_found
from ident.diagnosis.evidence.state import Found
from ident.diagnosis.loads import events
from ident.diagnosis.loads.events import Event, _says_more, _search, _simplest, best_event
from ident.diagnosis.loads.is_a_load import crossed, stands_apart
from ident.diagnosis.loads.own_of_a_run import zero_columns
from ident.diagnosis.loads.windows import gains_of
from ident.diagnosis.opening import opened
from ident.diagnosis.outcome import threshold
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.candidates import Library, ranked, short_list
from ident.diagnosis.search.weighing import compared
from ident.equations.prepared import prepare_study
from ident.recordings.study import load_study
from ident.twin import PlannedRun, Sensors, simulate, write_simulation
from modelgen.effects import catalogue
from modelgen.effects import effect as called
from modelgen.effects.place import Place

ALPHA = 0.01


def event_of(made):
    loads = [effect for effect in catalogue().values() if effect.windowed]
    return best_event(made.state, Library(loads, made.layout), threshold(ALPHA), ALPHA)


def test_nothing_where_nothing_is(clean_arm):
    assert event_of(clean_arm) is None


def test_a_contact(arm):
    request = "external_force:fx=0.2,fy=-0.15,fz=0.15,from=5,to=9,recording=run1"
    event = event_of(opened(prepare_study(arm(request))))
    assert event is not None and event.refined.term.effect.name == "external_force"
    place = event.refined.term.place
    assert place.recording == "run1"
    assert place.start == pytest.approx(5.0, abs=0.2) and place.stop == pytest.approx(9.0, abs=0.2)
    assert event.evidence.log_e > threshold(ALPHA)


@pytest.mark.first_case
@pytest.mark.parametrize("begin", [0.0, 0.6])
def test_what_is_there_all_along_a_run_is_no_contact(arm, begin):
    """A force of which the body that is searched on whole runs is no part: windows that gain by every step
    back ended seconds before the run began."""
    request = f"external_force:fx=0.2,fy=-0.15,fz=0.15,from={begin},to=14,recording=run1"
    event = event_of(opened(prepare_study(arm(request))))
    assert event is None or not event.refined.term.effect.transient


@pytest.mark.long
def test_a_contact_before_the_flange(arm):
    """Held at the flange it said less than all of the model's parameters: nothing was told of 19 N."""
    request = "external_force:fx=0.4,fy=-0.3,fz=0.3,pz=0.2,from=5,to=9,recording=run1"
    (finding,) = diagnose_study(arm(request)).findings
    assert finding.effect == "external_force"
    for name, truth in {"fx": 0.4, "fy": -0.3, "fz": 0.3, "px": 0.0, "py": 0.0, "pz": 0.2}.items():
        told = finding.parameters[name]
        assert abs(told["value"] - truth) < 4 * told["std"] < 0.25


def test_two_contacts_in_one_run(arm):
    """The second is found beside the first, as another one of its kind."""
    forces = ("fx=0.2,fy=-0.15,fz=0.15,from=2,to=5", "fx=-0.15,fy=0.2,fz=0.15,from=8,to=11")
    begun = opened(prepare_study(arm(*(f"external_force:{its},recording=run1" for its in forces))))
    first = event_of(begun)
    assert first is not None
    r = first.refined
    with_it = with_found(begun.state, Found(r.term, r.columns, r.sizes))
    second = event_of(replace(begun, state=with_it))
    assert second is not None and second.refined.term.copy == 1
    ends = sorted((e.refined.term.place.start, e.refined.term.place.stop) for e in (first, second))
    assert np.allclose(ends, [(2, 5), (8, 11)], atol=0.2)


@pytest.mark.first_case
@pytest.mark.parametrize("window", [(7.53, 10.02), (3.27, 4.61)])
def test_the_edges_of_a_contact_beside_another_one(arm, window):
    """In the noise of a model without both the larger one closed 0.1 s late, and said 350 nats for 1191; the
    other one 0.9 s late, and was none."""
    other = "external_force:fx=0.2,fy=-0.15,fz=0.15,from=2.9,to=9.6,recording=run2"
    larger = "external_force:fx=3,fy=2,fz=-0.3,from={},to={},recording=run1".format(*window)
    event = event_of(opened(prepare_study(arm(other, larger))))
    place = event.refined.term.place
    assert place.recording == "run1"
    assert np.allclose((place.start, place.stop), window, atol=0.03)


def test_a_body_from_a_moment_on(arm):
    event = event_of(opened(prepare_study(arm("payload_change:m=0.1,mz=0.01,from=6,recording=run1"))))
    assert event is not None and event.refined.term.effect.name == "payload_change"
    place = event.refined.term.place
    assert place.recording == "run1" and place.stop is None
    assert place.start == pytest.approx(6.0, abs=0.2)


def loaded(begun, name, sizes, start=None, stop=None, link=None):
    """(state, placed load) once it acts in the first run with these sizes."""
    effect, state = catalogue()[name], begun.state
    places = [p for p in effect.places(begun.layout) if p.recording == "run1" and p.link == link]
    place = next(p for p in places if len(effect.parameters_of(p)) == len(sizes))
    term = Term(effect, replace(place, start=start, stop=stop), dict.fromkeys(effect.nonlinear_names, 0.0))
    columns = state.scene.columns(term)
    Y = state.rows.Y.copy()
    for c, z in columns.items():
        Y[c] += z @ np.array(sizes)
    return replace(state, rows=replace(state.rows, Y=Y)), Found(term, columns, np.array(sizes))


@pytest.mark.first_case
@pytest.mark.parametrize("start", [1.7, 12.0])
def test_a_body_near_the_beginning_or_the_end_of_a_run(clean_arm, start):
    """A second and a half beside it are enough: of runs of three seconds there is no more."""
    state, _ = loaded(clean_arm, "payload_change", [0.3, 0.01, 0.0, 0.03], start, link=3)
    event = event_of(replace(clean_arm, state=settled(state, 3)))
    assert event is not None and event.refined.term.effect.name == "payload_change"
    assert event.refined.term.place.start == pytest.approx(start, abs=0.2)
    assert event.refined.term.place.stop is None and event.rivals == ()


def test_a_body_on_the_link_that_says_more_stands_before_the_one_that_showed_it(clean_arm):
    """Of 2 kg at a TX40's flange in three seconds too few blocks spoke for the last link, and 1.6 kg on the
    one before it were told, with nothing beside."""
    state, body = loaded(clean_arm, "payload_change", [0.3, 0.01, 0.0, 0.03], link=3)
    state, tau = settled(state, 3), threshold(ALPHA)
    library = Library([catalogue()["payload_change"]], clean_arm.layout)
    search = _search(state, library, clean_arm.layout, tau)
    on = {r.term.place.link: r for r in search.asked if r.term.place.recording == "run1"}
    quiet = Evidence(30.0, 30.0, *np.ones((2, 12)), on[2].sizes, np.zeros(3), np.zeros(3), 1.0, np.ones(3))
    told = _says_more(state, search, Event(on[2], quiet, 30.0), tau, ALPHA)
    assert told is not None and told.refined.term.place.link == body.term.place.link == 3
    assert [event.refined.term.place.link for event in told.rivals] == [2]
    loud = replace(quiet, log_e=told.evidence.log_e)
    assert _says_more(state, search, Event(on[2], loud, 30.0), tau, ALPHA) is None


def test_two_loads_at_one_time_are_one(clean_arm):
    """Beside a push another load of the same seconds is none; a weight that is carried all along is."""
    pushed, push = loaded(clean_arm, "external_force", [0.5, -0.4, 0.4], 5.0, 9.0)
    both, weight = loaded(replace(clean_arm, state=pushed), "payload_change", [0.3, 0.01, 0.0, 0.03], link=3)
    tau = threshold(ALPHA)
    for state, expected in ((pushed, False), (both, True)):
        state = with_found(settled(state, 2), push)
        place = replace(weight.term.place, start=None if expected else 4.9, stop=None if expected else 9.1)
        term = replace(weight.term, place=place)
        columns = state.scene.columns(term)
        own = outside_metric(state, Refined(term, columns, weight.sizes, 0.0), acting(columns))
        assert stands_apart(state, own, term, columns, tau) == expected


@pytest.mark.long
@pytest.mark.parametrize("robot", ["ur10e", "staubli_tx40"])
def test_a_body_that_joins_another_is_one_of_its_own(tmp_path, robot):
    """The first was told as heavy as both are in the mean, which fits neither's seconds, and the second as a
    force; where their edges meet the last fit needs no third load, and nothing is left to be explained."""
    runs = (PlannedRun("run1", "identify", 30.0), PlannedRun("run2", "validate", 20.0))
    loads = (
        "m=0.07,mx=0.0014,my=-0.0021,mz=0.0039,from=14",
        "m=0.124,mx=-0.0017,my=0.0019,mz=0.0056,from=20",
    )
    effects = tuple(f"payload_change:{its},recording=run1" for its in loads)
    made = simulate(robot, "B", effects, seed=3, sensors=Sensors(rate_hz=100.0), runs=runs)
    diagnosis = diagnose_study(load_study(write_simulation(made, tmp_path)))
    assert [f.effect for f in diagnosis.findings] == ["payload_change"] * 2 and not diagnosis.unexplained
    for told, m in zip(sorted(diagnosis.findings, key=lambda f: f.where["from"]), (0.07, 0.124)):
        its = told.parameters["m"]
        assert abs(its["value"] - m) < 4 * its["std"] < 0.5 * m


def test_a_joint_that_counts_from_another_zero_in_one_run_is_no_load(clean_arm):
    """Three degrees of the second joint; a body on its link is nearly that torque."""
    state = clean_arm.state
    inside = state.rows.recording == state.rows.names.index("run1")
    Y = state.rows.Y.copy()
    for c, z in zero_columns(state, 1, Place(recording="run1"), inside).items():
        Y[c] += 0.05 * z[:, 0]
    off = settled(replace(state, rows=replace(state.rows, Y=Y)), 3)
    event = event_of(replace(clean_arm, state=off))
    assert event is not None
    for its in (event, *event.rivals):  # told as what it is, in the one run or the other way in the other
        place, sign = its.refined.term.place, {"run1": -1, "run2": 1}
        assert its.refined.term.effect.name == "position_zero" and place.joint == 1
        assert its.refined.sizes == pytest.approx([0.05 * sign[place.recording]], rel=0.1)


@pytest.mark.parametrize("channel", [1, 2])
def test_a_torque_of_another_factor_in_one_run_is_no_load(clean_arm, channel):
    """A fifth more; most of it is gravity, as a body's torque is."""
    state = clean_arm.state
    inside = state.rows.recording == state.rows.names.index("run1")
    Y = state.rows.Y.copy()
    Y[channel, inside] *= 1.2
    off = settled(replace(state, rows=replace(state.rows, Y=Y)), 3)
    assert event_of(replace(clean_arm, state=off)) is None


def test_a_recording_alone_says_what_all_rows_say_of_columns_that_act_in_it(clean_arm):
    state = clean_arm.state
    m, rng = whole(state.metric, state.rows.usable), np.random.default_rng(5)
    for number in range(len(state.rows.names)):
        mine = np.flatnonzero(state.rows.recording == number)
        columns = {c: np.zeros((len(state.rows.t), 2)) for c in range(state.rows.channels)}
        for z in columns.values():
            z[mine] = rng.normal(size=(len(mine), 2))
        sizes, gain = fit_sizes(m, columns)
        alone, its = fit_sizes(m.only(mine), {c: z[mine] for c, z in columns.items()})
        assert np.allclose(alone, sizes, rtol=1e-9) and its == pytest.approx(gain, rel=1e-9)


def test_gains_of_windows_are_those_of_their_columns(tiny):
    """Sums over blocks against the dense fit of each window."""
    rng = np.random.default_rng(0)
    M, k = 400, 10
    rows = tiny["rows"](rng.normal(size=(M, 3)), rng.normal(size=M))
    m = whole(tiny["metric"](rows), np.ones(M, bool))
    z = rng.normal(size=(M, 2))
    edges = np.arange(0, M + 1, M // k)
    parts = [slice(a, b) for a, b in itertools.pairwise(edges)]
    X = m.X[0][1] @ m.fitted.basis
    sums = (
        np.stack([X[s].T @ z[s] for s in parts]),
        np.stack([z[s].T @ z[s] for s in parts]),
        np.stack([z[s].T @ m.fitted.residual[0, s] for s in parts]),
    )
    cumulative = tuple(np.concatenate([np.zeros((1, *a.shape[1:])), np.cumsum(a, axis=0)]) for a in sums)
    pairs = np.array([(0, 10), (2, 5), (7, 8)])
    for (a, b), gain in zip(pairs, gains_of(cumulative, pairs)):
        inside = np.zeros((M, 1))
        inside[edges[a] : edges[b]] = 1.0
        assert gain == pytest.approx(fit_sizes(m, {0: z * inside})[1], rel=1e-4)


def test_halves_are_each_others_judges(tiny):
    M = 400
    rows = tiny["rows"](np.ones((M, 1)), np.zeros(M))
    a, b = crossed(tiny["metric"](rows), np.ones(M, bool), 1.0)
    assert np.array_equal(a.fitted.mask, b.judged.mask) and np.array_equal(a.judged.mask, b.fitted.mask)
    assert np.array_equal(a.fitted.mask, ~a.judged.mask)


def test_a_law_of_the_whole_study_takes_a_loads_place(arm, monkeypatch):
    """A base that is tilted, of which too few blocks agree to be told alone, looks like a force on all but a
    second of a run: the force has nothing to say beside it, and is not told."""
    tau = threshold(ALPHA)
    begun = opened(prepare_study(arm("base_tilt:roll=0.02,pitch=0.004")))
    tilt, force = catalogue()["base_tilt"], catalogue()["external_force"]
    library = Library([tilt, force], begun.layout)
    weighed = compared(begun.state, short_list(ranked(begun.state, library, frozenset())), tau, ALPHA)
    weighed = replace(weighed, passed=())
    place = replace(next(iter(force.places(begun.layout))), recording="run1", start=1.0)
    load = refine(
        begun.state.metric, begun.state.scene, Term(force, place, dict.fromkeys(force.nonlinear_names, 0.0))
    )
    law = weighed.possible[0][1]
    event = Event(load, replace(law, gain=law.gain - 1.0), load.gain)
    assert law.log_e > tau and law.gain > tau
    monkeypatch.setattr(loop, "compared", lambda *_: weighed)
    monkeypatch.setattr(loop, "best_event", lambda *_: event)
    monkeypatch.setattr(loop, "pruned", lambda state, steps, *_: (state, steps))  # on this arm it would go
    outcome = loop.trace(begun.state, library, ALPHA, max_steps=1)
    assert not any(step.term.effect.windowed for step in outcome.steps)


@pytest.mark.long
@pytest.mark.skipif(
    not (DATA / "airbot_play").is_dir(), reason="the recordings of measured robots are not here"
)
def test_a_weight_is_one_though_the_models_parameters_follow_its_fast_part(tmp_path):
    """2 kg at an AIRBOT's flange in one of its fitted runs, by accelerations that are smoother than the
    torque's filter: in whitened rows the parameters that are free in that run said 13 % more, and a load on
    the third link was told."""
    (base,) = (b for b in BASES if b.robot == "airbot_play")
    at = np.array([0.03, 0.0, 0.08])
    fault = Fault("2 kg", (), runs=lambda table, base: carried(table, base, 6, at, 2.0, 51))
    begun = opened(prepare_study(ident.load(planted(base, fault, tmp_path))))
    event = event_of(begun)
    assert event is not None and event.refined.term.effect.name == "payload_change"
    place = event.refined.term.place
    assert (place.recording, place.link) == ("identify_b_identify", 6)
    assert (place.start, place.stop) == (None, None)


@pytest.mark.long
@pytest.mark.skipif(
    not (DATA / "franka_panda").is_dir(), reason="the recordings of measured robots are not here"
)
def test_a_weight_on_the_second_link_of_a_franka(tmp_path):
    """In the later three seconds of its fitted run, by Pinocchio's equations; the model's own parameters
    answer half of it, and what they leave passes for noise."""
    path = with_fault("franka_panda", "a weight", tmp_path)
    document = ident.diagnose(ident.load(thinned(path))).document()
    (finding,) = document["findings"]
    told = [finding[k] for k in ("effect", "recording", "link")]
    assert told == ["payload_change", "excite_first_identify_2", 2]
    mx, my = (finding["parameters"][k] for k in ("mx", "my"))  # half-way along the link, which lies along -y
    assert abs(mx["value"]) < 3 * mx["std"] and my["value"] < -3 * my["std"]
    before, after = (document["error_percent"][k]["test"]["total"] for k in ("before", "after"))
    assert after < 0.2 * before


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_positions_that_come_late_are_no_contact(tmp_path):
    """Of a UR10e's by 5 ms a second of 3 and -3 kN was told, which moved one torque."""

    def late(c):
        return {k: np.interp(c["t"] - 0.005, c["t"], x) if k[0] in "qd" else x for k, x in c.items()}

    document = ident.diagnose(with_change(tmp_path, late, ur10e())).document()
    assert "external_force" not in {its["effect"] for its in document["findings"]}


@pytest.mark.long
@pytest.mark.skipif(not DATA.exists(), reason="the recordings of measured robots are not here")
def test_the_interval_of_a_body_in_the_run_that_judges_holds_it(tmp_path):
    """Half a kilogram at a rokae's flange was told as 0.565 +- 0.021 kg, in noise that is always alike."""
    base, at = next(b for b in BASES if b.robot == "rokae_xmate3pro"), np.array([0.02, 0.03, 0.1])
    fault = Fault("2 kg", (), runs=lambda table, base: carried(table, base, 7, at, 2.0))
    path = planted(base, fault, tmp_path)
    study = yaml.safe_load(path.read_text())
    for entry, use in zip(study["recordings"][1:], ("validate", "identify")):
        entry["use"] = use
    path.write_text(yaml.safe_dump(study))
    found = diagnose_study(load_study(path)).findings
    (mass,) = (f.parameters["m"] for f in found if f.effect == "payload_change")
    assert abs(mass["value"] - 2.0) < 1.96 * mass["std"]
    assert 0.04 < mass["std"] < 1.0


@pytest.mark.long
def test_the_window_of_a_contact_is_sought_in_the_noise_that_it_leaves(tmp_path):
    """Two contacts of five and six seconds in two runs of an exam's arm: in the noise of both the second was
    one of three seconds, which is no load, and of the first, told alone, too little was known."""
    seed = 2644875077
    case = make_case("twice", ["external_force"] * 2, seed, "contacts", tmp_path, 30.0, 250.0, "")
    findings = ident.diagnose(ident.load(tmp_path / "cases" / "contacts" / "study.yaml")).findings
    told = {f.where["recording"]: f for f in findings}
    assert [f.effect for f in findings] == ["external_force"] * 2 and set(told) == {"run1", "run2"}
    for effect in case["effects"]:
        its, true = told[effect["recording"].removesuffix(".parquet")], effect["parameters"]
        assert its.where["from"] == pytest.approx(true["from"], abs=0.2)
        assert its.where["to"] == pytest.approx(true["to"], abs=0.2)
        force = its.parameters["force"]
        size = np.hypot(np.hypot(true["fx"], true["fy"]), true["fz"])
        assert abs(force["value"] - size) < max(3 * force["std"], 0.02 * size)


def test_loads_are_compared_in_one_noise(monkeypatch):
    """A body that a force imitates: 929 nats in the noise outside of that, 911 for the body in its own, and
    930 in one noise."""
    nats = {"external_force": 929.0, "payload_change": 911.0}
    here = Place(side="link", recording="run2", start=16.7)
    told = [
        SimpleNamespace(log_e=nats[name], effect=called(name), place=replace(here, link=link))
        for name, link in (("external_force", None), ("payload_change", 4))
    ]
    force, body = (
        Event(Refined(Term(e.effect, e.place, {}), {}, np.ones(1), 0.0), e, 100.0, noise=object())
        for e in told
    )

    def crosswise(state, noise, r):
        return None, SimpleNamespace(log_e=930.0 if noise is force.noise else 911.0)

    monkeypatch.setattr(events, "_crosswise", crosswise)
    monkeypatch.setattr(events, "_worth_most", lambda state, most, equal, tau: list(equal))
    best = _simplest(None, None, [force, body], (), 8.3)
    assert best.refined is body.refined and best.rivals == (force,)
    alone = [replace(its, noise=None) for its in (force, body)]  # as runs foretell each other
    assert _simplest(None, None, alone, (), 8.3).refined is force.refined


def test_what_all_rows_tell_apart_is_no_equal(clean_arm):
    """A force in the seconds of a body, of which blocks are taken to say as much."""
    state, body = loaded(clean_arm, "payload_change", [0.3, 0.01, 0.0, 0.03], 5.0, 9.0, link=3)
    state = settled(state, 3)
    _, push = loaded(clean_arm, "external_force", [0.5, -0.4, 0.4], 5.0, 9.0)
    own = outside_metric(state, Refined(body.term, body.columns, body.sizes, 0.0), acting(body.columns))
    said = SimpleNamespace(log_e=100.0)
    its, other = (
        Event(Refined(term, z, np.ones(1), 0.0), said, 0.0, noise=own)
        for term, z in ((body.term, body.columns), (push.term, push.columns))
    )
    assert events._worth_most(state, its, [other, its], 8.3) == [its]
    assert events._worth_most(state, replace(its, noise=None), [other, its], 8.3) == [other, its]
