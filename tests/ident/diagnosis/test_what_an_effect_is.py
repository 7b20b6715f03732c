"""What is asked of an effect besides that it says enough."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_arm import ARM

from ident.diagnosis.evidence.evidence import weigh
from ident.diagnosis.evidence.metric import stacked
from ident.diagnosis.evidence.refine import Refined
from ident.diagnosis.evidence.settled import with_found
from ident.diagnosis.evidence.state import Found
from ident.diagnosis.evidence.turning_rows import turning_alone
from ident.diagnosis.extended.in_a_study import study_term
from ident.diagnosis.extended.last_fit import _ended
from ident.diagnosis.loop import _but, _instead
from ident.diagnosis.opening import opened
from ident.diagnosis.outcome import Step, threshold
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.candidates import Library, Ranked, _contained, ranked, short_list
from ident.diagnosis.search.weighing import (
    Weighed,
    compared,
    is_itself,
    is_one_quantity,
    rivals_of,
    simplest,
    simplicity,
)
from ident.equations.placing import entry_of
from ident.equations.prepared import prepare_study
from ident.estimation.fit import fit_study
from ident.estimation.found_effects import found_effects
from ident.recordings.study import load_study
from ident.twin import PlannedRun, Sensors, simulate, write_simulation
from ident.twin.study import RUNS
from modelgen.effects import catalogue
from modelgen.effects.place import Place


def test_a_change_of_the_model_shows_in_the_parameters_that_it_has(tiny):
    """Columns that a change lets in are any law: by them alone a left-out offset was told as a base that is
    turned by 0.03 degrees."""
    rng = np.random.default_rng(0)
    M = 400
    law, change = rng.normal(size=M), rng.normal(size=M)
    effect = SimpleNamespace(changes_model=True, linear=(), parameters_of=lambda place: ())
    for y, itself in ((law, False), (law + change, True)):
        m = tiny["metric"](tiny["rows"](np.ones((M, 1)), y + 0.1 * rng.normal(size=M)), 0.1)
        r = SimpleNamespace(
            term=SimpleNamespace(effect=effect, place=None),
            columns={0: np.column_stack([law, change])},
            sizes=np.ones(2),
        )
        assert is_itself(m, r, weigh(m, r.columns), 8.3, 0.01) is itself


def test_a_size_that_its_shape_measures_too_has_to_be_that(tiny):
    """A link that lags by 84 mrad in a gap of 12 is no backlash."""
    rng = np.random.default_rng(1)
    M = 400
    place = rng.normal(size=M)
    effect = SimpleNamespace(
        one_quantity={"gap": "travel"}, parameters_of=lambda place: ("gap", "drop"), name="play"
    )
    m = tiny["metric"](tiny["rows"](np.ones((M, 1)), 0.5 * place + 0.1 * rng.normal(size=M)), 0.1)
    columns = {0: np.column_stack([place, rng.normal(size=M)])}
    for travel, itself in ((0.5, True), (0.4, True), (0.01, False), (5.0, False)):
        r = SimpleNamespace(term=SimpleNamespace(effect=effect, place=None, theta={"travel": travel}))
        r.columns = columns
        assert is_one_quantity(m, r, weigh(m, columns), 8.3) is itself
    effect.one_quantity = {}
    assert is_one_quantity(m, r, weigh(m, columns), 8.3)


def test_simpler_effects_are_asked_beside_those_that_contain_them(tmp_path_factory):
    """Friction under load that drives and brakes alike was told as one that differs."""
    effects = catalogue()
    assert all(inner in effects for e in effects.values() for inner in e.contains)
    outer, inner = effects["quadrant_friction"], effects["load_dependent_friction"]
    places = [Place(joint, side="motor") for joint in (1, 2)]
    best = {(e.name, p.joint): Ranked(Term(e, p), 1.0) for e in (outer, inner) for p in places}
    assert _contained(best, [best["quadrant_friction", 2]]) == [best["load_dependent_friction", 2]]


def test_what_only_turning_joints_show_of_a_law_is_not_known(tiny):
    """Where the model holds the load, friction that differs by the direction of power is the load's own
    multiple but for the turn-over: it was told of friction that did not."""
    rng = np.random.default_rng(1)
    M = 800
    rate, load = np.sin(0.1 * np.arange(M)), 1 + rng.normal(size=M)
    sign = np.tanh(20 * rate)
    both = np.column_stack([np.abs(load) * sign, load * sign**2]) @ np.array([[1, 1], [1, -1]]) / 2
    effect, place = SimpleNamespace(needs={"sign_dq", "tau_link"}, updates={}), SimpleNamespace(joint=0)
    law = SimpleNamespace(
        term=SimpleNamespace(effect=effect, place=place), columns={0: both}, sizes=np.ones(2)
    )
    segment = SimpleNamespace(sign_dq=sign[:, None], rows=M, every=1)
    for base, alone in ((load, True), (rng.normal(size=M), False)):
        rows = tiny["rows"](base[:, None], both @ np.ones(2))
        channel = SimpleNamespace(joint=0)
        model = SimpleNamespace(channels=[channel])
        state = SimpleNamespace(rows=rows, segments=[segment], model=model, design=stacked(rows, []))
        assert turning_alone(state, tiny["metric"](rows, 0.1), law) is alone


def test_a_shape_that_ends_where_its_search_does_is_none():
    shapes = (SimpleNamespace(name="rho", grid=(0.4, 0.95)), SimpleNamespace(name="own", grid=(0.0, 0.3)))
    term = SimpleNamespace(effect=SimpleNamespace(nonlinear=shapes))

    def found(**values):
        told = {k: SimpleNamespace(value=v, at_bound=at) for k, (v, at) in values.items()}
        return SimpleNamespace(term=term, parameters=told)

    assert _ended(found(rho=(0.98, True), own=(0.1, False)))
    assert not _ended(found(rho=(0.7, False), own=(0.0, True)))  # a search begins at 0


def test_sizes_that_the_loop_left_out_are_held_at_zero_in_the_last_fit(arm):
    """Beside a backlash without a drop one of -0.2 % was fitted, which is impossible: it was refused."""
    begun = opened(prepare_study(arm("joint_coupling:3:source_joint=2,Fv=0.8,Ia=0.0")))
    place = Place(2, 1, "motor", parts=("Fv",))
    term = Term(catalogue()["joint_coupling"], place)
    columns = begun.state.scene.columns(term)
    state = with_found(begun.state, Found(term, columns, np.array([0.8])))
    entry = entry_of(study_term(state.terms[0], state), (1, 2, 3))
    assert (entry["Ia"], entry["Fc"]) == (0.0, 0.0) and set(entry["fixed"]) == {"Ia", "Fc"}
    last = fit_study(arm("joint_coupling:3:source_joint=2,Fv=0.8,Ia=0.0").with_(effects=(entry,)))
    (told,) = found_effects(last)
    assert told.parameters["Fv"].value == pytest.approx(0.8, rel=0.05)
    assert told.parameters["Fc"].given and told.parameters["Ia"].value == 0.0


def test_a_load_of_a_run_that_judges_is_held_without_what_no_motion_shows(tmp_path):
    """Of two joints no motion shows a body's mass: a study that held it at zero was refused, and a payload
    was told to be something else."""
    (tmp_path / "robot.yaml").write_text(ARM.split("  - {joint: revolute, antecedent: 2")[0])
    runs = (PlannedRun("run1", "identify", 14.0), PlannedRun("run2", "validate", 10.0))
    made = simulate(tmp_path / "robot.yaml", "A", (), seed=3, sensors=Sensors(rate_hz=200.0), runs=runs)
    study = load_study(write_simulation(made, tmp_path / "out"))
    begun = opened(prepare_study(study))
    here = catalogue()["payload_change"].places(replace(begun.layout, recordings=("run2",)))
    light = next(place for place in here if place.link == 2)
    assert not {"M", "MZ"} & set(light.parts)
    term = Term(catalogue()["payload_change"], light)
    columns = begun.state.scene.columns(term)
    state = with_found(begun.state, Found(term, columns, np.full(len(light.parts), 0.1)))
    state = replace(state, found=(replace(state.found[0], sizes=np.full(len(light.parts), 0.1)),))
    entry = entry_of(study_term(state.terms[0], state), (1, 2))
    assert "M" not in entry and "XX" in entry["fixed"]
    (told,) = fit_study(study.with_(effects=(entry,))).terms
    assert dict(zip(told.linear, told.size))["MX"] == 0.1


def test_what_a_study_left_out_is_asked_of_every_joint(tmp_path_factory):
    """A budget of two places for one effect hid the others' viscous friction, and a square took its place."""
    folder = tmp_path_factory.mktemp("left_out")
    (folder / "robot.yaml").write_text(ARM)
    runs = (PlannedRun("run1", "identify", 14.0), PlannedRun("run2", "validate", 10.0))
    made = simulate(folder / "robot.yaml", "A", (), seed=3, sensors=Sensors(rate_hz=200.0), runs=runs)
    study = load_study(write_simulation(made, folder / "out")).with_(without=("viscous_friction",))
    begun = opened(prepare_study(study))
    library = Library(list(catalogue().values()), begun.layout)
    listed = {
        (r.term.effect.name, r.term.place.joint)
        for r in short_list(ranked(begun.state, library, frozenset()))
    }
    assert {("viscous_friction", joint) for joint in range(3)} <= listed


