"""Signals in each other's place: torques, positions, or whole joints in another order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from ident.equations.columns import Columns
from ident.examination.check import Check, listed
from ident.examination.fits.hypothesis import CLEARLY, SWAPPED, Asked, Hypothesis, falls
from ident.examination.fits.quick import FLOOR, Assignment, Fit, alone
from ident.examination.fits.stretches import RARE, Explained, all_rows, steadily
from ident.examination.torques.signs import MOST_SIGNS, sign_patterns
from ident.examination.torques.smooth_torques import SmoothTorques


def swapped(asked: Asked) -> Iterator[Hypothesis]:
    """Two torques of one side in each other's place, each with its sign or the other one."""
    columns = asked.quick.columns
    for a, b in combinations(asked.seen, 2):
        if columns.need.channels[a].side != columns.need.channels[b].side:
            continue
        source = list(range(len(asked.how.order)))
        source[a], source[b] = b, a
        placed = asked.how.placed(source, asked.gains)
        best, gain, other = placed, -np.inf, asked.fit
        for pair in ([], [b], [a], [a, b]):  # other signs have to gain by themselves
            turned = placed.times(pair, -1.0)
            tried = asked.quick.fit(turned)
            if tried.gain_over(asked.fit) > gain + (CLEARLY if pair else 0.0):
                best, gain, other = turned, tried.gain_over(asked.fit), tried
        if asked.better(other, SWAPPED if best == placed else 2 * SWAPPED):  # another place, another sign
            best = best if best == placed else _fewest_turned(asked, placed, best)
            other = asked.quick.fit(best)
            names = (asked.name(a), asked.name(b))
            which = f"{columns.channels[a][5:]} and {columns.channels[b][5:]}"
            signs = [int(np.sign(x / y)) for x, y in zip(best.factor, placed.factor)]
            check = _swap_check(asked, names, which, "torques", other, dict(zip(_all_names(asked), signs)))
            its = Hypothesis(gain, best, check, words=f"{names[0]} and {names[1]} look swapped")
            yield from SmoothTorques(asked, [int(columns.joint_of[k]) for k in (a, b)]).less_than(its)


def _all_names(asked: Asked) -> tuple[str, ...]:
    return asked.names(range(len(asked.how.order)))


def _fewest_turned(asked: Asked, placed: Assignment, turned: Assignment) -> Assignment:
    """Of all signs those with which about as much is explained as with any and the fewest torques are turned.
    (Of a rokae with its second and third torque exchanged and the fourth one turned, the two were told to be
    turned.)"""
    if len(asked.seen) > MOST_SIGNS:
        return turned
    patterns = sign_patterns(asked.seen)
    ways = [placed.times(which, -1.0) for which in patterns]
    gains = np.array([fit.gain_over(asked.fit) for fit in asked.quick.fits(ways)])
    near = np.flatnonzero(gains > gains.max() - 0.5 * CLEARLY).tolist()
    return ways[min(near, key=lambda k: (len(patterns[k]), -gains[k]))]


def swapped_positions(asked: Asked) -> Iterator[Hypothesis]:
    """Two positions in each other's place, or all of them counted from the tip, or from one on from the next
    joint. (Of an LWR4+ with its positions moved by one, as where they are counted from 0, two pairs were
    told; of an AIRBOT with those from the third on two positions, and two torques.)"""
    same, labels = list(range(len(asked.joints))), asked.joints
    for order in regular_orders(same):
        moves = [(labels[j], labels[k]) for j, k in zip(same, order) if j != k]
        names, theirs = ([f"q{label}" for label in its] for its in zip(*moves))
        said = f"the positions look recorded in another order, {', '.join(theirs)} where {', '.join(names)}"
        line = asked.line({name: {"of": its} for name, its in zip(names, theirs)})

        def moved(other: Fit, said: str = said, names: Sequence[str] = names, line: str = line) -> Check:
            message = f"{said} are meant; so taken, {falls(asked.fit, other)}"
            return Check("swapped_signals", tuple(names), message, line)

        yield from asked.along(asked.quick.moved(order), moved, f"{said} are meant")
    for a, b in combinations(range(len(asked.joints)), 2):
        j, k = asked.joints[a], asked.joints[b]

        def told(other: Fit, j: str = j, k: str = k) -> Check:
            return _swap_check(asked, (f"q{j}", f"q{k}"), f"{j} and {k}", "positions", other)

        order = exchanged(len(asked.joints), a, b)
        for its in asked.along(asked.quick.moved(order), told, f"q{j} and q{k} look swapped"):
            yield from SmoothTorques(asked, [a, b]).less_than(its)


