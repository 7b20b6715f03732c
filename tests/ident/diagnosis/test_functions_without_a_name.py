"""Penalised functions find structure, its signals, and nothing in noise."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_arm import ARM

from benchmarks.exam.make_cases import make_case
from ident.diagnosis import diagnose_study
from ident.diagnosis.evidence.evidence import weigh
from ident.diagnosis.evidence.leading import leading_metric
from ident.diagnosis.evidence.nameless import Flexible, _ridge, flexible, imitation, wave_peaks
from ident.diagnosis.evidence.refine import refine
from ident.diagnosis.evidence.sufficiency import (
    ask,
    explained_share,
    heard,
    move_alike,
    short_of,
    short_of_fitted,
    sufficiency,
    sufficient,
)
from ident.diagnosis.left_over import leftovers
from ident.diagnosis.opening import opened
from ident.diagnosis.outcome import threshold
from ident.diagnosis.rows.terms import Term
from ident.equations.prepared import prepare_study
from ident.recordings.study import load_study
from ident.twin import PlannedRun, Sensors, simulate, write_simulation
from ident.twin.trajectories import Motion
from modelgen.effects import catalogue

MET, STIFF = 0.4, 20.0  # rad, N m/rad^2


def asked(state, c, wanted=5.0, only=None):
    load = [state.model.total(motion)[:, c] for motion in state.motions]
    return flexible([state.metric], c, c, state.segments, load, 400.0, wanted, only)[0]


@pytest.fixture(scope="module")
def odd(arm):
    """Joint 2 with friction that depends on the position of joint 1, as no effect of the catalogue does."""

    def strange(columns):
        q1, dq = columns["q1"], np.gradient(columns["q2"], columns["t"])
        columns["tau_m2"] = columns["tau_m2"] + 0.3 * np.cos(1.5 * q1) * dq

    return opened(prepare_study(arm(change=strange))).state


def test_nothing_in_noise(clean_arm):
    for c in range(3):
        found = asked(clean_arm.state, c, wanted=-1.0)
        assert found is None or found.evidence.log_e < np.log(4000)


def test_the_signals_of_a_strange_shape(odd):
    """Heard in the noise that it leaves: in that of the model without it, it is foretold by its own past."""
    found, _ = heard(odd, 1, 5.0)
    assert found is not None and found.evidence.log_e > np.log(4000)
    assert set(found.variables) <= {"q1", "dq2", "dq1"} and "q1" in found.variables
    plain = asked(odd, 1)
    assert plain is not None and plain.prior_evidence <= plain.evidence.gain + 1.0


def test_a_wave_that_goes_with_the_rate(tmp_path):
    """Where a joint comes back as it went it cancels over the position, where its line was looked for: of a
    UR10e's sixth joint friction that follows the position was told."""
    wave = 2 * np.pi / 20.0 * np.array([[2, 5, 9], [3, 4, 11], [2, 7, 8]])
    size = np.array([[0.8, 0.3, 0.1], [0.7, -0.4, 0.12], [0.9, 0.3, -0.15]])

    def at(t):  # the same way back: even in time
        x = np.asarray(t)[:, None, None] * wave
        q, dq, ddq = size * np.cos(x), -size * wave * np.sin(x), -size * wave**2 * np.cos(x)
        return q.sum(axis=2), dq.sum(axis=2), ddq.sum(axis=2)

    (tmp_path / "robot.yaml").write_text(ARM)
    runs = [PlannedRun(use, use, 20.0, motion=Motion("even", 20.0, at)) for use in ("identify", "validate")]
    made = simulate(tmp_path / "robot.yaml", "A", (), seed=3, sensors=Sensors(rate_hz=200.0), runs=runs)
    for run in made.recordings:
        c = run.columns
        rate = np.gradient(c["q2"], c["t"])
        ripples = sum(0.1 * np.sin(k * c["q2"]) for k in (40.0, 55.0, 70.0))  # whose lines are longer
        run.columns["tau_m2"] = c["tau_m2"] + ripples + 0.3 * rate * np.sin(18.0 * c["q2"] + 0.3)
    state = opened(prepare_study(load_study(write_simulation(made, tmp_path / "out")))).state
    load = [state.model.total(motion)[:, 1] for motion in state.motions]
    (found,) = flexible(
        [state.plain_metric], 1, 1, state.segments, load, 400.0, 5.0, frozenset({"q2", "dq2"})
    )
    assert found is not None and set(found.variables) == {"q2", "dq2"}
    assert explained_share(state, 1, found.column) > 0.5


def test_only_the_signals_asked_for(odd):
    found = asked(odd, 1, wanted=-1.0, only=frozenset({"q2", "dq2"}))
    assert found is None or set(found.variables) <= {"q2", "dq2"}