def test_what_is_not_beaten_is_told_beside_it(tmp_path_factory):
    """A small arm's square law agreed with the judged rows in 8 blocks of 12, too few to be told alone, and
    0.7 nats behind a cube: that one was told without it."""
    folder = tmp_path_factory.mktemp("alike")
    (folder / "robot.yaml").write_text(ARM)
    runs = tuple(
        replace(run, duration=20.0, points=round(20 * run.points / run.duration)) for run in RUNS[:3]
    )
    hidden = "quadratic_friction:3:Fv2=0.02"
    made = simulate(folder / "robot.yaml", "A", (hidden,), seed=1, sensors=Sensors(250.0), runs=runs)
    begun = opened(prepare_study(load_study(write_simulation(made, folder / "out"))))
    laws = [catalogue()[name] for name in ("quadratic_friction", "nonlinear_viscous_friction")]
    listed = [Ranked(Term(law, begun.layout.place(2, None, side="motor")), 0.0) for law in laws]
    tau = threshold(0.01)
    weighed = compared(begun.state, listed, tau, 0.01)
    best, evidence = simplest(weighed, tau)
    told = {best.term.effect.name}
    told |= {rival.term.effect.name for rival in rivals_of(weighed, best, evidence, tau, 0.01)}
    assert "quadratic_friction" in told


