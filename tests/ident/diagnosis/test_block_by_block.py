"""What each block of the fitted rows is foretold by: a law by all others, a spike and loud turns by none."""

from dataclasses import replace

import numpy as np
import pytest

from ident.diagnosis.evidence.block_by_block import block_gains
from ident.diagnosis.evidence.blocks import agree
from ident.diagnosis.evidence.state import solved
from ident.diagnosis.evidence.sufficiency import ask
from ident.diagnosis.rows.unknown_turns import unknown_turns

TAU = 8.3


def told(state, torque, only=None):
    """Gains of the best function where the fitted rows of the first channel have this much more torque."""
    Y = state.rows.Y.copy()
    Y[0] += np.where(state.rows.fitted, torque, 0.0)
    state = solved(replace(state, rows=replace(state.rows, Y=Y)))
    flex = ask(state, state.metric, 0, TAU, only)
    assert flex is not None
    return block_gains(state, state.metric, 0, flex)


def foretold(gains):
    return gains.sum() > TAU and agree(gains, np.full(len(gains), np.inf), 0.01)


@pytest.fixture(scope="module")
def quiet(clean_arm):
    """Its state; the noise of a row; the positions of the first joint at the rows."""
    state = clean_arm.state
    used = state.rows.use[0] & state.rows.fitted
    q = np.concatenate([s.q[s.every - 1 :: s.every, 0][: s.rows] for s in state.segments])
    return state, float(np.std(state.residual[0, used])), q


def test_a_law_is_foretold_by_all_other_blocks(quiet):
    state, noise, q = quiet
    assert foretold(told(state, 6 * noise * np.sin(5 * q)))


def test_a_spike_is_not(quiet):
    """Of 20 deviations, in two rows: nearly all that its function says is of one block."""
    state, noise, _ = quiet
    spike = np.zeros(len(state.rows.t))
    spike[np.flatnonzero(state.rows.fitted & state.rows.use[0])[100:102]] = 20 * noise
    assert not foretold(told(state, spike, frozenset({"t", "q1", "dq1"})))


def test_what_is_not_known_of_turns_is_not(quiet):
    """A torque of 40 deviations after every turn, each of its own size, fading as friction's own does."""
    state, noise, _ = quiet
    turns = unknown_turns(state.segments, 0, state.turns[0]) * state.rows.scale[0][:, None]
    sizes = np.random.default_rng(0).normal(size=turns.shape[1]) / np.abs(turns).max(axis=0)
    assert turns.shape[1] > 8
    assert not foretold(told(state, 40 * noise * turns @ sizes))
