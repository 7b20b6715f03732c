"""Whether an axis of the robot file's table is turned, a joint of the other kind, or rows stand elsewhere.

Columns that stand a row too high are those of the other Denavit-Hartenberg convention, in which a row's alpha
and d are those of the next joint: one and the same table is read otherwise, and every axis behind the first
one is another. Two rows are exchanged, or their joints slide where they turn, by a slip of the hand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, product
from typing import Any

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.fits.bodies import (
    SAMPLES,
    Parts,
    beyond_own,
    by_own,
    errors,
    gain,
    parts_of,
    parts_of_each,
    with_bodies,
)
from ident.examination.fits.halves import of_either_half
from ident.examination.fits.hypothesis import BAD, Hypothesis
from ident.examination.fits.quick import Assignment, Quick
from ident.examination.fits.stretches import HALF, RARE, Explained, all_rows, half_of, same, steadily
from ident.examination.rivals.carried import KEPT, span
from ident.examination.rivals.recordings_apart import thinned

CLEARLY = 1.0  # gain, summed over the channels, on identify; half of it on validate
AXES_SAMPLES = 160


@dataclass(frozen=True)
class Table:
    """The table read otherwise, in words, with the gain, the errors of torques and their bodies' sums."""

    table: Any
    words: str
    moved: bool
    gain: float
    error: np.ndarray
    parts: Parts


