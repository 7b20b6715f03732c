"""Torques with another sign, another scale, or in another's place: what a quick fit shows.

Where joints share links, a wrong torque contradicts the others and the fit says which. A joint that shares
nothing fits as well either way; there friction decides: it takes energy out of the motion, and a moment of
inertia is positive. Both are linear in the parameters, so they have a standard deviation.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from ident.distributions import t_beyond
from ident.equations.columns import Columns
from ident.examination.check import Check, column_line, listed, turned_sign
from ident.examination.quick import (
    CARRIED,
    Assignment,
    Carried,
    Explained,
    Fit,
    Quick,
    alone,
    carried,
    functionals,
    gain_of,
    model_columns,
    regressor,
    stretch_gains,
)
from modelgen.geometry.names import ParameterName

CLEARLY = 0.7  # gain: one channel's error is halved
SWAPPED = 1.4
SCALED = 0.5  # over no factor, and over any that is absurd; what else robots lacked gained 0.4 at most
SURE = 5.0  # standard deviations
FRICTION = ("Fvm", "Fcm", "Fvl", "Fcl", "Fvc", "Fcc")
FACTOR = 3.0  # about the best one: the range in which others are allowed
MILLI = 1e-3  # N m in a N mm
ODD, NORMAL = 0.05, 1.96  # rate at which chance confirms what a torque's size has told before; its interval
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
NOTHING = 0.85  # error of a channel that the model does not explain
EXPLAINED = 0.5  # error of a torque above which no fault of it is believed: something else is missing
UNLIKE = 0.3  # error of a channel from which another robot's is thought of
CONFIGURATIONS = 40
POSITION_FACTORS = (0.1, 0.5, 2.0, 10.0, 180 / np.pi)
PARTLY, PARTLY_TIMES = 0.5, 6.0  # error of a channel, and against the others', from which it is said
MOST_SIGNS = 8  # torques whose signs are all tried together


@dataclass(frozen=True, slots=True)
class Evidence:
    """z values (C,) of the friction's power and of the moment of inertia, NaN where they are not seen."""

    friction: np.ndarray
    inertia: np.ndarray

    def against(self, c: int) -> bool:
        """This channel's torque puts energy in where friction takes it out, or its inertia is negative."""
        f, i = self.friction[c], self.inertia[c]
        if np.isfinite(f) and abs(f) > SURE:
            return bool(f < -SURE and not i > SURE)
        return bool(i < -SURE)

    def speaks_for(self, c: int) -> bool:
        f, i = self.friction[c], self.inertia[c]
        if np.isfinite(f) and abs(f) > SURE:
            return bool(f > SURE and not i < -SURE)
        return bool(i > SURE)


