"""Whether an axis of the robot file's table is turned, a joint of the other kind, or rows stand elsewhere.

Columns that stand a row too high are those of the other Denavit-Hartenberg convention, in which a row's alpha
and d are those of the next joint: one and the same table is read otherwise, and every axis behind the first
one is another. Two rows are exchanged, or their joints slide where they turn, by a slip of the hand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, product
from typing import Any

import numpy as np

from ident.equations.columns import Columns
from ident.examination.bodies import SAMPLES, Parts, beyond_own, by_own, errors, gain, parts_of
from ident.examination.carried import KEPT, span
from ident.examination.check import Check
from ident.examination.halves import halves_of
from ident.examination.hypothesis import BAD, Hypothesis
from ident.examination.quick import Assignment
from ident.examination.samples import Sample

CLEARLY = 1.0  # gain, summed over the channels, on identify; half of it on validate
AXES_SAMPLES = 160


def joint_axes(
    table: Any,
    columns: Columns,
    samples: Sequence[Sample],
    gravity: np.ndarray,
    how: Assignment,
    prior: float = 0.0,
) -> Iterator[Hypothesis]:
    """One entry of the table wrong by a quarter or half turn, or one axis reversed; or alpha, or it and d, of
    every row a row too high. prior: what has to be gained; of the second also less, as long as these
    recordings may not tell it from what gains that. (Of a UR10e and an LWR4+ with such a table the joints
    were told to be in another order, of an AIRBOT one position to be a sum of two.)"""
    fitted = [s for s in samples if s.role == "identify"]
    held_out = [s for s in samples if s.role == "validate"]

    def parts(other: Any, most: int = AXES_SAMPLES, samples: Sequence[Sample] = fitted) -> Parts:
        its = parts_of(other, columns, samples, how, most, False)
        assert its is not None
        return its

    def of_either_half(other: Any) -> bool:
        """As halves.of_either_half of recordings taken otherwise."""
        before, after = ([parts(t, AXES_SAMPLES, half) for half in halves] for t in (table, other))
        made = [[errors(x[k], x[1 - k], gravity) for x in (before, after)] for k in (0, 1)]
        return all(gain(one, two) > 0 for plain, taken in made for one, two in zip(plain, taken))

    def judged(other: Any, identify: Parts) -> np.ndarray | None:
        validate = parts_of(other, columns, held_out, how, AXES_SAMPLES // 2, False)
        return errors(identify, validate, gravity)[1]

    table, halves = replace(table, gravity=tuple(float(g) for g in gravity)), halves_of(samples)
    as_told = parts(table)
    plain, held = errors(as_told, None, gravity)[0], judged(table, as_told)
    found: list[tuple[float, str, np.ndarray, Parts, Any]] = []
    moved = dict(_moved(table.rows))
    one = _one_turned(table.rows, [str(j) for j in columns.need.joints])
    for text, rows in (*one, *_exchanged(table.rows), *moved.items()):
        other = replace(table, rows=rows)
        identify = parts(other)
        now = errors(identify, None, gravity)[0]
        if not gain(plain, now) > CLEARLY or not _by_several(plain, now):
            continue
        after = judged(other, identify)
        predicts = after is None or np.nanmax(after) < 1.0
        if predicts and gain(held, after) > 0.5 * CLEARLY:
            found.append((gain(plain, now), text, now, identify, other))
    if not found:
        return
    value, told, now, identify, other = max(found, key=lambda item: item[0])
    if value < (prior - 2 * CLEARLY if told in moved else prior) or not np.nanmin(now) <= BAD:
        return
    if not of_either_half(other):
        return
    more = parts(other, SAMPLES)  # of few samples a torque's own bodies explain too much
    if beyond_own(errors(more, None, gravity)[0], by_own(more, gravity)).any():
        return  # something else is missing
    equal = [its[1] for its in found if its[0] > 0.97 * value and its[1] != told]
    also = f" (or {'; '.join(equal[:3])}, which these data do not tell apart)" if equal else ""
    yield Hypothesis(
        value,
        how,
        Check(
            "joint_axis",
            (),
            f"the robot file seems wrong: {told}{also}; so taken, the errors of the torques fall "
            f"from {span(plain)} "
            f"to {span(now)}",
            "correct it in the robot file",
        ),
        words=f"the robot file's {told}" if told in moved else "",
        each=gain(by_own(as_told, gravity), by_own(identify, gravity)),
    )


def _by_several(before: np.ndarray, after: np.ndarray) -> bool:
    """Whether several torques speak for a turned axis and hardly any against it: bodies behind it are in the
    torque of every joint before it. (Of an LWR4+ link 6 was told by its last torque alone, which is hardly
    any; of its second row's own quarter turn, which six torques show, nothing because of that one.)"""
    gains = np.log(np.maximum(before, 1e-9) / np.maximum(after, 1e-9))
    gains = gains[np.isfinite(gains)]
    gained = gains[gains > 0].sum()
    return bool(-gains.min() < KEPT * max(gained, CLEARLY) and gains.sum() - gains.max() > 0.5 * CLEARLY)


def _one_turned(rows: tuple[Any, ...], joints: Sequence[str]) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Tables with one entry turned, in words."""
    labels = iter(joints)
    for j, row in enumerate(rows):
        label = next(labels) if row.sigma != 2 else ""
        for key, turn in product(("alpha", "theta"), (1, -1, 2)):
            if key == "theta" and row.sigma == 0 and turn == 2 and j == 0:
                continue
            words = {1: "pi/2", -1: "-pi/2", 2: "pi"}[turn]
            text = f"link {j + 1}{f' (joint {label})' if label else ''}: {key} is off by {words}"
            text += f", or q{label} by as much" if key == "theta" and row.sigma == 0 else ""
            yield text, _turned(rows, j, key, turn)
        if label:
            told, kind = ("turns", "slides") if row.sigma == 0 else ("slides", "turns")
            other = replace(row, sigma=1 - row.sigma)
            yield f"joint {label} {told} there, not {kind}", (*rows[:j], other, *rows[j + 1 :])


def _exchanged(rows: tuple[Any, ...]) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Tables with neighbouring rows of one kind in each other's place, their antecedents and joints apart."""
    for j, (a, b) in enumerate(pairwise(rows)):
        if a.sigma == b.sigma:
            keys = {"antecedent": a.antecedent}, {"antecedent": b.antecedent}
            other = (*rows[:j], replace(b, **keys[0]), replace(a, **keys[1]), *rows[j + 2 :])
            yield f"rows {j + 1} and {j + 2} are exchanged", other


def _moved(rows: tuple[Any, ...]) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Tables of a chain with columns a row lower."""
    if any(row.antecedent != j - 1 for j, row in enumerate(rows)):
        return
    for words, keys in (("alpha", ("c_alpha", "s_alpha")), ("alpha and d", ("c_alpha", "s_alpha", "d"))):
        each = zip(rows, rows[-1:] + rows[:-1])
        lower = tuple(replace(row, **{key: getattr(before, key) for key in keys}) for row, before in each)
        if lower != rows:
            yield f"{words} of every row belong{'s' if words == 'alpha' else ''} a row lower", lower


def _turned(rows: tuple[Any, ...], j: int, key: str, quarters: int) -> tuple[Any, ...]:
    c, s = {1: (0, 1), -1: (0, -1), 2: (-1, 0)}[quarters]
    row = rows[j]
    a, b = getattr(row, f"c_{key}"), getattr(row, f"s_{key}")
    new = replace(row, **{f"c_{key}": a * c - b * s, f"s_{key}": b * c + a * s})
    return (*rows[:j], new, *rows[j + 1 :])
