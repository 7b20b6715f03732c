"""Logs that pause, or two recordings in one file: what follows a pause is no neighbour of what was before."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, strangers_log

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_tables
from ident.examination.tables.clock import uniform_clock
from ident.examination.tables.excerpt import Excerpt, resumed
from ident.examination.tables.repeats import coarse, noisy
from ident.examination.tables.signals import Columns
from ident.examination.tables.spikes import is_spike

COLUMNS = Columns("run", ("q1", "tau_m1"), np.zeros(2, int), ("1",), {}, ("tau_m1",), np.zeros(1, bool))


def _paused(rate=100, step=0.0):
    """Two minutes of one joint, a minute apart, in steps if any."""
    t = np.arange(6000) / rate
    later = np.concatenate([t, t + t[-1] + 60])
    q = np.concatenate([1.5 * np.sin(0.6 * t), 0.7 + np.sin(0.9 * t + 1)])
    return later, np.round(q / step) * step if step else q


def test_rows_with_which_a_log_goes_on():
    t, _ = _paused()
    assert resumed(t).tolist() == [6000] and not len(resumed(t[:6000]))
    assert not len(resumed(np.zeros(9))) and not len(resumed(t[:1]))
    assert not len(resumed(np.delete(t[:6000], [50, 51, 700])))  # rows that are missing are no pause


def test_a_joint_that_moves_slowly_in_a_log_of_which_pieces_are_looked_at_moves():
    excerpt, rows = Excerpt(), np.arange(3_000_000)
    for block in np.array_split(rows, 30):
        t = block / 1000 + 1200 * (block > 1_500_000)
        excerpt.take((block, t, (1e-3 * block / 1000)[:, None]))
    assert excerpt.every > 1 and 1.3 < excerpt.reach(0) < 1.6


@pytest.mark.parametrize("step", [0.0, 2e-3])
def test_a_position_that_is_elsewhere_after_a_pause_is_neither_noisy_nor_coarse(step):
    """Positions of all arms were told to be noisy, or none, and no filter was lowered for their steps."""
    t, q = _paused(step=step)
    excerpt = Excerpt()
    excerpt.take((np.arange(len(t)), t, np.column_stack([q, np.cos(t)])))
    assert [len(block[1]) for block in excerpt.stretches(0, 0)] == [6000, 6000]
    assert sum(len(block[1]) for block in excerpt.unpaused()) == len(t)
    assert excerpt.reach(0) < 3.01
    assert not list(noisy(COLUMNS, excerpt, set())) and not list(coarse(COLUMNS, excerpt, set()))


def test_what_stands_beside_a_pause_is_no_spike():
    rows, noise = np.arange(400), 1e-6 * np.random.default_rng(0).normal(size=400)
    pace = np.select([rows < 100, rows < 200, rows == 200, rows < 300], [0, 0.02, -0.14, -0.02], 0)
    q, t = np.cumsum(pace) + noise, rows / 100 + (rows >= 200)  # in which it turned
    assert is_spike(q, True).any() and not is_spike(q, True, resumed=resumed(t)).any()
    spoilt = np.where(rows == 197, q + 0.5, q)  # near a pause, and one
    assert np.flatnonzero(is_spike(spoilt, True, resumed=resumed(t))).tolist() == [197]


def test_a_line_over_rows_is_no_clock_of_a_log_that_pauses():
    """Of a Barrett at 250 Hz whose log pauses for a minute one of 15 Hz was told, and used."""
    t = np.arange(800) * 0.004 + 1e-5 * np.random.default_rng(0).normal(size=800)
    assert uniform_clock(lambda: [t]).unbroken
    paused = np.concatenate([t, t + t[-1] + 60])
    assert not uniform_clock(lambda: [paused]).unbroken


@pytest.mark.parametrize("robot", ["barrett_wam_2dof", "kuka_kr300"])
@pytest.mark.parametrize("how", [(0, False, True, True), (100, True, False, True)])
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_two_recordings_in_one_file(tmp_path, robot, how):
    """Of a KR 300's all positions were told to be noise, a Barrett's was refused for leaps in it."""

    def together(log):
        a, b = (log.tables[name] for name in [*log.tables][:: len(log.tables) - 1])
        later = a["t"][-1] + 60 - b["t"][0]
        log.tables["run1"] = {k: np.concatenate([a[k], b[k] + later * (k == "t")]) for k in a}

    (tmp_path / "plain").mkdir()
    plain, changed = (
        examine_tables(prepare_study(strangers_log(folder, robot, how, change)))
        for folder, change in ((tmp_path / "plain", lambda log: None), (tmp_path, together))
    )
    said = {(c.check, c.recording) for c in plain}
    new = [c for c in changed if (c.check, c.recording) not in said]
    assert all("on ticks of a uniform clock" in c.message for c in new), new