def test_what_explains_another_part_is_no_equal(tiny):
    """A law 20 nats behind a ripple was told as its equal, as too few blocks spoke against it: it shared a
    hundredth of its torque. One that all but repeats it is its equal."""
    rng = np.random.default_rng(6)
    M = 2000
    hop, own, other = np.ones((M, 1)), rng.normal(size=M), rng.normal(size=M)
    faint = np.where(np.arange(M) % 200 < 40, 1.0, 0.2)  # hardly there in most blocks
    m = tiny["metric"](tiny["rows"](hop, own * faint * 0.6 + 0.12 * other + rng.normal(size=M)))
    zs = {"ripple": own * faint, "law": other, "alike": own * faint + 0.1 * rng.normal(size=M)}

    def hypothesis(name):
        term = SimpleNamespace(key=name, free=1, contains=lambda other: False)
        return Refined(term, {0: zs[name][:, None]}, np.ones(1), 9.0), weigh(m, {0: zs[name][:, None]})

    told = tuple(hypothesis(name) for name in zs)
    weighed = Weighed(m, told, told, told)
    best, evidence = told[0]
    assert evidence.supported(0.01) and not evidence.beats(told[1][1], threshold(0.01), 0.01)
    beside = rivals_of(weighed, best, evidence, threshold(0.01), 0.01)
    assert [r.term.key for r in beside] == ["alike"]


def test_a_law_that_contains_another_is_told_beside_it_where_it_is_shown(tiny):
    """Of four Stribeck frictions in sixty a warming one was told beside, which was 0.4 nats ahead of 230."""
    rng = np.random.default_rng(8)
    M = 2000
    own, more, noise = rng.normal(size=M), rng.normal(size=M), rng.normal(size=M)
    names = ("stribeck_friction", "thermal_stribeck_friction", "maxwell_slip")
    terms = [Term(catalogue()[name], Place(1, side="motor")) for name in names]
    assert [term.contains(terms[0]) for term in terms] == [False, True, False]
    assert not terms[1].contains(replace(terms[0], place=Place(2, side="motor")))
    for share, beside in ((0.07, {2}), (0.11, {1, 2})):  # 1.5 nats more on all rows, 7; a number is worth 3.8
        m = tiny["metric"](tiny["rows"](np.ones((M, 1)), own + share * more + noise))
        columns = [{0: own[:, None]}, *2 * [{0: np.column_stack([own, more])}]]
        told = tuple(
            (Refined(term, z, np.ones(z[0].shape[1]), 9.0), weigh(m, z)) for term, z in zip(terms, columns)
        )
        rivals = rivals_of(Weighed(m, told, told, told), *told[0], threshold(0.01), 0.01)
        assert {terms.index(rival.term) for rival in rivals} == beside