def evidence(quick: Quick, fit: Fit, how: Assignment) -> Evidence:
    """Power of friction and moment of inertia about each joint, in their standard deviations."""
    columns = quick.columns
    C, b = len(columns.channels), len(columns.parameters)
    kinds = [ParameterName.of(name) for name in columns.parameters]
    rubbing = np.array([kind is not None and kind.kind in FRICTION for kind in kinds])
    friction, inertia = np.full(C, np.nan), np.full(C, np.nan)
    s = max(quick.fitted, key=lambda s: len(s.q))
    some = slice(None, None, max(1, len(s.q) // CONFIGURATIONS))
    q = s.q[some]
    none = np.zeros_like(q)
    at_rest = regressor(columns, s.payload, q, none, none, none)
    places = model_columns(columns, s.payload)
    moved: dict[int, np.ndarray] = {}
    asked: list[tuple[np.ndarray, int, np.ndarray]] = []  # where the answer goes to, and to which vector
    for c in range(C):
        if not quick.identify.rows[c] > 10:
            continue
        j = int(columns.joint_of[c])
        power = np.zeros(b)
        for sample in quick.fitted:
            weight = sample.weight[:, c] * sample.dq[:, j]
            power += np.where(rubbing, weight @ sample.W[c], 0.0)
        if j not in moved:
            ddq = none.copy()
            ddq[:, j] = 1.0
            moved[j] = (regressor(columns, s.payload, q, none, ddq, none) - at_rest).mean(axis=1)
        h = np.zeros(b)
        h[places] = moved[j][c]
        asked += [(its, c, vector) for its, vector in ((friction, power), (inertia, h)) if np.any(vector)]
    if asked:
        values, stds = functionals(quick, fit, how, np.column_stack([vector for _, _, vector in asked]))
        for (its, c, _), z in zip(asked, values / np.maximum(stds, 1e-300)):
            its[c] = z
    return Evidence(friction, inertia)


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What would be different, how much better it fits, and the check that says so."""

    gain: float
    how: Assignment
    check: Check
    quick: Quick | None = None  # with other motions


def signal_of(columns: Columns, c: int, currents: bool) -> str:
    """The study's name of the signal behind a channel."""
    name = columns.channels[c]
    return "i" + name[5:] if currents and name.startswith("tau_m") else name


def all_signs(quick: Quick, fit: Fit, how: Assignment, maps: dict, currents: bool) -> Hypothesis | None:
    """Every torque of one side with the other sign: the fit is as good, and everything comes out negative."""
    seen = evidence(quick, fit, how)
    rows = np.flatnonzero(quick.identify.rows > 10).tolist()
    against = [c for c in rows if seen.against(c)]
    speaking = [c for c in rows if seen.speaks_for(c)]
    if len(rows) < 2 or speaking or len(against) < max(min(3, len(rows)), 0.55 * len(rows)):
        return None
    which = [c for c in range(len(how.order)) if c not in quick.columns.gain_columns]
    flipped = how.times(which, -1.0)
    names = tuple(signal_of(quick.columns, c, currents) for c in which)
    check = turned_sign(
        names,
        f"all torques have the other sign: friction or inertia of joints "
        f"{listed(quick.columns.channels[c][5:] for c in against)} come out negative",
        maps,
    )
    return Hypothesis(np.inf, flipped, check)


def one_sign(quick: Quick, fit: Fit, how: Assignment, maps: dict, currents: bool) -> Iterator[Hypothesis]:
    """One torque with the other sign."""
    seen = None
    for c in np.flatnonzero(quick.identify.rows > 10).tolist():
        flipped = how.times([c], -1.0)
        other = quick.fit(flipped)
        gain, holds = other.gain_over(fit), other.holds_over(fit)
        if gain < -0.05:
            continue
        seen = seen or evidence(quick, fit, how)
        after = evidence(quick, other, flipped)
        contradicts = gain > CLEARLY and holds > 0.5 * CLEARLY and not after.against(c)
        alone = seen.against(c) and after.speaks_for(c)
        if not contradicts and not alone:
            continue
        name, joint = signal_of(quick.columns, c, currents), quick.columns.channels[c][5:]
        why = (
            f"friction or inertia of joint {joint} comes out negative"
            if seen.against(c)
            else f"turned, the error of joint {joint}'s torque falls from "
            f"{100 * fit.error[c]:.0f} to {100 * other.error[c]:.0f} %"
        )
        yield Hypothesis(
            gain + (1.0 if alone else 0.0),
            flipped,
            turned_sign((name,), f"{name} has the other sign: {why}", maps),
        )


def several_signs(
    quick: Quick, fit: Fit, how: Assignment, maps: dict, currents: bool
) -> Iterator[Hypothesis]:
    """Two torques or more with the other sign: turning one alone may only move the contradiction.

    A pattern of signs fits as well as its opposite; which of the two is meant inertia and friction say, and
    without them the fewer torques."""
    seen = np.flatnonzero(quick.identify.rows > 10).tolist()
    if not 3 <= len(seen) <= MOST_SIGNS:
        return
    patterns = [
        [c for c, turned in zip(seen[1:], bits) if turned] for bits in product((0, 1), repeat=len(seen) - 1)
    ]
    fits = [quick.fit(how.times(which, -1.0)) for which in patterns]
    gains = np.array([other.gain_over(fit) for other in fits])
    best = int(np.argmax(gains))
    other, which = fits[best], patterns[best]
    opposite = [c for c in seen if c not in which]
    if min(len(which), len(opposite)) < 2 or other.holds_over(fit) < CLEARLY:
        return
    others = [k for k, its in enumerate(patterns) if len(set(its) ^ set(which)) in (1, len(seen) - 1)]
    if gains[best] < 2 * CLEARLY or gains[best] - gains[others].max() < 0.5 * CLEARLY:
        return
    told = evidence(quick, other, how.times(which, -1.0))
    speaking = sum(told.speaks_for(c) for c in seen) - sum(told.against(c) for c in seen)
    if speaking < 0 or (speaking == 0 and len(opposite) < len(which)):
        which = opposite
    names = tuple(signal_of(quick.columns, c, currents) for c in which)
    beside = listed(signal_of(quick.columns, c, currents) for c in seen if c not in which)
    message = f"{listed(names)} have the other sign than {beside}: turned, {_falls(fit, other)}"
    check = turned_sign(names, message, maps)
    yield Hypothesis(float(gains[best]), how.times(which, -1.0), check)


def swapped(
    quick: Quick, fit: Fit, how: Assignment, maps: dict, currents: bool, gains: np.ndarray
) -> Iterator[Hypothesis]:
    """Two torques of one side in each other's place, each with its sign or the other one; gains (C,) [N m] of
    what is recorded."""
    columns = quick.columns
    for a, b in combinations(np.flatnonzero(quick.identify.rows > 10).tolist(), 2):
        if columns.need.channels[a].side != columns.need.channels[b].side:
            continue
        best, gain, signs, other = how, -np.inf, (1, 1), fit
        source = list(range(len(how.order)))
        source[a], source[b] = b, a
        for pair in ((1, 1), (1, -1), (-1, 1), (-1, -1)):  # other signs have to gain by themselves
            turned = how.placed(source, gains).times([a], pair[0]).times([b], pair[1])
            tried = quick.fit(turned)
            if tried.gain_over(fit) > gain + (0.0 if pair == (1, 1) else CLEARLY):
                best, gain, signs, other = turned, tried.gain_over(fit), pair, tried
        least = SWAPPED if signs == (1, 1) else 2 * SWAPPED  # another place and another sign
        if gain > least and other.holds_over(fit) > 0.5 * least:
            names = (signal_of(quick.columns, a, currents), signal_of(quick.columns, b, currents))
            which = f"{columns.channels[a][5:]} and {columns.channels[b][5:]}"
            yield Hypothesis(gain, best, _swap_check(names, maps, which, "torques", fit, other, signs))


def swapped_positions(quick: Quick, fit: Fit, how: Assignment, maps: dict) -> Iterator[Hypothesis]:
    """Two positions in each other's place, or one with the other sign."""
    columns, n = quick.columns, len(quick.columns.need.joints)
    labels = [str(j) for j in columns.need.joints]
    for a, b in [*combinations(range(n), 2), *((a, a) for a in range(n))]:
        order, sign = np.arange(n), np.ones(n)
        order[[a, b]] = b, a
        sign[a] = -1.0 if a == b else 1.0
        samples = [s.moved(columns, *(x[:, order] * sign for x in s.motion)) for s in quick.samples]
        turned = quick.of(samples)
        other = turned.fit(how)
        if not (other.gain_over(fit) > SWAPPED and other.holds_over(fit) > 0.5 * SWAPPED):
            continue
        if a != b:
            names = (f"q{labels[a]}", f"q{labels[b]}")
            check = _swap_check(names, maps, f"{labels[a]} and {labels[b]}", "positions", fit, other)
        else:
            check = Check(
                "position_sign",
                (f"q{labels[a]}",),
                f"the position of joint {labels[a]} looks recorded with the other sign, or its axis in "
                "the robot "
                f"file points the other way: turned, {_falls(fit, other)}",
                column_line(maps, {f"q{labels[a]}": {"sign": -1}}),
            )
        yield Hypothesis(other.gain_over(fit), how, check, turned)


def scaled_positions(quick: Quick, fit: Fit, how: Assignment, maps: dict) -> Iterator[Hypothesis]:
    """One position times a number: another unit, a gear counted twice or not at all."""
    columns = quick.columns
    for j, label in enumerate(columns.need.joints):
        for factor in POSITION_FACTORS:
            times = np.where(np.arange(len(columns.need.joints)) == j, factor, 1.0)
            samples = [
                s.moved(columns, s.q * times, s.dq * times, s.ddq * times, s.sign) for s in quick.samples
            ]
            moved = quick.of(samples)
            other = moved.fit(how)
            if not (other.gain_over(fit) > SWAPPED and other.holds_over(fit) > 0.5 * SWAPPED):
                continue
            check = Check(
                "angle_unit",
                (f"q{label}",),
                f"q{label} looks {1 / factor:.3g} times too large: another unit, or a gear that is counted "
                f"twice or not at all; so taken, {_falls(fit, other)}",
                column_line(maps, {f"q{label}": {"scale": factor}}),
            )
            yield Hypothesis(other.gain_over(fit), how, check, moved)


def other_orders(
    quick: Quick, fit: Fit, how: Assignment, maps: dict, currents: bool, gains: np.ndarray
) -> Iterator[Hypothesis]:
    """Joints in another order, positions and torques alike: two exchanged, all reversed, all moved by one."""
    columns, n = quick.columns, len(quick.columns.need.joints)
    labels = [str(j) for j in columns.need.joints]
    same = list(range(n))
    orders = [same[1:] + same[:1], same[-1:] + same[:-1], same[::-1]] if n > 2 else []
    for a, b in combinations(same, 2):
        orders.append([b if k == a else a if k == b else k for k in same])
    place = {(int(j), c.side): k for k, (j, c) in enumerate(zip(columns.joint_of, columns.need.channels))}
    for order in orders:
        source = [
            place.get((order[int(j)], c.side), -1) for j, c in zip(columns.joint_of, columns.need.channels)
        ]
        if -1 in source:
            continue
        turned = quick.of([s.moved(columns, *(x[:, order] for x in s.motion)) for s in quick.samples])
        taken = how.placed(source, gains)
        other = turned.fit(taken)
        if not (other.gain_over(fit) > SWAPPED and other.holds_over(fit) > 0.5 * SWAPPED):
            continue
        wrong = [k for k in same if order[k] != k]
        changes = {f"q{labels[k]}": {"of": f"q{labels[order[k]]}"} for k in wrong}
        changes |= {
            signal_of(quick.columns, c, currents): {"of": signal_of(quick.columns, k, currents)}
            for c, k in enumerate(source)
            if c != k
        }
        which = ", ".join(labels[k] for k in order)
        check = Check(
            "swapped_signals",
            tuple(changes),
            f"the joints look recorded in another order: positions and torques of {which} where "
            f"{', '.join(labels)} are meant; so taken, {_falls(fit, other)}",
            column_line(maps, changes),
        )
        yield Hypothesis(other.gain_over(fit), taken, check, turned)


def _swap_check(
    names: tuple[str, str],
    maps: dict,
    which: str,
    what: str,
    fit: Fit,
    other: Fit,
    signs: tuple[int, int] = (1, 1),
) -> Check:
    turned = [name for name, sign in zip(names, signs) if sign < 0]
    also = f", {' and '.join(turned)} with the other sign" if turned else ""
    message = f"the {what} of joints {which} look swapped{also}; exchanged, {_falls(fit, other)}"
    changes = {a: {"of": b, "sign": sign} for a, b, sign in zip(names, names[::-1], signs)}
    return Check("swapped_signals", names, message, column_line(maps, changes))


def _falls(before: Fit, after: Fit) -> str:
    a, b = (100 * float(np.sqrt(np.nanmean(x.error**2))) for x in (before, after))
    return f"the error falls from {a:.0f} to {b:.0f} %"


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
        whole = whole or _all_rows(quick)
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


def _all_rows(quick: Quick) -> Quick:
    """What is fitted and what judges, as one."""
    return quick.of([replace(s, role="identify") for s in quick.samples if s.role != "test"])


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
    all_rows = _all_rows(quick)
    before = all_rows.fit(how)
    as_it_is = Explained(all_rows, before, how)
    for c in np.flatnonzero(quick.identify.rows > 10).tolist():
        name = signal_of(quick.columns, c, currents)
        if name not in names or abs(how.factor[c]) != 1.0:
            continue
        trials = [how.times([c], float(MILLI / f)) for f in TIMES]
        tried = [Explained(all_rows, all_rows.fit(trial), trial) for trial in trials]
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
            f"times too large, as in N mm: scaled, {_falls(before, tried[milli].fit)}",
            column_line(maps, {name: {"scale": MILLI}}),
            spread=(high - low) * MILLI / (2 * NORMAL),
        )
        yield Hypothesis(np.inf, tried[milli].how, check)


def agreed(one: Explained, other: Explained, rate: float) -> bool:
    """Whether stretches of the recordings are explained better by the other fit, but for chance at this
    rate."""
    gains = stretch_gains(one, other)
    if len(gains) < 3 or not gains.mean() > 0:
        return False
    t = gains.mean() / (gains.std(ddof=1) / np.sqrt(len(gains)))
    return t_beyond(float(t), len(gains) - 1) < rate


def confirmed(quick: Quick, how: Assignment, other: Quick, its: Assignment, asked: int) -> bool:
    """Whether stretch by stretch what fits and what judges is explained better by one of so many hypotheses
    that were asked."""
    rows = (_all_rows(quick), _all_rows(other))
    before, after = (Explained(q, q.fit(h), h) for q, h in zip(rows, (how, its)))
    return agreed(before, after, ODD / asked)


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
        + f": scaled, {_falls(fit, other)}",
        lines[0] if milli else f"write {lines[0]} or {lines[1]}",
    )
    return Hypothesis(other.gain_over(fit), how, check)


