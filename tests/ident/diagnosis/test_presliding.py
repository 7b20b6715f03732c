"""Presliding that shows in the error is no nuisance; a little of it is."""

from dataclasses import replace

import numpy as np
import pytest
from dry_arm import opened_dry_arm

from ident.diagnosis.evidence.presliding import _by_rate_alone, _error, told_as_effects
from ident.diagnosis.evidence.settled import settled
from modelgen.effects.states import integrate_dahl

TAU = 8.3  # of a diagnosis at 1 %
WIDTH, RATE = 0.004, 0.03  # rad of travel before the first joint slips; rad/s, of the others' turn-over


@pytest.fixture(scope="module")
def soft(tmp_path_factory):
    """An arm whose first joint gives way over four thousandths of a radian, by Dahl's law."""

    def sign(q, dq):
        out = np.tanh(dq / RATE)
        out[:, 0] = integrate_dahl(q[:, 0], {"width": WIDTH}, 0.0)
        return out

    return opened_dry_arm(tmp_path_factory.mktemp("soft"), sign, 500.0, 1)


def test_travel_that_the_error_shows_is_left_to_the_search(soft):
    assert [d.travels for d in soft.problem.dry] == [False, True, True]
    assert soft.turns[0].travel == 0.0


def test_what_it_leaves_is_there_to_be_found(soft):
    left = [np.std(soft.residual[c][soft.rows.use[c]]) for c in range(3)]
    assert left[0] > 2 * max(left[1:])


def test_a_travel_that_fitted_rows_do_not_show_stays_dry_frictions_own(soft):
    """No search on them finds it: where a joint turns in rows alone that judge, they were far off."""
    dry = tuple(replace(d, travels=True) for d in soft.problem.dry)
    own = settled(replace(soft, problem=replace(soft.problem, dry=dry), turns={}), 3)
    assert own.turns[0].travel > 0.0 == told_as_effects(own, TAU).turns[0].travel
    signs = [np.abs(s.sign_dq[: s.rows * s.every, 0]).reshape(s.rows, -1) for s in own.segments]
    turning = np.convolve(np.concatenate(signs).min(axis=1) < 0.999, np.ones(21), "same") > 0.5
    hidden = replace(own, rows=replace(own.rows, fitted=own.rows.fitted & ~turning))
    assert told_as_effects(hidden, TAU).turns[0].travel > 0.0


def test_a_travel_shorter_than_any_effect_has_is_dry_frictions_own(tmp_path):
    """Of an arm at 20 mrad/s it is most of the error; left to the search, delays and lags were told."""
    width = 6e-5

    def sign(q, dq):
        return np.stack([integrate_dahl(x, {"width": width}, 0.0) for x in q.T], axis=1)

    state = opened_dry_arm(tmp_path, sign, 500.0, 2, top=0.02)
    assert [d.travels for d in state.problem.dry] == [True] * 3
    assert [state.turns[j].travel for j in range(3)] == pytest.approx([width] * 3, rel=0.1)
    for j in range(3):
        judged = state.rows.judged
        assert _error(state, j, judged) < 0.1 * _error(_by_rate_alone(state, range(3)), j, judged)


def test_half_of_it_over_a_travel_that_effects_have_is_left_to_the_search(tmp_path):
    """One width for both halves is shorter than any effect has: of a UR10e's fourth joint its hysteresis of
    0.7 mrad was taken so, and the ripple with it, for structure that nothing explains."""

    def sign(q, dq):
        out = np.tanh(dq / 0.005)
        out[:, 0] = 0.5 * out[:, 0] + 0.5 * integrate_dahl(q[:, 0], {"width": 5e-4}, 0.0)
        return out

    assert [d.travels for d in opened_dry_arm(tmp_path, sign, 500.0, 1).problem.dry] == [False, True, True]