def test_the_law_that_a_told_one_contains_is_told_whatever_its_blocks(tiny):
    """Friction by quadrant was told of an AIRBOT, in a block more than friction under load, which said 0.3
    nats more. What no told law contains has to pass itself, and none is told that says too little."""
    rng = np.random.default_rng(8)
    M = 2000
    own, more, noise = rng.normal(size=M), rng.normal(size=M), rng.normal(size=M)
    names = ("quadrant_friction", "load_dependent_friction", "viscous_friction")
    wide, simple, other = (Term(catalogue()[name], Place(1, side="motor")) for name in names)
    assert wide.contains(simple) and not wide.contains(other)

    def told(share, law):
        m = tiny["metric"](tiny["rows"](np.ones((M, 1)), own + share * more + noise))
        columns = [{0: np.column_stack([own, more])}, {0: own[:, None]}]
        both = tuple(
            (Refined(term, z, np.ones(z[0].shape[1]), 9.0), weigh(m, z))
            for term, z in zip((wide, law), columns)
        )
        return simplest(Weighed(m, both, both[:1], both), threshold(0.01))[0].term

    assert told(0.0, simple) is simple
    assert told(0.3, simple) is wide  # what it adds is there
    assert told(0.0, other) is wide


def test_whose_motion_it_is_is_a_choice_too():
    """A torque 15 ms late was told as a coupling to its neighbour's rate, which says as much."""
    late, coupled = catalogue()["time_delay"], catalogue()["joint_coupling"]
    own = Term(late, Place(2, None, "motor"), {})
    others = Term(coupled, Place(2, 1, "motor", parts=("Fv",)), {})
    assert own.free == others.free == 1 and simplicity(own) < simplicity(others)


@pytest.mark.parametrize(("fitted", "told"), [(3636.0, "hysteresis"), (3760.0, "maxwell_slip")])
def test_rows_that_judge_alone_do_not_ask_for_more_numbers_than_all_rows_do(tiny, fitted, told):
    """A Maxwell slip was told of Dahl's friction that MuJoCo moved: 59 nats ahead on the rows that judge, 45
    behind on those that chose both."""
    x = np.random.default_rng(8).normal(size=(2, 2000))
    m = tiny["metric"](tiny["rows"](np.ones((2000, 1)), x.sum(axis=0)))
    slip, dahl = (Term(catalogue()[name], Place(1, side="motor")) for name in ("maxwell_slip", "hysteresis"))
    z = {0: x[0][:, None]}
    e = weigh(m, z)
    both = tuple(
        (Refined(term, z, np.ones(1), gain), replace(e, log_e=log_e, gain=gain))
        for term, log_e, gain in ((slip, 1445.0, fitted), (dahl, 1386.0, 3681.0))
    )
    weighed = Weighed(m, both, both, both)
    assert simplest(weighed, threshold(0.01))[0].term.effect.name == told


@pytest.mark.parametrize(("says", "kept"), [(13.0, False), (60.0, True)])
def test_of_one_torque_no_two_are_made_that_share_it(tiny, says, kept):
    """Beside a hysteresis of 1,386 nats a Maxwell slip that had said 1,445 in its place said 13: each was
    small beside the other then, and neither was told."""
    x = np.random.default_rng(8).normal(size=(2, 2000))
    m = tiny["metric"](tiny["rows"](np.ones((2000, 1)), x.sum(axis=0)))
    names = ("maxwell_slip", "hysteresis", "spring")
    slip, dahl, spring = (Term(catalogue()[name], Place(1, side="motor")) for name in names)
    z, e = {0: x[0][:, None]}, weigh(m, {0: x[0][:, None]})

    def weighed(*its):
        told = tuple((Refined(t, z, np.ones(1), 1.0), replace(e, log_e=log_e)) for t, log_e in its)
        return Weighed(m, told, told, told)

    before = weighed((slip, 1445.0), (dahl, 1386.0), (spring, 40.0))
    instead = _instead([before], Step(dahl, before.all[1][1], ()))
    after = _but(weighed((slip, says), (spring, 13.0)), instead)
    assert [r.term for r, _ in after.passed] == [slip, spring][not kept :]
    assert after.all == after.passed == after.possible
