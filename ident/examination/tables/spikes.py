"""Which samples of a table are no measurement: empty, sentinels, spikes, frozen; and which jumps are wraps.

One pass, block by block. What is found is kept sparsely (row, column, value instead), so that later passes
over the table only look it up; every replaced sample has weight zero from then on.

A spike of one or two samples stands off the median of its five neighbours while the local prediction

    x_i ~ (-x_(i-2) + 4 x_(i-1) + 4 x_(i+1) - x_(i+2)) / 6

fails elsewhere by far less. The median follows every monotone stretch exactly (fast motion, a reversal's
step of friction), the prediction's own scatter is noise, quantisation and curvature at once (Hampel 1974,
with the scale taken from the prediction because a median's deviation is zero on a ramp). Its scale is the
90 % quantile over 200 samples, at most three times the 75 and five times the 60 %, so that spikes do not hide
each other.
Torques jump honestly (dry friction in one sample at 100 Hz reaches 0.6 of their range on the measured
robots): there a spike must also be as large as the signal's range, or stand alone between samples that go on
as if it were not there. (Of a KR 300's first torque at 50 Hz spikes of 0.7 of it were let pass: 53 % were
foretold for 17.)
"""

from __future__ import annotations

import numpy as np

from ident.signals.runs import runs_of

SPIKE = 15.0  # in the local scale; 9 is the most on eleven measured robots' positions
TORQUE_SPIKE = 12.0
TORQUE_RANGE = 0.9  # of the signal's range; 0.67 is the most on the measured robots
LONE = 0.5
LEAST_SPIKE = 1e-4  # rad or m: below it nothing is harmed
GROSS = 30.0  # ranges from the median at which short runs are no measurement
GROSS_RUN = 20  # samples
MARK = 1.0  # ranges from the median at which a logger's mark is one, if it leaps
SENTINELS = (999.0, 9999.0, 99999.0, 999999.0, 32767.0, 32768.0, 65535.0, 2147483647.0, 2147483648.0)
ABSURD = 1e9
DROPOUTS, DROPOUT_RUN, DROPOUT = 10, 3, 8.0  # rows, of them at most in a row, times the usual change
VALUES = 20  # of a signal that is measured, at least
BY_CHANCE = 1e-3  # that what stands next to zeros is so near to them
LEAST_LEAP, MESSAGES = 5e-3, 64  # rad, m, N m or N; rows that are lost at most
STRETCH = 100  # samples of a local scale
FEWEST = 20  # samples that show a scatter
_NOWHERE = np.zeros(0, int)
RAILS = 0.02  # share of a signal at an end of its range, from which on it is clipped


