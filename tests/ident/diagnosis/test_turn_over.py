"""Within which rate dry friction changes its sign is read off the torque."""

from dataclasses import replace

import numpy as np
import pytest
from dry_arm import one_way, opened_dry_arm

from ident.diagnosis.evidence.turned import turned as turned_over
from ident.diagnosis.rows.signs import SignColumns, sign_columns
from ident.diagnosis.rows.turn_over import SHORTEST, _summit, grids, ways
from ident.signals.dry_friction import TurnOver, mean_sign, with_turns

RATES = (0.004, 0.08, 0.03)  # rad/s within which the joints' friction turns over


@pytest.fixture(scope="module")
def turned(tmp_path_factory):
    """An arm whose torque is that of the model but for how its dry friction changes sign."""
    folder = tmp_path_factory.mktemp("turned")
    return opened_dry_arm(folder, lambda q, dq: np.tanh(dq / np.array(RATES)), 200.0, 0)


def test_the_rates_are_recovered(turned):
    assert turned.turns[1].rate == pytest.approx(RATES[1], rel=0.1)
    assert turned.turns[2].rate == pytest.approx(RATES[2], rel=0.2)
    assert turned.turns[0].rate < 0.015


def test_a_joint_that_goes_one_way_shows_its_rate_by_starts_and_stops(tmp_path):
    """Of point to point moves that never turned the sign was a sharp one: structure in the rate of four
    joints of a clean arm. At a constant friction there is none to see."""
    soft = opened_dry_arm(tmp_path, lambda q, dq: np.tanh(dq / np.array(RATES)), 200.0, 0, moves=one_way)
    assert soft.turns[1].rate == pytest.approx(RATES[1], rel=0.02)
    (tmp_path / "sharp").mkdir()
    sharp = opened_dry_arm(tmp_path / "sharp", lambda q, dq: np.sign(dq), 200.0, 0, moves=one_way)
    assert 1 not in sharp.turns


def test_the_rates_are_settled_to_what_chance_leaves(turned):
    """One parabola through widths a half apart ended at 0.0765 and 0.0314. In slow motions, most of which a
    sign takes to turn over, so much of a width is other friction."""
    assert turned.turns[1].rate == pytest.approx(RATES[1], rel=0.01)
    assert turned.turns[2].rate == pytest.approx(RATES[2], rel=0.01)


def test_kept_columns_are_those_of_their_motion(turned):
    """Another motion's columns are its own; without room nothing is kept and all is told."""
    turns, kept, none = [TurnOver(0.05, 0.001), TurnOver(0.02)], SignColumns(), SignColumns(0.0)
    still = tuple(replace(s, q=0.5 * s.q, speed=-s.speed) for s in turned.segments)
    for segments in (turned.segments, still, turned.segments):
        fresh = sign_columns(segments, turned.rows, 1, 1, turns)
        for memory in (kept, kept, none):
            assert np.array_equal(sign_columns(segments, turned.rows, 1, 1, turns, kept=memory), fresh)
    assert len(kept.kept) == 2 and not none.kept


def test_no_travel_is_made_up(turned):
    """The torque has none; a second width has to pay for itself, and a search that began in it comes back."""
    assert [turned.turns[j].travel for j in range(3)] == [0.0, 0.0, 0.0]
    stuck = {j: TurnOver(0.1 * RATES[j], 1e-3) for j in range(3)}
    again = replace(turned, turns=stuck)
    for _ in range(4):
        again = turned_over(again)
    assert [again.turns[j].travel for j in range(3)] == [0.0, 0.0, 0.0]
    assert again.turns[1].rate == pytest.approx(RATES[1], rel=0.15)


def test_what_is_left_is_the_noise(turned):
    """0.02 N m of white noise at 200 Hz, below the rows' own cut-off."""
    for c in range(3):
        left = np.std(turned.residual[c][turned.rows.use[c]])
        assert left < 1.6 * 0.02 * np.sqrt(2 * 10.0 / 200.0)


