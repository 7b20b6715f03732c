"""Whether an axis of the robot file's table is turned."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from ident.equations.columns import Columns
from ident.examination.bodies import Parts, beyond_own, by_own, errors, gain, parts_of
from ident.examination.carried import KEPT, span
from ident.examination.check import Check
from ident.examination.hypothesis import BAD, Hypothesis, explains
from ident.examination.quick import Assignment, Sample

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
    """One entry of the table wrong by a quarter or half turn, or one axis reversed."""
    fitted = [s for s in samples if s.role == "identify"]
    held_out = [s for s in samples if s.role == "validate"]

    def parts(other: Any) -> Parts:
        its = parts_of(other, columns, fitted, how, AXES_SAMPLES, False)
        assert its is not None
        return its

    def judged(other: Any, identify: Parts) -> np.ndarray | None:
        validate = parts_of(other, columns, held_out, how, AXES_SAMPLES // 2, False)
        return errors(identify, validate, gravity)[1]

    table = replace(table, gravity=tuple(float(g) for g in gravity))
    as_told = parts(table)
    plain, held = errors(as_told, None, gravity)[0], judged(table, as_told)
    found: list[tuple[float, str, np.ndarray, np.ndarray]] = []
    labels = iter(str(j) for j in columns.need.joints)
    for j, row in enumerate(table.rows):
        label = next(labels) if row.sigma != 2 else ""
        for key, turn in product(("alpha", "theta"), (1, -1, 2)):
            if key == "theta" and row.sigma == 0 and turn == 2 and j == 0:
                continue
            other = replace(table, rows=_turned(table.rows, j, key, turn))
            identify = parts(other)
            now = errors(identify, None, gravity)[0]
            if not gain(plain, now) > CLEARLY or not _by_several(plain, now):
                continue
            after = judged(other, identify)
            predicts = after is None or np.nanmax(after) < 1.0
            if predicts and gain(held, after) > 0.5 * CLEARLY:
                words = {1: "pi/2", -1: "-pi/2", 2: "pi"}[turn]
                text = f"link {j + 1}{f' (joint {label})' if label else ''}: {key} is off by {words}"
                found.append((gain(plain, now), text, now, by_own(identify, gravity)))
    if not found:
        return
    best = max(found, key=lambda item: item[0])
    if best[0] < prior or not explains(plain, best[2], BAD) or beyond_own(best[2], best[3]).any():
        return  # something else is missing
    equal = [text for value, text, _, _ in found if value > 0.97 * best[0] and text != best[1]]
    also = f" (or {'; '.join(equal[:3])}, which these data do not tell apart)" if equal else ""
    yield Hypothesis(
        best[0],
        how,
        Check(
            "joint_axis",
            (),
            f"the robot file seems wrong: {best[1]}{also}; so turned, the errors of the torques fall "
            f"from {span(plain)} "
            f"to {span(best[2])}",
            "correct the row in the robot file",
        ),
        each=gain(by_own(as_told, gravity), best[3]),
    )


def _by_several(before: np.ndarray, after: np.ndarray) -> bool:
    """Whether several torques speak for a turned axis and hardly any against it: bodies behind it are in the
    torque of every joint before it. (Of an LWR4+ link 6 was told by its last torque alone, which is hardly
    any; of its second row's own quarter turn, which six torques show, nothing because of that one.)"""
    gains = np.log(np.maximum(before, 1e-9) / np.maximum(after, 1e-9))
    gains = gains[np.isfinite(gains)]
    gained = gains[gains > 0].sum()
    return bool(-gains.min() < KEPT * max(gained, CLEARLY) and gains.sum() - gains.max() > 0.5 * CLEARLY)


def _turned(rows: tuple[Any, ...], j: int, key: str, quarters: int) -> tuple[Any, ...]:
    c, s = {1: (0, 1), -1: (0, -1), 2: (-1, 0)}[quarters]
    row = rows[j]
    a, b = getattr(row, f"c_{key}"), getattr(row, f"s_{key}")
    new = replace(row, **{f"c_{key}": a * c - b * s, f"s_{key}": b * c + a * s})
    return (*rows[:j], new, *rows[j + 1 :])