def no_measurement(
    x: np.ndarray, factor: np.ndarray, offset: np.ndarray, known: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(N, m) each: absurd numbers and sentinels far outside the rest; short runs far outside it.

    known (m,): the range of the signals in what came before.
    """
    with np.errstate(all="ignore"):
        whole = bool((np.abs(x) <= ABSURD).all())  # and every number finite
        out = np.zeros(x.shape, bool) if whole else np.isfinite(x) & (np.abs(x) > ABSURD)
        clean = x if whole else np.where(out, np.nan, x)
        if whole:
            low, middle, high = np.percentile(clean[:: max(1, len(x) // 4000)], [5, 50, 95], axis=0)
        else:
            live = np.isfinite(clean).any(axis=0)
            low, middle, high = np.zeros((3, x.shape[1]))
            if live.any():
                low[live], middle[live], high[live] = np.nanpercentile(clean[:, live], [5, 50, 95], axis=0)
        away = np.abs(clean - middle)
        reach = np.maximum(high - low, 1e-12)
        marks = _marks(clean, factor, offset, away > MARK * reach)
        far = away > 5 * reach
        if not far.any():
            return out | marks, far
        raw = np.abs((clean - offset) / factor)
        sentinel = np.zeros_like(out)
        for value in SENTINELS:
            sentinel |= np.abs(raw - value) < 1e-6 * value
        changes = np.abs(np.diff(clean, axis=0))
        smallest = np.where(changes > 0, changes, np.inf).min(axis=0, initial=np.inf)
        changes = np.nan_to_num(smallest, posinf=0.0)
        gross = away > np.maximum(GROSS * np.maximum(reach, np.maximum(known, 1e-3)), 12 * changes)
    out = out | (far & sentinel) | marks
    return out, np.column_stack([_short(g, c) for g, c in zip((gross & ~out).T, clean.T)])


def dropouts(x: np.ndarray) -> np.ndarray:
    """(N,) bool: single rows of a torque (N,) that read one and the same number far from their neighbours,
    as where a message was lost and the field stayed empty."""
    none = np.zeros(len(x), bool)
    finite = x[np.isfinite(x)] + 0.0  # no negative zeros
    many = int(np.ceil(max(DROPOUTS, 0.003 * len(x))))
    drawers = (finite.view(np.uint64) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(52)  # equal: the same
    if np.bincount(drawers.astype(np.intp), minlength=1).max() < many:
        return none
    finite.sort()
    if not (finite[many - 1 :] == finite[: len(finite) - many + 1]).any():  # no number so often
        return none
    values, counts = np.unique(finite, return_counts=True)
    if len(values) < VALUES:
        return none
    mine = x == values[int(np.argmax(counts))]
    good = np.flatnonzero(~mine & np.isfinite(x))
    usual = _usual(np.abs(np.diff(x[good])), 0.75)
    at = np.flatnonzero(mine)
    after = np.clip(np.searchsorted(good, at), 1, len(good) - 1)
    before = good[after - 1]
    single = (before < at) & (at < good[after]) & (good[after] - before <= DROPOUT_RUN + 1)
    away = np.minimum(np.abs(x[at] - x[before]), np.abs(x[at] - x[good[after]])) > DROPOUT * usual
    lost = at[single & away]
    if len(lost) >= DROPOUTS and len(lost) > 0.5 * len(at):
        none[lost] = True
    return none


def emptied(x: np.ndarray, n: int, offset: np.ndarray) -> np.ndarray:
    """(N, m) bool: zeros to which and from which a signal leaps as it hardly changes else, with those that
    others of its kind (n positions, then torques) read meanwhile and no longer, as where a message was lost
    and its fields stayed empty. Of a torque only where a joint moves; what passes zero on its way is no leap.
    (Of an LWR4+ that lost 20 rows now and then 4.6 kg on its fifth link were told, of one that lost its
    fourth position that it is the sixth.)"""
    zero = x == offset  # 0 as it is recorded
    out = np.zeros(x.shape, bool)
    moves, every = np.abs(np.diff(x[:, :n], axis=0)), zero[:, :n].all(axis=1)
    for k in np.flatnonzero(zero.any(axis=0) & ~zero.all(axis=0)):
        kept = np.flatnonzero(~zero[:, k])
        if len(np.unique(x[kept, k])) < VALUES:  # a switch, or coarse
            continue
        usual = _usual(np.abs(np.diff(x[kept, k]))[np.diff(kept) == 1], 0.99 if k < n else 0.75)
        if not np.isfinite(usual):
            continue
        least = max(DROPOUT * usual, LEAST_LEAP)
        for start, stop in runs_of(zero[:, k]):
            ends = [at for at in (start - 1, stop) if 0 <= at < len(x)]
            leap = np.abs(x[ends, k] - offset[k])
            if k < n:  # a whole turn is none
                leap = np.minimum(leap, np.abs(leap - 2 * np.pi))
            long = stop - start > MESSAGES
            if not (leap > least).all() or long or (len(ends) < 2 and not every[start:stop].all()):
                continue
            if k >= n and len(ends) == 2 and _passes(x[ends, k] - offset[k], stop - start, least):
                continue
            if k < n or (moves[start:stop] > 0.1 * np.quantile(moves, 0.99, axis=0)).any():
                out[start:stop, k] = True
    for kind in (range(n), range(n, x.shape[1])):
        lost = np.asarray(out[:, kind].any(axis=1))
        for j in kind if lost.any() else ():
            for start, stop in runs_of(zero[:, j]):
                out[start:stop, j] |= np.all(lost[start:stop])  # else it rests at zero
    return out


def _passes(ends: np.ndarray, between: int, least: float) -> bool:
    """Whether a line from the sample before so many zeros to the one behind is no further from zero. (A
    torque of -0.035 and 0.036 N m before and behind one, where its joint turned, was told to be no value.)"""
    return bool(np.abs(np.linspace(ends[0], ends[1], between + 2)[1:-1]).max() <= least)


def _usual(steps: np.ndarray, share: float) -> float:
    """By how much a signal changes, where it does: of one that is held for some rows most steps are none. (Of
    an AIRBOT whose torques were new every fourth row two were told to be no value where they passed zero.)"""
    steps = steps[steps > 0]
    return float(np.quantile(steps, share)) if len(steps) else np.inf


def dead_band(x: np.ndarray, zero: float) -> float:
    """Below which a torque (N,) reads zero, 0.0 where there is no such band: no sample stands inside, many as
    far again outside, and most zeros begin and end as near to it as it ever comes. (Those of a Franka's and a
    KR 300's second torque were told as a logger's marks for no value, of a UR10e's third current nothing; so
    were those of a KR 300's fourth at 100 Hz, which steps over much of it where its joint turns.)"""
    mine = x == zero
    if np.count_nonzero(mine) < VALUES:  # most torques, at once
        return 0.0
    kept = np.sort(np.abs(x[~mine & np.isfinite(x)] - zero))
    if len(np.unique(kept[kept < 2 * kept[:1]])) < VALUES:
        return 0.0
    next_to = np.abs(x[_beside(mine)] - zero)
    next_to = next_to[np.isfinite(next_to)]
    if not len(next_to):
        return 0.0
    nearer = np.searchsorted(kept, np.median(next_to)) / len(kept)  # a half where they stand anywhere
    chance = (4 * nearer) ** (len(next_to) / 2)  # at most, that half of so many are as near
    return float(kept[0]) if chance < BY_CHANCE else 0.0


def _beside(mine: np.ndarray) -> np.ndarray:
    """(N,) bool: the samples next to some of these (N,)."""
    wide = np.pad(mine, 1)
    return (wide[:-2] | wide[2:]) & ~mine


def _marks(x: np.ndarray, factor: np.ndarray, offset: np.ndarray, away: np.ndarray) -> np.ndarray:
    """A logger's mark inside a large signal's reach: exactly its number, begun and ended by a leap."""
    out = np.zeros(x.shape, bool)
    for k in np.flatnonzero(away.any(axis=0)):
        mine = away[:, k].copy()
        mine[mine] = np.isin(np.abs((x[mine, k] - offset[k]) / factor[k]), SENTINELS)
        if mine.any():
            out[:, k] = _short(mine, x[:, k])
    return out


def _short(far: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Of the runs of a signal (N,) far outside the rest, those that are short and begin and end in a leap."""
    out = np.zeros(len(x), bool)
    finite = x[np.isfinite(x)]
    middle = float(np.median(finite)) if far.any() and len(finite) else 0.0
    for start, stop in runs_of(far):
        before, after = max(start - 1, 0), min(stop, len(x) - 1)
        with np.errstate(all="ignore"):
            leaps = np.abs([x[start] - x[before], x[stop - 1] - x[after]])
        if stop - start <= GROSS_RUN and (leaps > 0.5 * np.abs(x[[start, stop - 1]] - middle)).all():
            out[start:stop] = True
    return out


def is_spike(x: np.ndarray, position: bool, known: float = 0.0, resumed: np.ndarray = _NOWHERE) -> np.ndarray:
    """(N,) bool for one signal (N,); known: its range in what came before; resumed (K,): rows with which
    the log goes on after a pause, over which nothing is a neighbour."""
    none = np.zeros(len(x), bool)
    if len(x) < 20:
        return none
    a, b, c, d, e = _neighbours(x, resumed)
    off = np.abs(c - _median_of_five(a, b, c, d, e))
    if position:
        candidates = off > LEAST_SPIKE
    else:  # 4.4 is the most on the measured robots
        candidates = off > TORQUE_SPIKE * np.maximum(np.maximum(np.abs(b - a), np.abs(d - b)), np.abs(e - d))
        if off.max() > TORQUE_RANGE * known:
            low, high = np.percentile(x, [5, 95])  # then the whole range, of all but what may be spikes
            low, high = np.percentile(x[off <= TORQUE_RANGE * max(high - low, known)], [0.5, 99.5])
            candidates |= off > TORQUE_RANGE * max(high - low, known)
    if not candidates.any():
        return none
    miss = np.abs(c - (-a + 4 * b + 4 * d - e) / 6)
    candidates &= off > LONE * miss  # beside a leap the prediction fails by half of it, the median hardly
    off = np.minimum(off, miss)  # where it turns it is off the median, and as its neighbours foretell
    changes = np.abs(np.diff(x))
    changes = changes[changes > 0]
    smallest = np.quantile(changes, 0.1) if len(changes) else np.inf
    told = _off_rails(x)
    least = max(0.3 * _scale(miss[told]), smallest)
    factor = SPIKE if position else TORQUE_SPIKE
    for at in np.flatnonzero(candidates & (off > factor * least)):
        near = slice(max(0, at - STRETCH), at + STRETCH)
        its = miss[near][told[near]]
        none[at] = off[at] > factor * (_scale(its) if len(its) >= FEWEST else _scale(miss[told]))
    return none


def _neighbours(x: np.ndarray, resumed: np.ndarray) -> list[np.ndarray]:
    """The samples (N,) two rows before to two behind each of x (N,); beyond an end of a stretch its last one.
    (Of a KR 300 that pauses for a second two samples of a position beside it were told to be spikes.)"""
    wide = np.concatenate([x[:1], x[:1], x, x[-1:], x[-1:]])
    its = [wide[k : k + len(x)] for k in range(5)]
    if len(resumed):
        row = np.arange(len(x))
        ends = np.concatenate([[0], resumed, [len(x)]])
        here = np.searchsorted(ends, row, side="right")
        its = [x[np.clip(row + k, ends[here - 1], ends[here] - 1)] for k in range(-2, 3)]
    return its


def _off_rails(x: np.ndarray) -> np.ndarray:
    """(N,) the rows that show a signal's scatter: not those where it rests on an end of its range, clipped.
    (A Kinova's current, clipped: what came through was a spike beside a scatter of nothing.)"""
    low, high = np.percentile(x, [0.5, 99.5], method="nearest")
    rest = (x == low) | (x == high)
    off = ~np.convolve(rest, np.ones(5), "same").astype(bool)
    return off if np.mean(rest) > RAILS and off.sum() >= FEWEST else np.ones(len(x), bool)


def _scale(miss: np.ndarray) -> float:
    """Of what a prediction misses, also where spikes stand in a twentieth of the rows: each spoils five."""
    some, more, most = np.quantile(miss, [0.6, 0.75, 0.9])
    return float(min(most, 3 * more, 5 * some))


def median_of_four(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    return np.asarray(0.5 * (low + high))


def _median_of_five(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray, e: np.ndarray) -> np.ndarray:
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    return np.maximum(np.minimum(low, high), np.minimum(np.maximum(low, high), e))
