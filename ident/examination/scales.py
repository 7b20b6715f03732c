"""Torques off by a constant factor against the others, and what these recordings cannot tell from it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.examination.carried import CARRIED, Carried, carried
from ident.examination.check import Check, column_line
from ident.examination.hypothesis import Hypothesis, falls, signal_of
from ident.examination.quick import Assignment, Fit, Quick, alone, gain_of
from ident.examination.stretches import ODD, Explained, agreed, all_rows

SCALED = 0.5  # over no factor, and over any that is absurd; what else robots lacked gained 0.4 at most
FACTOR = 3.0  # about the best one: the range in which others are allowed
MILLI = 1e-3  # N m in a N mm
NORMAL = 1.96
TIMES = (
    0.01,
    0.02,
    0.03,
    0.05,
    0.1,
    0.2,
    0.3,
    0.5,
    0.7,
    1.0,
    1.4,
    2.0,
    3.0,
    5.0,
    10.0,
    20.0,
    30.0,
    50.0,
    100.0,
)


@dataclass(frozen=True, slots=True)
class Scale:
    """A torque's factor by all recordings that fit or judge, the least and the largest that stretch by
    stretch they do not reject beside it, and what it explains."""

    channel: int
    factor: float
    low: float
    high: float
    explained: Explained


def scales(quick: Quick, fit: Fit, how: Assignment, maps: dict, currents: bool) -> Iterator[Hypothesis]:
    """One torque off by a constant factor against the others, and the others' that these recordings cannot
    tell from it: of an AIRBOT's second torque times 1.3 the third's times 0.74 explains as much. Stretch by
    stretch they must reject that there is none. (Of eight real robots a factor gains at most 0.2 as they are,
    with a spring, a ripple or a weight that the model lacks; where the torque is 1.3 times too large 0.5 to
    1.7 on five of them.)"""
    seen = np.flatnonzero(quick.identify.rows > 10).tolist()
    most = _most_gain(quick, fit, how)
    whole: Quick | None = None
    for c in seen if most >= SCALED else ():
        told = _scaled(quick, fit, how, c, most)
        if told is None:
            continue
        factor, other = told
        whole = whole or all_rows(quick)
        its = allowed(whole, how, c, factor)
        plain = Explained(whole, whole.fit(how), how)
        if not agreed(plain, its.explained, ODD / len(seen)):
            continue
        if len(seen) == 2:
            yield _one_of_two(quick, fit, how.times([c], factor), c, factor, other, maps, currents)
            return
        milli = abs(np.log(factor * 1000)) < 0.2
        shares = _shares(whole, how, its)
        if shares and shares[0][0] > its.explained.fit.gain_over(plain.fit) + SCALED:
            continue
        beside = [] if milli else _as_well(whole, how, its, [k for k in seen if k != c])
        yield Hypothesis(
            other.gain_over(fit),
            how.times([c], factor),
            _milli(quick, fit, other, c, maps, currents)
            if milli
            else _off(quick, fit, other, (its, *beside), shares, maps, currents),
        )


def _scaled(quick: Quick, fit: Fit, how: Assignment, c: int, most: float) -> tuple[float, Fit] | None:
    """The factor of a channel's torque that explains most, with its fit, where it gains enough over none and
    over any that is absurd; most: what no factor gains more than."""
    grid = np.geomspace(1e-5, 1e5, 61)
    if any(most - quick.fit(how.times([c], f)).gain_over(fit) < SCALED for f in grid[[0, -1]]):
        return None
    gains = np.array([quick.fit(how.times([c], f)).gain_over(fit) for f in grid])
    best = int(np.argmax(gains))
    if not 0 < best < len(grid) - 1:
        return None
    fine = np.geomspace(grid[best - 1], grid[best + 1], 41)
    fits = [quick.fit(how.times([c], f)) for f in fine]
    place = int(np.argmax([other.gain_over(fit) for other in fits]))
    other = fits[place]
    gain = other.gain_over(fit)
    if min(gain, gain - max(gains[0], gains[-1])) < SCALED or other.holds_over(fit) < 0.5 * SCALED:
        return None
    return float(fine[place]), other


def _as_well(whole: Quick, how: Assignment, told: Scale, others: Sequence[int]) -> list[Scale]:
    """Factors of other torques that may be there in its place: those that it does not gain as much over as it
    has to over none, or that stretch by stretch are not rejected beside it."""
    plain, out = whole.fit(how), []
    most = told.explained.fit.gain_over(plain)
    for c in others:
        grid = np.geomspace(1e-5, 1e5, 61)
        best = max(grid, key=lambda f: whole.fit(how.times([c], f)).gain_over(plain))
        its = allowed(whole, how, c, float(best))
        gain = its.explained.fit.gain_over(plain)
        if gain > max(most - SCALED, 0.5 * SCALED) or not agreed(its.explained, told.explained, ODD):
            out.append((gain, its))
    return [its for _, its in sorted(out, key=lambda entry: -entry[0])]


def _shares(whole: Quick, how: Assignment, told: Scale) -> list[tuple[float, int, float]]:
    """(gain, other channel, share): of which other torque the channel's takes up how much, where that
    explains about as much as its factor or more; most first. What is left is linear in the share."""
    fit, c = whole.fit(how), told.channel
    most, out = told.explained.fit.gain_over(fit), []
    for k in np.flatnonzero(whole.identify.rows > 10).tolist():
        if k == c:
            continue
        (own, f), (other, g) = ((how.order[i], how.factor[i]) for i in (c, k))
        both = sum(s.weight[:, c] @ (s.Y[:, own] * s.Y[:, other]) for s in whole.fitted)
        W = g * whole.identify.v[c, other]
        size = g * g * whole.identify.yy[c, other] - fit.scale[c] * W @ fit.inverse @ W
        share = float((f * g * both - W @ fit.chi) / max(size, 1e-300))
        taken = np.where(np.arange(len(how.order)) == own, share * g / f, 0.0)
        less = [replace(s, Y=s.Y - s.Y[:, [other]] * taken) for s in whole.samples]
        gain = whole.of(less).fit(how).gain_over(fit)
        if gain > max(most - SCALED, 0.5 * SCALED):
            out.append((gain, k, share))
    return sorted(out, reverse=True)


def _milli(quick: Quick, fit: Fit, other: Fit, c: int, maps: dict, currents: bool) -> Check:
    name = signal_of(quick.columns, c, currents)
    factor = _times_too(MILLI, MILLI, MILLI)
    return Check(
        "torque_scale",
        (name,),
        f"{name} is {factor} beside the other torques (it looks like N mm): scaled, its error falls from "
        f"{100 * fit.error[c]:.0f} to {100 * other.error[c]:.0f} %",
        column_line(maps, {name: {"scale": MILLI}}),
    )


def _off(
    quick: Quick,
    fit: Fit,
    other: Fit,
    told: Sequence[Scale],
    shares: Sequence[tuple[float, int, float]],
    maps: dict,
    currents: bool,
) -> Check:
    """The check of one factor, and of what may be there in its place."""
    names = [signal_of(quick.columns, its.channel, currents) for its in told]
    sizes = [_times_too(its.factor, its.low, its.high) for its in told]
    lines = [column_line(maps, {n: {"scale": float(f"{i.factor:.3g}")}}) for n, i in zip(names, told)]
    first, c = told[0], told[0].channel
    which = [f"{name} {size}" for name, size in zip(names[1:], sizes[1:])]
    which += [f"{names[0]} takes up {a:.2g} of {signal_of(quick.columns, k, currents)}" for _, k, a in shares]
    beside = f", or {', or '.join(which)}, these recordings do not tell which" if which else ""
    return Check(
        "torque_scale",
        tuple(names),
        f"{names[0]} is {sizes[0]} beside the other torques{beside} (gear ratio, unit or drive gain): "
        f"scaled, its error falls from {100 * fit.error[c]:.0f} to {100 * other.error[c]:.0f} %",
        f"write {' or '.join(lines)}, where it is that" if which else lines[0],  # no line to undo it by
        spread=None if which else (first.high - first.low) / (2 * NORMAL * first.factor),
    )


def allowed(whole: Quick, how: Assignment, c: int, factor: float) -> Scale:
    """A torque's factor about a first one. (Of a rokae's first seven seconds 6.2 was told of a torque that is
    5 times too large; they allow 4 to 8.)"""
    factors = factor * np.geomspace(1 / FACTOR, FACTOR, 61)
    trials = [how.times([c], f) for f in factors]
    tried = [Explained(whole, whole.fit(trial), trial) for trial in trials]
    before = whole.fit(how)
    best = max(range(len(tried)), key=lambda k: tried[k].fit.gain_over(before))
    kept = [f for f, its in zip(factors, tried) if not agreed(its, tried[best], ODD)]
    return Scale(c, float(factors[best]), min(kept), max(kept), tried[best])


def _times_too(factor: float, low: float, high: float) -> str:
    """How far off a torque is that has to be multiplied by a factor in [low, high]."""
    word = "large" if factor < 1 else "small"
    if factor < 1:
        factor, low, high = 1 / factor, 1 / high, 1 / low
    span = "" if low == high else f" ({low:.2g} to {high:.2g})"
    return f"{factor:.3g} times too {word}{span}"


def _most_gain(quick: Quick, fit: Fit, how: Assignment) -> float:
    """No factors of the torques can gain more: every channel fitted by itself."""
    size, v = quick.identify.right(how)
    its = zip(quick.identify.G, v, size)
    own = np.concatenate([alone(G, right[:, None], np.array([norm])) for G, right, norm in its])
    return gain_of(fit.error, own)


def too_large(
    quick: Quick, how: Assignment, maps: dict, currents: bool, names: Collection[str]
) -> Iterator[Hypothesis]:
    """A torque beyond what joints give, told by its size and not searched: believed where stretch by stretch
    the other torques agree that it is too large, and do not reject N mm; by how much they allow is told.
    Where no torque feels it the size alone is left."""
    whole = all_rows(quick)
    before = whole.fit(how)
    as_it_is = Explained(whole, before, how)
    for c in np.flatnonzero(quick.identify.rows > 10).tolist():
        name = signal_of(quick.columns, c, currents)
        if name not in names or abs(how.factor[c]) != 1.0:
            continue
        trials = [how.times([c], float(MILLI / f)) for f in TIMES]
        tried = [Explained(whole, whole.fit(trial), trial) for trial in trials]
        best = max(tried, key=lambda its: its.fit.gain_over(before))
        left = [not agreed(its, best, ODD) for its in tried]
        milli = TIMES.index(1.0)
        if not left[milli] or not agreed(as_it_is, tried[milli], ODD):
            continue
        kept = [f / MILLI for f, stays in zip(TIMES, left) if stays]
        low, high = min(kept), max(kept)
        check = Check(
            "torque_scale",
            (name,),
            f"{name} is larger than robots' joints give, and by the other torques {low:.0f} to {high:.0f} "
            f"times too large, as in N mm: scaled, {falls(before, tried[milli].fit)}",
            column_line(maps, {name: {"scale": MILLI}}),
            spread=(high - low) * MILLI / (2 * NORMAL),
        )
        yield Hypothesis(np.inf, tried[milli].how, check)


def carried_scales(quick: Quick, fit: Fit, how: Assignment, currents: bool) -> list[Carried]:
    """Of each torque the factor with which validate is predicted best, where the best of them is so by far:
    those that are not clearly behind it."""
    told = []
    for c in np.flatnonzero(quick.identify.rows > 10).tolist():
        tried = []
        for factor in (sign * f for f in np.geomspace(1e-3, 1e3, 61) for sign in (1, -1)):
            other = quick.fit(how.times([c], factor))
            tried.append((carried(fit.error, other.error, fit.validate, other.validate), factor))
        value, factor = max(tried)
        told.append(Carried(value, f"{signal_of(quick.columns, c, currents)} times {factor:.2g}"))
    most = max((its.gain for its in told), default=-np.inf)
    return [its for its in told if its.gain > most - SCALED] if most > CARRIED else []


def _one_of_two(
    quick: Quick, fit: Fit, how: Assignment, c: int, factor: float, other: Fit, maps: dict, currents: bool
) -> Hypothesis:
    """Of two torques either may be the wrong one, but where a factor of 1000 tells N mm."""
    other_one = next(k for k in np.flatnonzero(quick.identify.rows > 10).tolist() if k != c)
    large, small = (other_one, c) if factor > 1 else (c, other_one)
    ratio = max(factor, 1 / factor)
    names = (signal_of(quick.columns, large, currents), signal_of(quick.columns, small, currents))
    lines = [
        column_line(maps, {name: {"scale": float(f"{value:.3g}")}})
        for name, value in zip(names, (1 / ratio, ratio))
    ]
    milli = abs(np.log(ratio / 1000)) < 0.2
    check = Check(
        "torque_scale",
        names[:1] if milli else names,
        f"{names[0]} is {ratio:.3g} times too large beside {names[1]}"
        + (" (it looks like N mm)" if milli else f", or {names[1]} as much too small")
        + f": scaled, {falls(fit, other)}",
        lines[0] if milli else f"write {lines[0]} or {lines[1]}",
    )
    return Hypothesis(other.gain_over(fit), how, check)
