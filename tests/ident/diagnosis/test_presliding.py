"""Presliding that shows in the error is no nuisance; a little of it is."""

import numpy as np
import pytest
from dry_arm import opened_dry_arm

from modelgen.effects.states import integrate_dahl

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