@dataclass(frozen=True)
class OtherTables:
    """The robot file's table with gravity as told, these recordings, and what explains them far better: one
    entry of the table wrong by a quarter or half turn, or a length of the other sign, a joint of the other
    kind, two rows exchanged; or alpha, or it and d, of every row a row too high."""

    table: Any
    quick: Quick
    how: Assignment
    names: Sequence[str] = ()  # of the torques' signals
    aside: tuple[int, ...] = ()  # torques that are not asked, as the others contradict them whatever is read

    @property
    def gravity(self) -> np.ndarray:
        return np.array(self.table.gravity, float)

    @cached_property
    def _as_told(self) -> Parts:
        return self._parts(self.table)

    @cached_property
    def error(self) -> np.ndarray:
        """(C,) of the torques with the table as it is."""
        return errors(self._as_told, None, self.gravity)[0]

    @cached_property
    def found(self) -> list[Table]:
        plain, held = self.error, self._judged(self.table, self._as_told)
        found, moved = [], dict(_moved(self.table.rows))
        others = list(self._others())
        each = parts_of_each(
            [table for _, table in others], self.quick.columns, self.quick.fitted, self.how, AXES_SAMPLES
        )
        for (text, other), identify in zip(others, each):
            now = errors(identify, None, self.gravity)[0]
            if not gain(plain, now) > CLEARLY or not _by_several(plain, now):
                continue
            after = self._judged(other, identify)
            predicts = after is None or np.nanmax(after) < 1.0
            if predicts and gain(held, after) > 0.5 * CLEARLY:
                found.append(Table(other, text, text in moved, gain(plain, now), now, identify))
        return found

    @property
    def best(self) -> Table:
        return max(self.found, key=lambda its: its.gain)

    def _equal(self, best: Table) -> list[Table]:
        return [its for its in self.found if its.gain > 0.97 * best.gain and its is not best]

    def _others(self) -> Iterator[tuple[str, Any]]:
        rows, joints = self.table.rows, [str(j) for j in self.quick.columns.need.joints]
        for text, its in (*_one_turned(rows, joints), *_reversed(rows), *_exchanged(rows), *_moved(rows)):
            yield text, replace(self.table, rows=its)

    def told(self, prior: float = 0.0) -> Iterator[Hypothesis]:
        """The best of them. prior: what has to be gained; of a table of the other convention also less, as
        long as these recordings may not tell it from what gains that. (Of a UR10e and an LWR4+ with such a
        table the joints were told to be in another order, of an AIRBOT one position to be a sum of two.)"""
        if not self.found:
            return
        best, plain, gravity = self.best, self.error, self.gravity
        told, now, identify = best.words, best.error, best.parts
        if best.gain < (prior - 2 * CLEARLY if best.moved else prior) or not np.nanmin(now) <= BAD:
            return
        one, two = (with_bodies(its, self.quick) for its in (self.table, best.table))
        if not of_either_half(one, self.how, two, self.how):
            return
        if self.aside and best.gain < HALF * gain(plain, by_own(self._parts(self.table, SAMPLES), gravity)):
            return  # hardly a half of what one robot leaves of the others beyond bodies of their own
        more = self._parts(best.table, SAMPLES)  # of few samples a torque's own bodies explain too much
        odd = np.flatnonzero(beyond_own(errors(more, None, gravity)[0], by_own(more, gravity))).tolist()
        if odd:  # something else is missing: maybe in them alone
            rest = self.quick.of([s.without(odd) for s in self.quick.samples])
            others = replace(self, quick=rest, aside=tuple(odd))
            alike = [best.words, *(its.words for its in self._equal(best))]
            if not self.aside and others.found and others.best.words in alike:
                yield from (replace(its, gain=best.gain) for its in others.told())
            return
        equal = [its.words for its in self._equal(best)][:3]
        also = f" (or {'; '.join(equal)}, which these data do not tell apart)" if equal else ""
        on_base = self._on_base(best.table)
        if on_base:  # what it carries feels gravity from elsewhere, and nothing else
            also += ", or the base is mounted otherwise by as much"
        contradicted = listed(self.names[c] for c in self.aside)
        but = f" without {contradicted}, which the others contradict," if self.aside else ""
        yield Hypothesis(
            best.gain,
            self.how,
            Check(
                "joint_axis",
                (),
                f"the robot file seems wrong: {told}{also}; so taken, the errors of the torques{but} "
                f"fall from {span(plain)} to {span(now)}",
                "correct it in the robot file" + (", or write gravity: in the study" if on_base else ""),
                robot_file=True,
            ),
            words=f"the robot file's {told}" if best.moved else "",
            each=gain(by_own(self._as_told, gravity), by_own(identify, gravity)),
        )

    def instead_of(
        self, table: Any, how: Assignment, aside: Sequence[int] = (), other: Quick | None = None
    ) -> list[str]:
        """In words those that stretch by stretch are not rejected beside a base with another gravity, or
        torques or motions taken otherwise, by all torques but some; but rows on the base, which turn all that
        it carries. (Of six seconds of a KR 300 with a joint that slides by its file a base was told that is
        turned by 118 degrees, or a torque that is 54 times too small; of an LWR4+ with two rows exchanged a
        position two joints behind them to have the other sign.)"""

        def by(table: Any, how: Assignment, quick: Quick = self.quick) -> Explained:
            few = all_rows(quick.of([thinned(s.without(aside)) for s in quick.samples]))
            return Explained.by(with_bodies(table, few), how)

        before, told = by(self.table, self.how), by(table, how, other or self.quick)
        near: list[tuple[str, Explained]] = []
        others = [(text, its) for text, its in self._others() if not self._on_base(its)]
        for text, way in ((text, by(its, self.how)) for text, its in others):
            known = [told] if other is not None else []  # an axis that points the other way is told with it
            if any(same(way, its, 1e-3) for its in (*known, *(its for _, its in near))):
                continue
            if half_of(before, told, way) and not steadily(way, told, RARE):
                near.append((text, way))
        return [f"the robot file's {text}" for text, _ in near]

    def _on_base(self, other: Any) -> bool:
        """Whether no row but one that stands on the base is another one."""
        pairs = zip(self.table.rows, other.rows)
        return all(one == its or (one.antecedent == -1 and one.sigma == its.sigma) for one, its in pairs)

    def _parts(self, table: Any, most: int = AXES_SAMPLES) -> Parts:
        its = parts_of(table, self.quick.columns, self.quick.fitted, self.how, most, False)
        assert its is not None
        return its

    def _judged(self, table: Any, identify: Parts) -> np.ndarray | None:
        held = [s for s in self.quick.samples if s.role == "validate"]
        validate = parts_of(table, self.quick.columns, held, self.how, AXES_SAMPLES // 2, False)
        return errors(identify, validate, self.gravity)[1]


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


def _reversed(rows: tuple[Any, ...]) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Tables with one length of the other sign. (Of a TX40 whose second link lay the other way gravity was
    told to be upside down, or that link's alpha.)"""
    for j, row in enumerate(rows):
        for key in ("d", "r") if row.sigma != 1 else ("d",):
            length = getattr(row, key)
            if length:
                other = replace(row, **{key: -length})
                yield f"link {j + 1}: {key} has the other sign", (*rows[:j], other, *rows[j + 1 :])


def _exchanged(rows: tuple[Any, ...]) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Tables with neighbouring rows of one kind in each other's place, their antecedents and joints apart, or
    with the two lengths of a row. (Of a TX40 with such a row, behind which little turns, it was told that t
    is 2.46 times too large.)"""
    for j, row in enumerate(rows):
        if row.sigma != 1 and row.d != row.r:
            other = replace(row, d=row.r, r=row.d)
            yield f"link {j + 1}: d and r are exchanged", (*rows[:j], other, *rows[j + 1 :])
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