def regular_orders(which: list[int]) -> list[list[int]]:
    """Moved by one either way from one on, as under a header that lacks a name, and all reversed; of three at
    least."""
    moved = [
        [*which[:k], *turned]
        for k in range(len(which) - 2)
        for turned in (which[k + 1 :] + which[k : k + 1], which[-1:] + which[k:-1])
    ]
    return [*moved, which[::-1]] if moved else []


def exchanged(n: int, a: int, b: int) -> list[int]:
    """0 .. n - 1 with two in each other's place."""
    return [b if k == a else a if k == b else k for k in range(n)]


def along(columns: Columns, order: Sequence[int]) -> list[int] | None:
    """For every channel that of the same side of joint order[j] in the place of its own joint j; None where
    one is missing."""
    own = list(zip(columns.joint_of, columns.need.channels))
    place = {(int(j), c.side): k for k, (j, c) in enumerate(own)}
    source = [place.get((order[int(j)], c.side), -1) for j, c in own]
    return None if -1 in source else source


def other_torques(asked: Asked) -> Iterator[Hypothesis]:
    """All torques of a side in other places: those in which each channel by itself explains most of what
    stands there, or all counted from the tip or from the next joint where that explains as much. (Of an LWR4+
    with its torques from tip to base the sixth was told as turned.)"""
    columns = asked.quick.columns
    for side in dict.fromkeys(c.side for c in columns.need.channels):
        mine = [c for c in asked.seen if columns.need.channels[c].side == side]
        if len(mine) < 3:
            continue
        regular = [_placed(asked, mine, order) for order in regular_orders(mine)]
        found = [order for order in (*regular, _assigned(asked, mine)) if _gains(asked, order)]
        if not found:
            continue
        taken = [_taken(asked, order) for order in found]
        best = max(taken, key=lambda its: its.fit.gain_over(taken[0].fit))
        order = next(o for o, its in zip(found, taken) if its is best or not steadily(its, best, RARE))
        if order not in regular:
            order = _fewest_moved(asked, order)
            if not _gains(asked, order):
                continue
        pairs = combinations(mine, 2) if order not in regular else ()
        near = ([order[k] for k in exchanged(len(order), a, b)] for a, b in pairs)
        known = all(steadily(_taken(asked, other), best, RARE) for other in near)
        yield _torque_order(asked, order, known)


def _gains(asked: Asked, order: Sequence[int]) -> bool:
    """Whether torques in such places are explained so much better; two alone are `swapped`."""
    other = asked.quick.fit(asked.how.placed(order, asked.gains))
    return _moved(order) > 2 and asked.better(other, SWAPPED)


def _assigned(asked: Asked, mine: Sequence[int]) -> list[int]:
    """For every channel the one whose torque stands in it, by the least errors of channels fitted alone."""
    sums, columns = asked.quick.identify, [asked.how.order[c] for c in mine]
    each = [alone(sums.G[c], sums.v[c][columns].T, sums.yy[c][columns]) for c in mine]
    costs = np.log(np.maximum(each, FLOOR))
    places = costs.argmin(axis=1)
    if len(np.unique(places)) < len(mine):  # two want one place
        from scipy.optimize import linear_sum_assignment  # its import takes a quarter of a fit

        places = linear_sum_assignment(costs)[1]
    return _placed(asked, mine, [mine[k] for k in places])