def noise(tiny, seed, columns):
    """Rows of noise, their metric, and columns (M, k) of noise."""
    rng = np.random.default_rng(seed)
    M = 1200
    rows = tiny["rows"](rng.normal(size=(M, 3)), rng.normal(size=M))
    return rows, tiny["metric"](rows), rng.normal(size=(M, columns))


def test_the_evidence_pays_for_its_columns(tiny):
    """Forty columns of noise explain noise, but no nats are left when their prior is paid for."""
    rows, m, Z = noise(tiny, 0, 40)
    value, *_ = _ridge(m, 0, Z)
    assert value < 3.0
    strong = tiny["rows"](rows.base[0][1], rows.Y[0] + 0.5 * Z[:, 0])
    m = tiny["metric"](strong)
    value, column, room, price = _ridge(m, 0, Z)
    assert value > 10.0
    z = np.where(m.fitted.mask, m.whiteners[0] @ column, 0.0)
    z -= np.where(m.fitted.mask, m.X[0][1] @ (m.fitted.basis @ (m.fitted.basis.T @ (m.X[0][1].T @ z))), 0.0)
    fall = z @ m.fitted.residual[0] - 0.5 * z @ z
    assert price == pytest.approx(fall - value, rel=0.03)  # sizes are tried in steps of 1.8
    assert np.corrcoef(column, Z[:, 0])[0, 1] > 0.8
    assert np.linalg.lstsq(room, column, rcond=None)[1].sum() < 1e-9 * np.sum(column**2)


def test_what_the_fitted_rows_never_saw_has_no_size(tiny):
    """A hat over an end that only judged rows reach: of one unit there it was made 1e140."""
    rows, m, Z = noise(tiny, 1, 5)
    Z[:, 0] *= 1 - rows.fitted
    _, column, room, _ = _ridge(m, 0, Z)
    assert np.abs(column).max() < 10 and np.abs(room).max() < 100
    assert _ridge(m, 0, Z[:, :1])[0] == 0.0


def test_a_law_says_as_much_on_the_rows_that_chose_it_too(odd):
    """A dead zone was friction under load where a UR10e was judged, hardly where that had been learned."""
    m = odd.plain_metric
    load = [odd.model.total(motion)[:, 1] for motion in odd.motions]
    (found,) = flexible([m], 1, 1, odd.segments, load, 400.0, 5.0)
    assert found is not None and 0 < found.fitted <= found.evidence.gain + 1.0  # its size is paid for
    term, told = SimpleNamespace(free=3), found.evidence
    assert sufficient(term, told, found, 8.3)
    less = replace(told, gain=0.5 * told.gain)
    assert not sufficient(term, less, found, 8.3)
    assert short_of_fitted(term, told, found, 8.3) is None
    assert short_of_fitted(term, less, found, 8.3) == (less.gain, found.fitted)


def test_a_wave_over_the_position_has_its_line(clean_arm):
    segments = clean_arm.state.segments
    back = [np.sin(31.0 * s.q[:, 1]) for s in segments]
    assert min(abs(k - 31.0) for k in wave_peaks(segments, 1, back, 400.0)) < 0.7


def test_what_joints_that_move_alike_do_not_show_is_no_law():
    """LWR4+: five joints followed one signal, and a function of any of their positions said as much."""
    evidence = SimpleNamespace(log_e=142.0)
    alone = Flexible(("q7",), np.zeros(1), 900.0, evidence, (("q1", 21.0), ("q2", -3.0)))
    alike = replace(alone, others=(("q1", 141.8), ("q2", 4.0), ("q3", 139.0)))
    term = SimpleNamespace(free=3)
    own = SimpleNamespace(log_e=150.0, gain=900.0)
    assert move_alike(alone, 8.3) == () and sufficient(term, own, alone, 8.3)
    assert move_alike(alike, 8.3) == ("q1", "q3") and not sufficient(term, own, alike, 8.3)
    weak = replace(alone, evidence=SimpleNamespace(log_e=9.2), others=(("q1", 5.5), ("q2", 1.4)))
    assert move_alike(weak, 8.3) == ("q1",)  # neither says enough alone; what is between them says nothing


