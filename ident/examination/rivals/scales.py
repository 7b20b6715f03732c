"""Torques off by a constant factor against the others, and what these recordings cannot tell from it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.examination.check import FEW, Check, instead, listed, nothing_tells
from ident.examination.fits.best_factor import GRID, factor_of
from ident.examination.fits.hypothesis import SWAPPED, Asked, Hypothesis, falls
from ident.examination.fits.own_factors import WORDS, each_by_itself, own_factors
from ident.examination.fits.quick import Assignment, Fit, Quick, gain_of
from ident.examination.fits.stretches import (
    ODD,
    RARE,
    Explained,
    agreed,
    all_rows,
    half_of,
    same,
    steadily,
)
from ident.examination.rivals.rivals import standing
from ident.examination.torques.signs import evidence

SCALED = 0.5  # over no factor, and over any that is absurd; what else robots lacked gained 0.4 at most
USUAL = 0.2  # gain by a factor of torques of robots as they are
FACTOR, WIDE = 3.0, 100.0  # about the best one: the range in which others are allowed; about N mm
MILLI = 1e-3  # N m in a N mm
NORMAL = 1.96


@dataclass(frozen=True, slots=True)
class Scale:
    """A factor of torques by all recordings that fit or judge, the least and the largest that stretch by
    stretch they do not reject beside it, and what it explains."""

    channels: tuple[int, ...]
    factor: float
    low: float
    high: float
    explained: Explained


def scales(asked: Asked) -> Iterator[Hypothesis]:
    """One torque off by a constant factor against the others, the one that explains most, or those behind a
    joint together where these explain steadily more, as drives of another size or unit do, and all that these
    recordings cannot tell from it: of an AIRBOT's second torque times 1.3 the third's times 0.74 explains as
    much. Stretch by stretch they must reject that there is none, and must not ask for another fault instead.
    Each torque times a number of its own has to gain over one by as much as one over none. (Of an AIRBOT's
    fourth torque times 3, all of them 0.3 s late, it was told, and gained 0.2 over that. Of eight real robots
    a factor gains at most 0.2 as they are, with a spring, a ripple or a weight that the model lacks; where
    the torque is 1.3 times too large 0.5 to 1.7 on five of them. Of a UR10e's last three currents times 5 and
    a Franka's last four torques times 3 nothing was told.)
    """
    best = _best(asked)
    if best is not None:
        yield from _beside_others(asked, *best)


def _best(asked: Asked) -> tuple[Explained, Scale, Fit] | None:
    """What is explained as it is, the best scale of those that stretches ask for, and its fit."""
    seen, how = asked.seen, asked.how
    most = gain_of(asked.fit.error, asked.alone)  # no factors can gain more
    groups = [(c,) for c in seen] + [tuple(seen[k:]) for k in range(2, len(seen) - 1)]
    tried = [_scaled(asked, which, most) for which in groups] if most >= SCALED else []
    found = [(which, *its) for which, its in zip(groups, tried) if its is not None]
    if not found:
        return None
    whole = all_rows(asked.quick)
    plain = Explained.by(whole, how)
    told = [(allowed(whole, how, which, factor), after) for which, factor, after in found]
    told = [(its, after) for its, after in told if _rejects(plain, its.explained, len(groups))]
    return (plain, *_of_one_or_more(plain, told)) if told else None


def _beside_others(asked: Asked, plain: Explained, its: Scale, after: Fit) -> Iterator[Hypothesis]:
    """A scale, where nothing explains more, and what these recordings cannot tell from it."""
    seen, how, whole = asked.seen, asked.how, plain.quick
    gain, which = after.gain_over(asked.fit), its.channels
    if _in_milli(its):
        yield Hypothesis(gain, how.times(which, MILLI), _milli(asked, after, which))
        return
    others = standing(asked, whole, how, its.explained)
    if others is None:
        return
    factors = [allowed(whole, how, [k], factor_of(whole, how, [k]).factor) for k in seen if (k,) != which]
    beside = [other for other in factors if _alike(plain, its.explained, other.explained)]
    near = [o for o in others if not o.beside or not agreed(o.explained, its.explained, ODD)]
    near = [o for o in near if not same(o.explained, its.explained, 0.01)]  # of some, or of all the others
    near.sort(key=lambda o: -o.explained.fit.gain_over(plain.fit))
    most = its.explained.fit.gain_over(plain.fit)
    more = [other.words for other in near if other.explained.fit.gain_over(plain.fit) > most]
    words = [o.words for o in near if o.words not in more and _alike(plain, its.explained, o.explained)]
    alone, clearly = each_by_itself(whole, how, seen, its.explained)
    if clearly and (each := _each(asked, own_factors(whole, how, seen))).gain > gain + SCALED:
        yield each
        return
    words += [WORDS] if alone else []
    yield Hypothesis(gain, how.times(which, its.factor), _off(asked, after, (its, *beside), words, more))


def _rejects(plain: Explained, told: Explained, asked: int) -> bool:
    """Whether stretches reject that there is no factor, one of so many that are asked: by squares, or by
    logarithms. (A torque that is far too small is explained as by itself, as it hardly moves the model: with
    its factor squares of its own grow, in few stretches most. Of a TX40's second one, 101 times too small,
    that the third contradicts the others was told.)"""
    rate = ODD / (2 * asked)
    return agreed(plain, told, rate) or steadily(plain, told, rate)


def _of_one_or_more(plain: Explained, told: Sequence[tuple[Scale, Fit]]) -> tuple[Scale, Fit]:
    """One torque's factor, in N mm before any other, or that of several together where it explains steadily
    more than any one."""

    def most(some: Sequence[tuple[Scale, Fit]]) -> tuple[Scale, Fit]:
        return max(some, key=lambda its: (_in_milli(its[0]), its[0].explained.fit.gain_over(plain.fit)))

    one = [its for its in told if len(its[0].channels) == 1]
    more = [its for its in told if all(steadily(x.explained, its[0].explained, RARE) for x, _ in one)]
    return most(more or one or told)


def turned_scales(asked: Asked) -> Iterator[Hypothesis]:
    """One torque off by a constant factor and turned: the motor's side of a gear that reverses. Of a small
    torque neither the sign nor a factor alone may say anything. (Of a Franka's fifth torque times -1/30 the
    sixth one was told to be unexplained; of an AIRBOT's the fourth is no turned one, by its friction.)"""
    for c in asked.seen:
        how = asked.how.times([c], -1.0)
        turned = replace(asked, how=how, fit=asked.quick.fit(how))
        if gain_of(asked.fit.error, turned.alone) < SWAPPED:  # which no factor changes
            return
        if _scaled(turned, (c,), gain_of(turned.fit.error, turned.alone)) is None:
            continue
        best = _best(turned)
        if best is None or best[1].channels != (c,):
            continue
        how = how.times([c], MILLI if _in_milli(best[1]) else best[1].factor)
        after = asked.quick.fit(how)
        rubs = evidence(asked.quick, after, how)
        against = any(rubs.against(k) for k in asked.seen)  # or another torque is the turned one
        if against or not asked.better(after, SWAPPED):
            continue
        for its in _beside_others(turned, *best):
            if its.check.signals == (asked.name(c),):
                factor = -its.how.factor[c] / asked.how.factor[c]
                message = its.check.message.replace(" is ", " has the other sign and is ", 1)
                line = asked.line({asked.name(c): {"scale": float(f"{factor:.3g}"), "sign": -1}})
                check = replace(its.check, message=message, remedy=line)
                yield replace(its, gain=after.gain_over(asked.fit), check=check)


def _in_milli(its: Scale) -> bool:
    return bool(abs(np.log(its.factor / MILLI)) < 0.2)


def _alike(plain: Explained, told: Explained, other: Explained) -> bool:
    """Whether another explanation of the same torques is one by which a factor does not gain as much as it
    has to over none, or that stretch by stretch is not rejected beside it. (Beside an AIRBOT's third torque
    times 0.75 the sixth was told as the square of itself, which nothing had asked for.)"""
    if not half_of(plain, told, other):
        return False
    most, gain = (its.fit.gain_over(plain.fit) for its in (told, other))
    return bool(gain > max(most - SCALED, 0.5 * SCALED) or not agreed(other, told, ODD))


def _scaled(asked: Asked, which: Sequence[int], most: float) -> tuple[float, Fit] | None:
    """The factor of these torques that explains most, with its fit, where it gains enough over none and
    over any that is absurd; most: what no factor gains more than."""
    absurd = asked.quick.fits([asked.how.times(which, f) for f in GRID[[0, -1]]])
    if min(most - fit.gain_over(asked.fit) for fit in absurd) < SCALED:
        return None
    best = factor_of(asked.quick, asked.how, which)
    if best.gain - max(best.absurd, 0.0) < SCALED:
        return None
    other = asked.quick.fit(asked.how.times(which, best.factor))
    return None if other.holds_over(asked.fit) < 0.5 * SCALED else (best.factor, other)


def _milli(asked: Asked, other: Fit, which: Sequence[int]) -> Check:
    names = asked.names(which)
    return Check(
        "torque_scale",
        names,
        f"{_named(names)} {_times_too(MILLI, MILLI, MILLI)} beside the other torques, {_as_in(names)}: "
        f"scaled, {falls(asked.fit, other)}",
        asked.line({name: {"scale": MILLI} for name in names}),
    )


def _as_in(names: Sequence[str]) -> str:
    return "as in mA" if names[0][0] == "i" else "as in N mm"


def _named(names: Sequence[str]) -> str:
    return f"{listed(names)} {'is' if len(names) == 1 else 'are'}"


def _each(asked: Asked, how: Assignment) -> Hypothesis:
    """Every torque times a number of its own: nothing else can be asked of them."""
    after = asked.quick.fit(how)
    remedy = "give them in N m: with drive_gains: where they are currents, with a scale: of each in columns:"
    message = f"{WORDS}: with the numbers that explain most {falls(asked.fit, after)}"
    return Hypothesis(after.gain_over(asked.fit), how, Check("torque_scale", (), message, remedy))


def _off(
    asked: Asked, other: Fit, told: Sequence[Scale], others: Sequence[str], more: Sequence[str] = ()
) -> Check:
    """The check of one factor, and of what may be there in its place; more: what explains more than it. (Of a
    Franka's sixth torque that drifted in one run it was told to be 1.2 times too large.)"""
    each = [asked.names(its.channels) for its in told]
    names = tuple(dict.fromkeys(name for its in each for name in its))
    sizes = [_times_too(its.factor, its.low, its.high) for its in told]
    scale = [{"scale": float(f"{its.factor:.3g}")} for its in told]
    lines = [asked.line(dict.fromkeys(own, its)) for own, its in zip(each, scale)]
    known = [f"{its.low:.2g} to {its.high:.2g} by these torques" for its in told]
    first = told[0]
    which = [*(f"{listed(own)} {size}" for own, size in zip(each[1:], sizes[1:])), *others]
    if more or len(which) > FEW:
        fallen = f"scaled, {falls(asked.fit, other)}"
        its = f"{_named(each[0])} {sizes[0]} beside the other torques"
        return nothing_tells([*more, its, *which], fallen)
    beside = f"{instead(which)}, these recordings do not tell which" if which else ""
    return Check(
        "torque_scale",
        names,
        f"{_named(each[0])} {sizes[0]} beside the other torques{beside} (gear ratio, unit or drive gain): "
        f"scaled, {falls(asked.fit, other)}",
        f"write {' or '.join(f'{line} ({its})' for line, its in zip(lines, known))}, where it is that"
        if which  # no line to undo it by
        else f"{lines[0]}  # {known[0]}",
        open=bool(which),
        spread=None if which else (first.high - first.low) / (2 * NORMAL * first.factor),
    )


def allowed(
    whole: Quick, how: Assignment, channels: Sequence[int], factor: float, span: float = FACTOR
) -> Scale:
    """A factor of torques about a first one. (Of a rokae's first seven seconds 6.2 was told of a torque that
    is 5 times too large; they allow 4 to 8.) What robots lack makes other factors explain a little more, all
    along: that does not reject one. (Of a Franka's sixth torque times 0.5, which as it is gains by 0.86, it
    was told to be 1.6 to 1.9 times too small.)"""
    factors = factor * np.geomspace(1 / span, span, 61)
    hows = [how.times(channels, f) for f in factors]
    tried = [Explained(whole, fit, its) for fit, its in zip(whole.fits(hows), hows)]
    best, low, high = ends(factors, tried, whole.fit(how))
    return Scale(tuple(channels), float(factors[best]), low, high, tried[best])


def ends(factors: np.ndarray, tried: Sequence[Explained], before: Fit) -> tuple[int, float, float]:
    """Place of the factor that explains most, and the two between which none is rejected beside it."""
    best = max(range(len(tried)), key=lambda k: tried[k].fit.gain_over(before))
    behind = [tried[best].fit.gain_over(its.fit) for its in tried]
    rejected = [gain > USUAL and agreed(its, tried[best], ODD / 2) for gain, its in zip(behind, tried)]
    kept = np.flatnonzero(~np.array(rejected))
    low, high = (float(factors[k]) for k in np.clip([kept[0] - 1, kept[-1] + 1], 0, len(factors) - 1))
    return best, low, high


def _times_too(factor: float, low: float, high: float) -> str:
    """How far off a torque is that has to be multiplied by a factor in [low, high]."""
    word = "large" if factor < 1 else "small"
    span = "" if low == high else span_of(factor, low, high)
    return f"{max(factor, 1 / factor):.3g} times too {word}{span}"


def span_of(factor: float, low: float, high: float) -> str:
    """Behind how many times too large or small a torque is that has to be multiplied by such a factor."""
    low, high = (1 / high, 1 / low) if factor < 1 else (low, high)
    return f" ({low:.3g} to {high:.3g})"


def too_large(asked: Asked, names: Collection[str]) -> Iterator[Hypothesis]:
    """Torques beyond what joints give, told by their size and not searched, all together and each: believed
    where stretch by stretch the other torques agree that they are too large, and do not reject N mm; by how
    much they allow is told. (Of a KR 300 whose torques were all some times too large the last one was N mm:
    it fits no other. Of a TX40 with two in N mm the first was 800 times too small.) Where no torque feels it
    the size alone is left."""
    whole, how = all_rows(asked.quick), asked.how
    as_it_is = Explained.by(whole, how)
    large = [c for c in asked.seen if asked.name(c) in names and abs(how.factor[c]) == 1.0]
    for which in ([large] if len(large) > 1 else []) + [[c] for c in large]:
        its, milli = allowed(whole, how, which, MILLI, WIDE), Explained.by(whole, how.times(which, MILLI))
        open_ = its.low < 1.01 * MILLI / WIDE  # as well as nothing: the others agree with no size of it
        if open_ or not its.high >= MILLI or not agreed(as_it_is, milli, ODD):
            continue
        told = asked.names(which)
        check = Check(
            "torque_scale",
            told,
            f"{listed(told)} {'is' if len(told) == 1 else 'are'} larger than robots' joints give, and by the "
            f"other torques {1 / its.high:.0f} to {1 / its.low:.0f} times too large, {_as_in(told)}: scaled, "
            f"{falls(as_it_is.fit, milli.fit)}",
            asked.line({name: {"scale": MILLI} for name in told}),
            spread=(1 / its.low - 1 / its.high) * MILLI / (2 * NORMAL),
        )
        yield Hypothesis(np.inf, milli.how, check)
