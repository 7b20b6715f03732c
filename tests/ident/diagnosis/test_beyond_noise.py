"""What is no noise on the rows that judge has to be more than what the fitted rows leave open."""

import numpy as np
from dry_arm import back_again, opened_dry_arm

from ident.diagnosis.beyond_noise import _beside_turns


def test_starts_and_stops_alone_do_not_tell_friction_from_an_offset(tmp_path):
    """A joint that goes one way on the fitted rows, and back on those that judge; steps of 0.08 mrad: its
    error was 150 times what noise was said to make of its friction and offset, and a clean arm's joint was
    told to lack something."""
    state = opened_dry_arm(tmp_path, lambda q, dq: np.tanh(dq / 5e-4), 500.0, 3, step=8e-5, moves=back_again)
    on = state.rows.judged & state.rows.use[1]
    error = np.sqrt(np.mean(state.residual[1, on] ** 2))
    assert error > 0.5
    assert error < 3 * np.sqrt(np.mean(_beside_turns(state, 1, on)))
    both = state.rows.judged & state.rows.use[0]  # the first joint turns in both runs
    assert np.mean(_beside_turns(state, 0, both)) < np.mean(state.residual[0, both] ** 2)