def test_a_wave_is_imitated_by_what_moves_alike_and_by_nothing_else(clean_arm):
    state = clean_arm.state
    first = 2 * np.pi / np.ptp(np.concatenate([s.q[:, 1] for s in state.segments]))
    waves = [np.sin(2.4 * first * s.q[:, 1])[:, None] for s in state.segments]
    torque = np.concatenate([s.decimate(z, 1)[:, 0] for s, z in zip(state.segments, waves)])
    torque *= state.rows.scale[1]
    on = state.rows.use[1]
    copies = [
        imitation(state.metric, 1, 1, state.segments, lambda s, k=k: s.q[:, k], torque) for k in range(3)
    ]
    left = [np.std((torque - copy)[on]) for copy in copies]
    assert left[1] < 0.01 * np.std(torque[on])  # its own position stands for one that is a copy of it
    assert min(left[0], left[2]) > 0.5 * np.std(torque[on])


def test_a_copy_that_goes_further_where_it_is_judged_imitates_all_the_same(clean_arm):
    """Of an LWR4+'s one run, in which five joints move alike, a ripple of the sixth was told."""
    state, m = clean_arm.state, clean_arm.state.metric
    first = 2 * np.pi / np.ptp(np.concatenate([s.q[:, 1] for s in state.segments]))
    made = [s.decimate(np.stack([s.q[:, 1], np.sin(2.4 * first * s.q[:, 1])], 1), 1) for s in state.segments]
    place, torque = np.concatenate(made).T
    torque = torque * state.rows.scale[1]
    near = place < np.quantile(place, 0.8)
    m = replace(m, fitted=replace(m.fitted, mask=m.fitted.mask & near))
    copy = imitation(m, 1, 1, state.segments, lambda s: s.q[:, 1] + 1e-4 * np.cos(9 * s.t), torque)
    on = state.rows.use[1] & m.judged.mask
    assert np.std((torque - copy)[on]) < 0.01 * np.std(torque[on])


def test_a_friction_that_follows_a_position_is_imitated_by_its_rate_and_a_copy_of_it(clean_arm):
    """Of an LWR4+'s third joint a friction was told that followed q3, where five joints moved alike."""
    state = clean_arm.state
    first = 2 * np.pi / np.ptp(np.concatenate([s.q[:, 1] for s in state.segments]))
    waves = [(s.sign_dq[:, 1] * np.sin(first * s.q[:, 1]))[:, None] for s in state.segments]
    torque = np.concatenate([s.decimate(z, 1)[:, 0] for s, z in zip(state.segments, waves)])
    torque *= state.rows.scale[1]
    on = state.rows.use[1]

    def left(k, rate):
        copy = imitation(state.metric, 1, 1, state.segments, lambda s: s.q[:, k], torque, rate)
        return np.std((torque - copy)[on]) / np.std(torque[on])

    assert left(1, 1) < 0.01 < 0.3 < left(1, None)
    assert left(0, 1) > 0.3


def wave_of_drag(columns):
    """Viscous friction of joint 2 that is a wave of its position."""
    q, t = columns["q2"], columns["t"]
    columns["tau_m2"] = columns["tau_m2"] + 0.3 * np.sin(11 * q - 1.2) * np.gradient(q, t)


@pytest.mark.parametrize("right", [False, True])
def test_noise_that_has_swallowed_a_law_and_what_it_is_not_tells_neither(arm, right):
    """Dry friction by position says 14 nats of the wave, and functions nothing, where both count as noise."""
    planted = "position_dependent_friction:2:F=0.3,wavenumber=11"
    begun = opened(prepare_study(arm(planted) if right else arm(change=wave_of_drag)))
    state, effect = begun.state, catalogue()["position_dependent_friction"]
    place = next(place for place in effect.places(begun.layout) if place.joint == 1)
    r = refine(state.metric, state.scene, Term(effect, place, {"wavenumber": 11.0}))
    m = leading_metric(state, [r])
    r = refine(m, state.scene, r.term, turns=2)
    own, tau = weigh(m, r.columns), threshold(0.01)
    assert own.log_e > tau and sufficient(r.term, own, sufficiency(state, m, r, 1, tau), tau)
    short = short_of(state, m, r, own, 1, tau)
    assert (short is None) is right
    if short is not None:
        assert short.flex.variables == ("q2", "dq2") and short.own.gain < 0.5 * short.flex.fitted


def _a_wave_of_the_rate(columns):
    rate = np.gradient(columns["q2"], columns["t"])
    columns["tau_m2"] = columns["tau_m2"] + 0.02 * rate * np.sin(15 * columns["q2"])


def test_half_of_what_is_left_may_be_new_to_its_past(arm):
    """In the noise of a residual that is half the function itself it says half of what it does in its own. (A
    ripple that went with the rate was none, where a third was new.)"""
    state = opened(prepare_study(arm(change=_a_wave_of_the_rate))).state
    on = state.rows.use[1] & state.rows.fitted
    assert 0.4 < state.whiteners[1].sigma ** 2 / np.mean(state.residual[1, on] ** 2) < 0.6
    at_hand, (found, _) = ask(state, state.metric, 1, 5.0), heard(state, 1, 5.0)
    assert found.variables == at_hand.variables == ("q2", "dq2")
    assert found.evidence.log_e > 1.5 * at_hand.evidence.log_e