def _fewest_moved(asked: Asked, order: list[int]) -> list[int]:
    """Of orders that stretch by stretch are not rejected beside it, or by less than any exchange has to gain,
    one that moves few torques: small ones may have each other's place. (Of an LWR4+ with its first and fifth
    torque exchanged the sixth and seventh were told, too, with its first and sixth the seventh.)"""
    best, channels = _taken(asked, order), range(len(order))
    while True:
        pairs = [exchanged(len(order), a, b) for a, b in combinations(channels, 2)]
        others = [
            other for other in ([order[k] for k in pair] for pair in pairs) if _moved(other) < _moved(order)
        ]
        each = [(_taken(asked, other), other) for other in others]
        gains = [(its.fit.gain_over(best.fit), its, other) for its, other in each]
        kept = [(g, other) for g, its, other in gains if g > -SWAPPED or not steadily(its, best, RARE)]
        if not kept:
            return order
        order = max(kept)[1]


def _moved(order: Sequence[int]) -> int:
    return sum(c != k for c, k in enumerate(order))


def _placed(asked: Asked, mine: Sequence[int], order: Sequence[int]) -> list[int]:
    source = list(range(len(asked.how.order)))
    for c, k in zip(mine, order):
        source[c] = k
    return source


def _taken(asked: Asked, source: Sequence[int]) -> Explained:
    return Explained.by(all_rows(asked.quick), asked.how.placed(source, asked.gains))


def _torque_order(asked: Asked, source: Sequence[int], known: bool) -> Hypothesis:
    """known: whether these recordings tell this order from those that are nearest to it."""
    taken = asked.how.placed(source, asked.gains)
    other = asked.quick.fit(taken)
    moved = [c for c, k in enumerate(source) if c != k]
    names, theirs = asked.names(moved), asked.names(source[c] for c in moved)
    order = f"{', '.join(theirs)} where {', '.join(names)} are meant"
    said = f"the torques look recorded in another order, {order}"
    also = "" if known else " or an order near it, these recordings do not tell which"
    line = asked.line({name: {"of": its} for name, its in zip(names, theirs)})
    remedy = line if known else f"check the order of the torques' columns, maybe {line}"
    message = f"{said}{also}; so taken, {falls(asked.fit, other)}"
    check = Check("swapped_signals", names, message, remedy)
    return Hypothesis(other.gain_over(asked.fit), taken, check, words=said)


def other_orders(asked: Asked) -> Iterator[Hypothesis]:
    """Joints in another order, positions and torques alike: two exchanged, all reversed, all moved by one."""
    columns, n, labels = asked.quick.columns, len(asked.joints), asked.joints
    same = list(range(n))
    orders = regular_orders(same) + [exchanged(n, a, b) for a, b in combinations(same, 2)]
    for order in orders:
        source = along(columns, order)
        if source is None:
            continue
        changes = {f"q{labels[k]}": {"of": f"q{labels[order[k]]}"} for k in same if order[k] != k}
        changes |= {asked.name(c): {"of": asked.name(k)} for c, k in enumerate(source) if c != k}
        which = ", ".join(labels[k] for k in order)

        def told(other: Fit, changes: dict = changes, which: str = which) -> Check:
            return Check(
                "swapped_signals",
                tuple(changes),
                f"the joints look recorded in another order: positions and torques of {which} where "
                f"{', '.join(labels)} are meant; so taken, {falls(asked.fit, other)}",
                asked.line(changes),
            )

        words, taken = f"the joints are recorded in the order {which}", asked.how.placed(source, asked.gains)
        for its in asked.along(asked.quick.moved(order), told, words, taken):
            yield from SmoothTorques(asked, [j for j in same if order[j] != j]).less_than(its)


def _swap_check(
    asked: Asked,
    names: tuple[str, str],
    which: str,
    what: str,
    other: Fit,
    signs: Mapping[str, int] | None = None,
) -> Check:
    """signs: of every signal that has one to be told."""
    turned = [name for name, sign in (signs or {}).items() if sign < 0]
    also = f", {listed(turned)} with the other sign" if turned else ""
    message = f"the {what} of joints {which} look swapped{also}; exchanged, {falls(asked.fit, other)}"
    changes: dict[str, dict[str, Any]] = {a: {"of": b} for a, b in zip(names, names[::-1])}
    for name in turned:
        changes.setdefault(name, {})["sign"] = -1
    return Check("swapped_signals", tuple(changes), message, asked.line(changes))
