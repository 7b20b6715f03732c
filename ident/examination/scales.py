"""Torques off by a constant factor against the others, and what these recordings cannot tell from it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ident.examination.check import Check, column_line
from ident.examination.hypothesis import Hypothesis, falls, signal_of
from ident.examination.quick import Assignment, Fit, Quick, alone, gain_of
from ident.examination.rivals import rivals
from ident.examination.stretches import ODD, Explained, agreed, all_rows

SCALED = 0.5  # over no factor, and over any that is absurd; what else robots lacked gained 0.4 at most
FACTOR, WIDE = 3.0, 100.0  # about the best one: the range in which others are allowed; about N mm
MILLI = 1e-3  # N m in a N mm
NORMAL = 1.96
GRID = np.geomspace(1e-5, 1e5, 61)


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
    """One torque off by a constant factor against the others, the one that explains most, and all that these
    recordings cannot tell from it: of an AIRBOT's second torque times 1.3 the third's times 0.74 explains as
    much. Stretch by stretch they must reject that there is none, and must not ask for another fault instead.
    (Of eight real robots a factor gains at most 0.2 as they are, with a spring, a ripple or a weight that the
    model lacks; where the torque is 1.3 times too large 0.5 to 1.7 on five of them.)"""
    seen = np.flatnonzero(quick.identify.rows > 10).tolist()
    most = _most_gain(quick, fit, how)
    tried = [_scaled(quick, fit, how, c, most) for c in seen] if most >= SCALED else []
    found = [(c, *its) for c, its in zip(seen, tried) if its is not None]
    if not found:
        return
    whole = all_rows(quick)
    plain = Explained(whole, whole.fit(how), how)
    told = [(allowed(whole, how, c, factor), after) for c, factor, after in found]
    told = [(its, after) for its, after in told if agreed(plain, its.explained, ODD / len(seen))]
    if not told:
        return
    its, after = max(told, key=lambda each: (_in_milli(each[0]), each[0].explained.fit.gain_over(plain.fit)))
    gain, c = after.gain_over(fit), its.channel
    if _in_milli(its):
        yield Hypothesis(gain, how.times([c], MILLI), _milli(quick, fit, after, c, maps, currents))
        return
    others = list(rivals(whole, how, currents))  # some hundred: chance would confirm five of them
    if any(agreed(its.explained, other.explained, ODD / len(others)) for other in others):
        return
    factors = [_best_factor(whole, how, k) for k in seen if k != c]
    beside = [other for other in factors if _alike(plain, its.explained, other.explained)]
    words = [other.words for other in others if _alike(plain, its.explained, other.explained)]
    check = _off(quick, fit, after, (its, *beside), words, maps, currents)
    yield Hypothesis(gain, how.times([c], its.factor), check)


def _in_milli(its: Scale) -> bool:
    return bool(abs(np.log(its.factor / MILLI)) < 0.2)


def _alike(plain: Explained, told: Explained, other: Explained) -> bool:
    """Whether a factor does not gain as much over another explanation as it has to over none, or stretch by
    stretch the other is not rejected beside it."""
    most, gain = (its.fit.gain_over(plain.fit) for its in (told, other))
    return bool(gain > max(most - SCALED, 0.5 * SCALED) or not agreed(other, told, ODD))


def _best_factor(whole: Quick, how: Assignment, c: int) -> Scale:
    before = whole.fit(how)
    best = max(GRID, key=lambda f: whole.fit(how.times([c], f)).gain_over(before))
    return allowed(whole, how, c, float(best))


def _scaled(quick: Quick, fit: Fit, how: Assignment, c: int, most: float) -> tuple[float, Fit] | None:
    """The factor of a channel's torque that explains most, with its fit, where it gains enough over none and
    over any that is absurd; most: what no factor gains more than."""
    if any(most - quick.fit(how.times([c], f)).gain_over(fit) < SCALED for f in GRID[[0, -1]]):
        return None
    gains = np.array([quick.fit(how.times([c], f)).gain_over(fit) for f in GRID])
    best = int(np.argmax(gains))
    if not 0 < best < len(GRID) - 1:
        return None
    fine = np.geomspace(GRID[best - 1], GRID[best + 1], 41)
    fits = [quick.fit(how.times([c], f)) for f in fine]
    place = int(np.argmax([other.gain_over(fit) for other in fits]))
    other = fits[place]
    gain = other.gain_over(fit)
    if min(gain, gain - max(gains[0], gains[-1])) < SCALED or other.holds_over(fit) < 0.5 * SCALED:
        return None
    return float(fine[place]), other


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
    others: Sequence[str],
    maps: dict,
    currents: bool,
) -> Check:
    """The check of one factor, and of what may be there in its place."""
    names = [signal_of(quick.columns, its.channel, currents) for its in told]
    sizes = [_times_too(its.factor, its.low, its.high) for its in told]
    lines = [column_line(maps, {n: {"scale": float(f"{i.factor:.3g}")}}) for n, i in zip(names, told)]
    first, c = told[0], told[0].channel
    which = [*(f"{name} {size}" for name, size in zip(names[1:], sizes[1:])), *others]
    beside = f", or {', or '.join(which)}, these recordings do not tell which" if which else ""
    return Check(
        "torque_scale",
        tuple(names),
        f"{names[0]} is {sizes[0]} beside the other torques{beside} (gear ratio, unit or drive gain): "
        f"scaled, its error falls from {100 * fit.error[c]:.0f} to {100 * other.error[c]:.0f} %",
        f"write {' or '.join(lines)}, where it is that" if which else lines[0],  # no line to undo it by
        spread=None if which else (first.high - first.low) / (2 * NORMAL * first.factor),
    )


def allowed(whole: Quick, how: Assignment, c: int, factor: float, span: float = FACTOR) -> Scale:
    """A torque's factor about a first one. (Of a rokae's first seven seconds 6.2 was told of a torque that is
    5 times too large; they allow 4 to 8.)"""
    factors = factor * np.geomspace(1 / span, span, 61)
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
    span = "" if low == high else f" ({low:.3g} to {high:.3g})"
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
        its, scaled = allowed(whole, how, c, MILLI, WIDE), how.times([c], MILLI)
        milli = Explained(whole, whole.fit(scaled), scaled)
        if not its.low <= MILLI <= its.high or not agreed(as_it_is, milli, ODD):
            continue
        check = Check(
            "torque_scale",
            (name,),
            f"{name} is larger than robots' joints give, and by the other torques {1 / its.high:.0f} to "
            f"{1 / its.low:.0f} times too large, as in N mm: scaled, {falls(before, milli.fit)}",
            column_line(maps, {name: {"scale": MILLI}}),
            spread=(1 / its.low - 1 / its.high) * MILLI / (2 * NORMAL),
        )
        yield Hypothesis(np.inf, scaled, check)