def _unrelated(names: tuple[str, ...], message: str, remedy: str) -> Check:
    return Check("unrelated_torque", names, message, remedy)


def _without(quick: Quick, which: Sequence[int]) -> str:
    """The `channels:` line that leaves channels out."""
    return f"channels: [{', '.join(n for c, n in enumerate(quick.columns.channels) if c not in which)}]"


def unexplained(quick: Quick, fit: Fit, currents: bool) -> Iterator[Check]:
    """Channels, or all of them, of which the model explains nothing; validate runs that nothing predicts."""
    seen = np.flatnonzero(np.isfinite(fit.error))
    if not len(seen):
        return
    error = fit.error[seen]
    empty = [int(c) for c in seen if fit.error[c] > NOTHING]
    everything = tuple(signal_of(quick.columns, c, currents) for c in range(len(quick.columns.channels)))
    nothing = np.median(error) > 0.6 and error.min() > UNLIKE and len(seen) > 1
    if nothing or (len(seen) == 1 and error[0] > NOTHING):
        yield Check(
            "wrong_robot",
            everything,
            f"the model explains little of these torques (errors of {100 * error.min():.0f} to "
            f"{100 * error.max():.0f} % of each): another robot's or another run's signals, or a wrong "
            "robot file",
            "check the robot, and that positions and torques belong to one run",
        )
        return
    if empty and len(seen) > 1:
        names = tuple(signal_of(quick.columns, c, currents) for c in empty)
        yield _unrelated(
            names,
            f"the model explains nothing of {listed(names)}: noise, another signal, a sign that "
            "changes on the way, or a joint that carries next to no torque",
            f"check the columns, or leave them out with {_without(quick, empty)}",
        )
    usual = float(np.median(error))
    some = [
        int(c)
        for c in seen
        if c not in empty
        and fit.error[c] > max(PARTLY, PARTLY_TIMES * usual)
        and (fit.validate is None or not fit.validate[c] < PARTLY)
    ]
    if some and len(seen) > 2:
        names = tuple(signal_of(quick.columns, c, currents) for c in some)
        yield _unrelated(
            names,
            f"the model explains only a part of {listed(names)} (errors of "
            f"{listed(f'{100 * fit.error[c]:.0f} %' for c in some)}, the other torques about "
            f"{100 * usual:.0f} %): noise, another signal for a while, a magnitude without its sign, or "
            "something large that the model lacks",
            f"look at its plot, or leave it out with {_without(quick, some)}",
        )
    if fit.validate is not None and np.isfinite(fit.validate).any():
        held = fit.validate[np.isfinite(fit.validate)]
        if np.median(held) > max(1.0, 3 * float(np.median(error))):
            yield Check(
                "wrong_robot",
                everything,
                f"what identify explains ({100 * np.median(error):.0f} % error) does not predict "
                "validate at all "
                f"({100 * np.median(held):.0f} %): another robot, load or unit there, or motions that "
                "have nothing in "
                "common",
                "check that these recordings are of the same robot in the same state",
                recording=", ".join(s.label for s in quick.samples if s.role == "validate"),
            )