def test_grids_stay_inside_the_motion(turned):
    segments = turned.segments
    for joint in range(3):
        assert ways(segments, joint) == 2
        ladders = grids(segments, joint)
        top = max(np.abs(s.speed[:, joint]).max() for s in segments)
        reach = max(s.q[:, joint].max() for s in segments) - min(s.q[:, joint].min() for s in segments)
        assert ladders["rate"][0] > 0 and ladders["rate"][-1] <= 0.31 * top
        assert ladders["travel"][0] == pytest.approx(SHORTEST * reach, rel=1e-3)
        assert np.all(np.diff(ladders["rate"]) > 0)


def test_a_joint_that_goes_back_slowly_goes_both_ways(turned):
    """At a fiftieth of its top rate, where that is certain."""
    slow = [replace(s, speed=np.where(s.speed < 0, s.speed / 50, s.speed)) for s in turned.segments]
    assert ways(slow, 1) == 2
    unsure = [replace(s, certain=np.where(s.speed < 0, 0.9 * s.certain, s.certain)) for s in slow]
    assert ways(unsure, 1) == 1


def test_parts_of_one_run_have_their_turns_in_common(turned):
    """A joint that turns in those alone that judge: 0.02 mrad/s were taken for 0.19, and an arm without a
    fault was told a coupling of two joints by 808 nats."""
    speeds = [np.abs(s.speed[: s.rows * s.every, 2]).reshape(s.rows, -1) for s in turned.segments]
    slow = np.concatenate(speeds).min(axis=1) < 0.4
    turning, usable = np.convolve(slow, np.ones(21), "same") > 0.5, turned.rows.usable  # their filter is long
    parts = replace(turned.rows, fitted=usable & ~turning, judged=usable & turning, held_apart=False)
    wrong = replace(turned, rows=parts, turns={**turned.turns, 2: TurnOver(0.01)})
    assert turned_over(wrong, {2}).turns[2].rate == pytest.approx(RATES[2], rel=0.05)
    apart = replace(wrong, rows=replace(parts, held_apart=True))
    assert turned_over(apart, {2}).turns[2].rate != pytest.approx(RATES[2], rel=0.3)


def test_the_summit_of_a_curve():
    """Of a parabola, of a curve that falls off more steeply on one side, at the end of a range."""
    grid = np.geomspace(0.01, 1, 9)
    for curve, top in (
        (lambda w: -((np.log(w) - np.log(0.07)) ** 2), 0.07),
        (lambda w: -300 * (np.log(w / 0.07) - 1 + 0.07 / w), 0.07),
        (np.log, grid[-1]),
    ):
        assert _summit(grid, curve(grid), curve) == pytest.approx(top, rel=1e-2)
    assert _summit(grid, np.log(grid), np.log) == grid[-1]


def test_slow_motions_leave_friction_its_ordinary_width(turned):
    """Of an arm that never moved faster than 50 mrad/s the widths ended at 15, and what dry friction did
    within 20 was a Stribeck friction."""
    for top in (0.05, 0.15):
        slow = [replace(s, speed=s.speed * (top / np.abs(s.speed).max(axis=0))) for s in turned.segments]
        widest = grids(slow, 1)["rate"][-1]
        assert widest == pytest.approx(min(0.1, 2 * top), rel=1e-6)
    fast = grids(turned.segments, 1)["rate"][-1]
    assert fast <= 0.3 * max(np.abs(s.speed[:, 1]).max() for s in turned.segments) + 0.1


TRAVELS = (6e-5, 8e-5, 5e-5)  # rad within which the joints' friction gives way, and no rate


def given_way(q, dq):
    """(N, 3) between reversals z = s + (z0 - s) exp(-|q - q0| / travel), step by step."""
    z = np.sign(dq)
    for k in range(1, len(q)):
        s = np.sign(q[k] - q[k - 1])
        z[k] = s + (z[k - 1] - s) * np.exp(-np.abs(q[k] - q[k - 1]) / TRAVELS)
    return z


