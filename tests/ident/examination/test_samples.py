"""Wraps and spikes of long tables, block by block: whole turns are counted once, spikes are not lost rows."""

from dataclasses import replace

import numpy as np
import pytest

from ident.examination.fits.samples import _cubics
from ident.examination.tables.clock import time_unit
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.mending import Mender
from ident.examination.tables.repeats import coarse, noisy, periods
from ident.examination.tables.signals import Columns, lost_samples, units, wraps
from ident.examination.tables.spikes import is_spike

N, BLOCK = 20000, 3000


def mended(x, t=np.arange(N) / 1000):  # noqa: B008
    """(rows of one pass, values that later passes see, counts, wraps) of columns (N, 3): two positions."""
    mender = Mender(2, np.ones(3), np.zeros(3))
    parts = [slice(k, min(k + BLOCK, N)) for k in range(0, N, BLOCK)]
    blocks = list(mender.run((np.arange(N)[part], t[part], x[part]) for part in parts))
    mending = mender.mending()
    _, again, _ = mending.apply(np.arange(N), t, x, 2, np.array([0, 1, 0]))
    return np.concatenate([values for _, _, values in blocks]), again, mender.counts, mending.wrap_rows


@pytest.mark.parametrize("began", [0.0, 1.7e9])
def test_values_lost_between_stamps_that_repeat(began):
    """Two positions lost in a row were interpolated to be 5 million rad, or none in seconds since 1970."""
    rows = np.arange(N)
    true = np.column_stack([np.sin(0.004 * rows), np.cos(0.005 * rows), np.sin(0.006 * rows)])
    seen = true.copy()
    seen[700:702, 0] = np.nan
    once, again, _, _ = mended(seen, began + rows // 2 * 0.002)
    assert np.abs(once - true).max() < 1e-6 and np.abs(again - true).max() < 1e-6


@pytest.mark.parametrize("together", [False, True])
def test_logs_put_together_with_stamps_of_their_own_are_told(together):
    """Where positions and torques stand in rows of their own all were to be exported without these."""
    t = np.arange(N) / 1000
    x = np.column_stack([np.sin(t), np.cos(t), np.sin(2 * t)])
    x[1::2, :2] = np.nan
    x[int(together) :: 2, 2] = np.nan
    mender = Mender(2, np.ones(3), np.zeros(3))
    for part in np.array_split(np.arange(N), 7):
        list(mender.run([(part, t[part], x[part])]))
    columns = Columns(
        "run", ("q1", "q2", "tau_m1"), np.array([0, 1, 0]), ("1", "2"), {}, (), np.zeros(2, bool)
    )
    said, *_ = lost_samples(columns, mender, N)  # and of the last row
    assert said.outcome == "refused" and "of 20000 samples of q1" in said.message
    assert ("0 of the rows hold every signal" in said.message) is not together
    assert ("interpolate them to the same stamps" in said.remedy) is not together


@pytest.mark.parametrize("zero", [0.0, 3.0])
def test_turns_and_spikes_of_a_long_table(zero):
    rng, t = np.random.default_rng(0), np.arange(N) / 1000
    true = np.column_stack([9 * np.sin(1.1 * t), 0.5 * np.sin(3 * t), np.cos(t)])
    true += [1e-5, 1e-5, 1e-2] * rng.normal(size=true.shape)
    seen = true.copy()
    seen[:, 0] = (true[:, 0] - zero) % (2 * np.pi) + zero
    jumps = 1 + np.flatnonzero(np.abs(np.diff(seen[:, 0])) > 3)
    spikes = rng.choice(N, 60, replace=False)
    seen[spikes, 1] += 0.3
    once, again, counts, wraps = mended(seen)
    assert np.array_equal(wraps, jumps) and len(jumps) > 10
    assert {kind: tuple(count) for kind, count in counts.items()} == {"spike": (0, 60, 0)}
    for found in (once, again):
        off = found[:, :2] - true[:, :2]
        assert np.ptp(off[:, 0]) < 1e-9 and np.abs(off[:, 1]).max() < 1e-4


@pytest.mark.parametrize("spikes", [(6.5, -6.5), (-6.1, 11.0)])
def test_spikes_of_about_a_turn_leave_the_position_where_it_was(spikes):
    """Row after row, one of them taken for a turn and the other not, all that followed was turns off."""
    true = np.tile(0.6 * np.sin(np.arange(N) / 1000)[:, None], 3)
    seen = true.copy()
    seen[500 : 500 + len(spikes), 1] += spikes
    once, again, _, _ = mended(seen)
    assert all(np.abs(found[:, :2] - true[:, :2]).max() < 0.3 for found in (once, again))


@pytest.mark.parametrize(("step", "words"), [(1e-14, "1e+14 a second"), (3e-7, "hours"), (1e-3, None)])
def test_a_rate_that_nothing_is_recorded_at_is_refused(step, words):
    check = time_unit("run", step, {})
    assert (check is None) == (words is None)
    if check is not None:
        assert check.outcome == "refused" and words in check.message and "scale: " in check.remedy


def test_what_a_clipped_signal_lets_through_is_no_spike():
    """Where it rests on its highest value it shows no scatter, and any sample that comes through stands far
    off beside that; its scatter is that of the other stretches. A real spike there is still one."""
    rng = np.random.default_rng(1)
    x = np.concatenate([0.2 * rng.normal(size=3000), 2.0 + 0.4 * rng.standard_t(2, size=1000)])
    clipped = np.clip(x, -1.0, 1.0)
    assert not is_spike(clipped, position=False).any()
    clipped[3500] = 40.0
    assert np.flatnonzero(is_spike(clipped, position=False)).tolist() == [3500]


def _leaps(q):
    t, mender = np.arange(N) / 1000, Mender(1, np.ones(2), np.zeros(2))
    x = np.column_stack([q, np.cos(t)])
    parts = [slice(k, min(k + BLOCK, N)) for k in range(0, N, BLOCK)]
    list(mender.run((np.arange(N)[part], t[part], x[part]) for part in parts))
    return [(row, round(size, 4)) for row, _, size in mender.leaps]


@pytest.mark.parametrize("slip", [0.0, 0.05])
def test_a_step_of_a_position_s_own_resolution_is_no_leap(slip):
    """A joint that turns slowly between marks of 5 mrad was said to have slipped by them."""
    t = np.arange(N) / 1000
    true = 0.1 * np.sin(0.7 * t) + 0.3 * np.clip(t - 12, 0, 5)
    q = np.round(true / 5e-3) * 5e-3 + slip * (t >= 5)
    assert [row for row, _ in _leaps(q)] == ([5000] if slip else [])


def test_a_resting_joint_that_slips_once_is_told():
    assert _leaps(0.4 + 0.05 * (np.arange(N) >= 9000)) == [(9000, 0.05)]


def test_a_leap_in_a_log_of_few_rows_is_told():
    """Of a TX40's second at 50 Hz in which a position was held for 0.3 s nothing was said."""
    t, mender = np.arange(55) / 50, Mender(1, np.ones(2), np.zeros(2))
    q = 2 * np.sin(3 * (t - 0.55))
    q[21:35] = q[20]
    list(mender.run([(np.arange(55), t, np.column_stack([q, np.cos(t)]))]))
    assert [row for row, _, _ in mender.leaps] == [35]


@pytest.mark.parametrize("scatter", [0.0, 0.7])
@pytest.mark.parametrize(("step", "much"), [(5e-3, True), (2e-3, True), (1e-5, False), (0.0, False)])
def test_steps_that_make_much_of_the_acceleration_are_coarse_however_large_the_motion(step, much, scatter):
    """Of a joint that sweeps 3 rad in steps of 5 mrad nothing was said, with errors of three times the size.
    Where its filter is lowered for them they make 0.4 % of it: only what scatters by more than its steps
    stays behind 10 Hz."""
    t = np.arange(5000) / 100
    q = 1.5 * np.sin(0.6 * t) + 0.15 * np.sin(2.1 * t)
    q += scatter * step * np.random.default_rng(0).normal(size=len(t))
    x = np.column_stack([np.round(q / step) * step if step else q, np.cos(t)])
    excerpt = Excerpt()
    excerpt.take((np.arange(len(t)), t, x))
    columns = Columns("run", ("q1", "tau_m1"), np.array([0, 0]), ("1",), {}, ("tau_m1",), np.array([False]))
    said = list(coarse(columns, excerpt, set()))
    assert [check.signals for check in said] == ([("q1",)] if much and scatter else [])
    assert all("behind a filter of 10 Hz" in check.message for check in said)


def test_steps_that_a_lowered_filter_takes_away_are_no_noise():
    """Of a clean arm at 0.1 rad/s, in steps of 0.22 mrad at 50 Hz, a position was told to be noisy."""
    t = np.arange(1500) / 50
    q = 0.1 * np.sin(0.6 * t) + 0.01 * np.sin(2.1 * t)
    step = 2.2e-4
    for noise, told in ((0.0, False), (1.5, True)):
        noisy_q = q + noise * step * np.random.default_rng(0).normal(size=len(t))
        excerpt = Excerpt()
        excerpt.take((np.arange(len(t)), t, np.column_stack([np.round(noisy_q / step) * step, np.cos(t)])))
        columns = Columns(
            "run", ("q1", "tau_m1"), np.zeros(2, int), ("1",), {}, ("tau_m1",), np.zeros(1, bool)
        )
        assert bool(list(noisy(columns, excerpt, set()))) is told


@pytest.mark.parametrize("pattern", [(2,), (3,), (1, 2), (1, 3, 2)])
def test_a_signal_that_is_new_every_two_rows_is_held(pattern):
    """Of a Barrett's first torque at 50 Hz, new every 0.04 s, nothing was said."""
    rows = np.repeat(np.arange(1000), np.resize(pattern, 1000))[:1000]
    t = np.arange(1000) / 50
    excerpt = Excerpt()
    excerpt.take((np.arange(len(t)), t, np.column_stack([np.sin(t), np.cos(2.1 * t)[rows]])))
    columns = Columns("run", ("q1", "tau_m1"), np.array([0, 0]), ("1",), {}, ("tau_m1",), np.array([False]))
    held = {1: (pytest.approx(pattern[0] / 50), pattern[0])} if len(pattern) == 1 else {}
    assert periods(columns, excerpt) == held


def test_the_rate_of_a_held_signal_is_that_of_its_time():
    """Of a UR10e's current of 10 Hz in rows of 10 and 12 ms it was told that it is recorded at 11.1 Hz."""
    t = np.cumsum(np.random.default_rng(2).choice([0.010, 0.012], p=[0.7, 0.3], size=4000))
    excerpt = Excerpt()
    first = np.searchsorted(t, np.floor(t * 10) / 10)
    excerpt.take((np.arange(len(t)), t, np.column_stack([np.sin(t), np.cos(2.1 * t)[first]])))
    columns = Columns("run", ("q1", "tau_m1"), np.array([0, 0]), ("1",), {}, ("tau_m1",), np.array([False]))
    assert periods(columns, excerpt) == {1: (pytest.approx(0.1, rel=0.01), 9)}


@pytest.mark.parametrize("rate", [0.03, 0.06, 0.1])
def test_even_motion_in_steps_is_not_held(rate):
    """Of a joint that turns at a constant rate, in steps of half a degree at 50 Hz, it was told that it is
    recorded at 7 Hz and held."""
    t = np.arange(1000) / 50
    q = rate * t
    coarse, slow = np.round(q / 8.7e-3) * 8.7e-3, (q + 0.1 * np.sin(t))[np.arange(1000) // 5 * 5]
    excerpt = Excerpt()
    excerpt.take((np.arange(len(t)), t, np.column_stack([coarse, slow, np.cos(t)])))
    joint, slides = np.array([0, 1, 0]), np.zeros(2, bool)
    columns = Columns("run", ("q1", "q2", "tau_m1"), joint, ("1", "2"), {}, ("tau_m1",), slides)
    assert set(periods(columns, excerpt)) == {1}


@pytest.mark.parametrize(
    ("steps", "told"), [((5e-3, 5e-3), " 0.005 rad"), ((2e-3, 5e-3), " up to 0.005 rad")]
)
def test_the_largest_of_steps_is_not_told_of_all(steps, told):
    """Of an AIRBOT whose fourth position was in degrees three others were told to move in its steps."""
    t = np.arange(5000) / 100
    q = 1.5 * np.sin(0.6 * t) + 0.15 * np.sin(2.1 * t)
    noise = 0.7 * np.random.default_rng(0).normal(size=len(t))
    x = np.column_stack([*(np.round(q / step + noise) * step for step in steps), np.cos(t)])
    excerpt = Excerpt()
    excerpt.take((np.arange(len(t)), t, x))
    joint, slides = np.array([0, 1, 0]), np.zeros(2, bool)
    columns = Columns("run", ("q1", "q2", "tau_m1"), joint, ("1", "2"), {}, ("tau_m1",), slides)
    (said,) = coarse(columns, excerpt, set())
    assert f"q1, q2 move in steps of{told}:" in said.message


@pytest.mark.parametrize(
    ("largest", "named"),
    [
        ([180e3, 60e3, 10e3, 7e3], (1, 2, 3, 4)),
        ([180e3, 60.0, 10.0, 7.0], (1,)),
        ([39e3, 2.9e3, 5.2e3, 300.0], (1, 2, 3, 4)),
        ([15e3, 12e3, 3e3, 1e3], ()),
    ],
)
def test_a_log_in_one_unit_is_told_with_all_its_torques(largest, named):
    """Of a UR10e in N mm three torques of six were to be divided by a thousand."""
    n = len(largest)
    signals = (*(f"q{j + 1}" for j in range(n)), *(f"tau_m{j + 1}" for j in range(n)))
    joint, labels = np.tile(np.arange(n), 2), tuple("1234")
    columns = Columns("run", signals, joint, labels, {}, signals[n:], np.zeros(n, bool))
    highest = np.array([1.0] * n + largest)
    excerpt = Excerpt()
    excerpt.take((np.arange(2), np.arange(2.0), np.stack([highest, highest])))
    said = list(units(columns, Mender(n, np.ones(2 * n), np.zeros(2 * n)), excerpt, -0.5 * highest, highest))
    assert [check.signals for check in said] == ([tuple(f"tau_m{j}" for j in named)] if named else [])
    for j in range(1, n + 1):
        assert all((f"tau_m{j}: {{scale: 0.001}}" in check.remedy) == (j in named) for check in said)


def test_a_torque_s_spike_that_stands_alone_is_one():
    """Of a KR 300 at 50 Hz six of 0.7 of the torque's range were let pass; friction's steps stay."""
    rng, t = np.random.default_rng(0), np.arange(500) / 50
    torque = np.sin(2 * t) + 0.4 * np.sign(np.cos(2 * t)) + 0.005 * rng.normal(size=500)
    assert not is_spike(torque, position=False).any()
    torque[[120, 333]] += (1.5, -1.5)
    assert np.flatnonzero(is_spike(torque, position=False)).tolist() == [120, 333]


@pytest.mark.parametrize(("size", "said"), [(15.0, set()), (4 * np.pi + 0.1, {"wrap"})])
def test_spikes_of_few_rows_are_neither_degrees_nor_turns(size, said):
    """Six of 55 rows: of a TX40's fourth joint both were told."""
    t = np.arange(55) / 50
    seen = np.column_stack([np.sin(3 * t), np.cos(t)])
    seen[4:55:9, 0] += size
    mender, excerpt = Mender(1, np.ones(2), np.zeros(2)), Excerpt()
    blocks = list(mender.run([(np.arange(55), t, seen)]))
    for block in blocks:
        excerpt.take(block)
    columns = Columns("run", ("q1", "tau_m1"), np.array([0, 0]), ("1",), {}, ("tau_m1",), np.array([False]))
    ends = [f(blocks[0][2], axis=0) for f in (np.min, np.max)]
    checks = [*units(columns, mender, excerpt, *ends), *wraps(columns, mender)]
    assert {c.check for c in checks} == said
    assert all("leaps by whole turns and back 6 times" in c.message for c in checks)


def test_sizes_of_signals_are_told_in_the_unit_they_are_read_in():
    """Steps of 0.39 A were told as 4.24, which are N m and stand in no log."""
    names, joint, slides = (
        ("q1", "q2", "i1", "i2", "tau_l2"),
        np.array([0, 1, 0, 1, 1]),
        np.array([False, True]),
    )
    columns = Columns("run", names, joint, ("1", "2"), {}, names[2:], slides)
    told = [columns.sized(k, 4.2419) for k in range(5)]
    assert told == ["4.24 rad", "4.24 m", "4.24 N m", "4.24 N", "4.24 N"]
    own = replace(columns, own_units=True)  # currents whose gains are not known
    assert [own.sized(k, 4.2419) for k in (2, 4)] == ["4.24", "4.24 N"]


@pytest.mark.parametrize("width", [7, 21, 199])
def test_cubics_are_those_of_scipy(width):
    from scipy.signal import savgol_filter

    x = np.random.default_rng(width).standard_normal(200).cumsum()
    for order, its in enumerate(_cubics(x, width, 0.01)):
        theirs = savgol_filter(x, width, 3, order, 0.01)
        assert its == pytest.approx(theirs, abs=1e-11 * abs(theirs).max())