@pytest.mark.parametrize("seed", [5, 4])
@pytest.mark.long
def test_a_function_that_blocks_hardly_carry_over_is_neither_noise_nor_a_contact(tmp_path, seed):
    """A torque of sin q1 q3^2, ten times its channel's noise: of a UR10e 'the model lacks nothing' was said,
    of this arm 0.141 +- 0.019 N in the run that judges."""
    (tmp_path / "robot.yaml").write_text(ARM)
    runs = (PlannedRun("run1", "identify", 20.0), PlannedRun("run2", "identify", 20.0))
    made = simulate(tmp_path / "robot.yaml", "A", (), seed=seed, sensors=Sensors(rate_hz=200.0), runs=runs)
    for run in made.recordings:
        c, extra = run.columns, np.sin(run.columns["q1"]) * run.columns["q3"] ** 2
        c["tau_m1"] = c["tau_m1"] + 0.1 * np.std(c["tau_m1"]) / np.std(extra) * extra
    diagnosis = diagnose_study(load_study(write_simulation(made, tmp_path / "made")))
    assert not diagnosis.findings
    told = {(u.joints, frozenset(u.depends_on)) for u in diagnosis.unexplained}
    assert ((1,), frozenset(("q1", "q3"))) in told
    left = diagnosis.last.full_rate_error["identify"]["tau_m1"]
    assert diagnosis.noise_floor_percent["tau_m1"] < 0.7 * left


def pulled(columns):
    """A cable between the first two joints, whose torque no effect of the catalogue has."""
    pull = 0.4 * np.tanh((columns["q2"] - 0.77 * columns["q1"]) / 0.3)
    columns["tau_m2"] = columns["tau_m2"] + pull


def test_a_gain_says_no_less_than_functions_of_everything(arm):
    """It reads no signals of its own, and a cable's torque was told as 0.45 of a drive's."""
    begun = opened(prepare_study(arm(change=pulled)))
    state, effect = begun.state, catalogue()["drive_gain_error"]
    place = next(place for place in effect.places(begun.layout) if place.joint == 1)
    r = refine(state.metric, state.scene, Term(effect, place, {}), turns=2)
    short = short_of(state, state.metric, r, weigh(state.metric, r.columns), 1, threshold(0.01))
    assert short is not None and set(short.flex.variables) == {"q1", "q2"}


def _flipped_over(columns):
    """A cable that falls to the other side at one position on the way up, at another one on the way down."""
    q = columns["q2"]
    known = np.where(q > 0.0, 1.0, np.where(q < -0.5, -1.0, 0.0))
    last = np.maximum.accumulate(np.where(known != 0, np.arange(len(q)), 0))
    columns["tau_m2"] = columns["tau_m2"] + 0.3 * known[last]


def test_what_remembers_where_its_joint_came_from(arm):
    state = opened(prepare_study(arm(change=_flipped_over))).state
    found, _ = heard(state, 1, 5.0)
    assert found.variables == ("q2", "memory") and found.evidence.log_e > threshold(0.01)


def _stopped(columns):
    """A soft stop that the fitted run meets, and the one that judges hardly: it does not go so far."""
    columns["tau_m2"] = columns["tau_m2"] + STIFF * np.maximum(columns["q2"] - MET, 0) ** 2


def test_what_one_run_alone_met_is_heard_in_the_noise_beside_it(arm):
    state, tau = opened(prepare_study(arm(change=_stopped))).state, threshold(0.01)
    _, _, left = leftovers(state, [], [], tau, 0.01)
    (told,) = left
    assert told.channel == 1 and "q2" in told.variables and not told.carries_over and told.share > 0.9


@pytest.mark.long
def test_a_law_that_leans_on_turning_joints_is_none(tmp_path):
    """A torque sensor whose scale is a cubic, on a joint that turns every second: two frictions of the rate
    were told, each by less than what a function of rate and torque says beside them."""
    truth = make_case("outside", ["bent_scale"], 2073142912, "bent", tmp_path, 30.0, 250.0, "")
    diagnosis = diagnose_study(load_study(tmp_path / "cases" / "bent" / "study.yaml"))
    assert truth["effects"][0]["joints"] == [5]
    assert not diagnosis.findings
    (told,) = (u for u in diagnosis.unexplained if u.joints == (5,))
    assert set(told.depends_on) == {"dq5", "tau_m5"}
