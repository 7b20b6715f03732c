"""Signals in each other's place: torques, positions, or whole joints in another order."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from ident.examination.check import Check, column_line
from ident.examination.hypothesis import CLEARLY, Hypothesis, falls, signal_of
from ident.examination.quick import Assignment, Fit, Quick

SWAPPED = 1.4  # gain


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
            check = _swap_check(names, maps, which, "torques", fit, other, signs)
            words = f"{names[0]} and {names[1]} look swapped"
            yield Hypothesis(gain, best, check, words=words)


def swapped_positions(quick: Quick, fit: Fit, how: Assignment, maps: dict) -> Iterator[Hypothesis]:
    """Two positions in each other's place."""
    columns, n = quick.columns, len(quick.columns.need.joints)
    labels = [str(j) for j in columns.need.joints]
    for a, b in combinations(range(n), 2):
        order = np.arange(n)
        order[[a, b]] = b, a
        turned = quick.of([s.moved(columns, *(x[:, order] for x in s.motion)) for s in quick.samples])
        other = turned.fit(how)
        if other.gain_over(fit) > SWAPPED and other.holds_over(fit) > 0.5 * SWAPPED:
            names = (f"q{labels[a]}", f"q{labels[b]}")
            check = _swap_check(names, maps, f"{labels[a]} and {labels[b]}", "positions", fit, other)
            words = f"{names[0]} and {names[1]} look swapped"
            yield Hypothesis(other.gain_over(fit), how, check, turned, words)


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
            f"{', '.join(labels)} are meant; so taken, {falls(fit, other)}",
            column_line(maps, changes),
        )
        words = f"the joints are recorded in the order {which}"
        yield Hypothesis(other.gain_over(fit), taken, check, turned, words)


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
    message = f"the {what} of joints {which} look swapped{also}; exchanged, {falls(fit, other)}"
    changes = {a: {"of": b, "sign": sign} for a, b, sign in zip(names, names[::-1], signs)}
    return Check("swapped_signals", names, message, column_line(maps, changes))