def test_friction_that_gives_way_does_not_fall_where_a_joint_stops_to_turn(tmp_path):
    """At up to 10 mrad/s it did, within the least rate that was tried: friction that depends on the rate and
    on the last turn was told of arms without a fault."""
    state = opened_dry_arm(tmp_path, given_way, 250.0, 1, 0.01)
    for j in range(3):
        assert state.turns[j].rate == 0.0
        assert state.turns[j].travel == pytest.approx(TRAVELS[j], rel=0.05)
    for c in range(3):
        for side in (state.metric.fitted, state.metric.judged):
            assert np.abs(side.residual[c]).max() < 5


def test_a_rate_beside_a_travel_pays_for_itself(tmp_path):
    """Of positions in steps as long as the travel any gain let friction fall before a joint turned: of a
    clean arm four fifths of an error on the rows that judge were eight rows at turns."""
    state = opened_dry_arm(tmp_path, given_way, 125.0, 1, 0.1, 8e-5)
    for j in range(3):
        assert state.turns[j].rate == 0.0
        assert state.turns[j].travel == pytest.approx(TRAVELS[j], rel=0.05)


def test_frequencies_at_which_steps_hide_the_motion_are_not_looked_at(tmp_path):
    """An encoder's steps are noise of the accelerations, times the inertia: above what positions say of the
    motion that was all there was to see, and rows were 15 to 17 deviations off."""
    state = opened_dry_arm(tmp_path, given_way, 125.0, 2, 0.1, 8e-5)
    lowest = min(hz for bank in state.problem.source.prepared.banks for hz in bank.lowest)
    assert state.problem.source.cutoff_hz == lowest < 5
    for c in range(3):
        for side in (state.metric.fitted, state.metric.judged):
            assert np.abs(side.residual[c]).max() < 7


def test_a_sample_is_the_mean_over_a_drive_s_cycle():
    """At 1 kHz the rate's own step, at 20 Hz hardly more than the instant; a sign that turns between two
    samples moves by its share."""
    dq = np.array([-0.3, -0.1, 0.1, 0.3])
    assert mean_sign(dq, 0.02, 20.0) == pytest.approx(np.tanh(dq / 0.02), abs=2e-3)
    assert mean_sign(np.array([-0.2, -0.05, 0.1]), 0.0, 1000.0)[1] == pytest.approx(-2 / 3)
    assert mean_sign(np.array([-0.2, -0.05, 0.1]), 0.0, 20.0)[1] == -1.0


def test_a_friction_gives_way_from_where_its_joint_turned():
    """Of a sine in samples, and of the same path in a hundred times as many."""
    t = np.arange(2000) / 200.0
    fine = np.arange(200_000) / 20_000.0
    q, dq = np.sin(2.1 * t), 2.1 * np.cos(2.1 * t)
    turn = TurnOver(0.0, 1e-4)
    truth = turn.state(np.sin(2.1 * fine), 2.1 * np.cos(2.1 * fine), 20_000.0)[::100]
    assert np.abs(turn.state(q, dq, 200.0) - truth).max() < 0.02
    late = turn.state(q, dq, np.inf)  # at the sample behind each turn
    assert np.abs(late - truth).max() > 0.1
    path, own = with_turns(q, dq, 200.0)
    assert np.array_equal(path[own], q) and len(path) - len(q) == np.sum(dq[1:] * dq[:-1] < 0)


def test_a_torque_of_the_instant_is_told_from_a_mean(tmp_path):
    """By the sample behind each turn; a sign of either kind takes no travel to turn over."""

    def means(q, dq):
        return np.stack([mean_sign(x, 0.0, 200.0) for x in dq.T], axis=1)

    for name, sign, instant in (("samples", lambda q, dq: np.sign(dq), True), ("means", means, False)):
        (tmp_path / name).mkdir()
        state = opened_dry_arm(tmp_path / name, sign, 200.0, 0)
        assert [state.turns[j].instant for j in range(3)] == [instant] * 3
        assert [state.turns[j].travel for j in range(3)] == [0.0] * 3
