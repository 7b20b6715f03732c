"""A length of the robot file that is another one, told where one fit of all rows contradicts itself without.

Bodies make up for much of it, so that it leaves little of the torques that are fitted and spoils what is
foretold. What torques change by with each length is a column beside the model's, along which the one that
explains most is followed by Gauss-Newton steps. (Of a Franka whose second link had 0.3 m too much 17 % were
foretold for 3, and nothing was said. Of eleven arms as they are none gains half of what is asked for.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ident.equations.prepared import Prepared
from ident.examination.check import Check
from ident.examination.fits.bodies import torques, with_bodies
from ident.examination.fits.hypothesis import Asked, Hypothesis, falls, of_several
from ident.examination.fits.quick import Assignment, Quick
from ident.examination.fits.stretches import (
    HALF,
    RARE,
    Explained,
    agreed,
    all_rows,
    half_of,
    steadily,
)
from ident.examination.rivals.recordings_apart import thinned
from ident.examination.rivals.rivals import alike, standing
from ident.examination.rivals.scales import USUAL
from ident.examination.robot.geometry import table_and_samples, with_gravity

SMALL, SEEN = 1e-4, 1e-9  # m of differences; share of a column that the model does not make up for
STEPS, MOST, ENOUGH = 8, 0.3, 1e-3  # of Gauss-Newton: how many, m of the largest, gain of the last


@dataclass(frozen=True, slots=True)
class Length:
    """A table whose row j has x m more in d or r, and what it explains."""

    table: Any
    j: int
    key: str
    x: float
    explained: Explained

    @property
    def words(self) -> str:
        word = "small" if self.x > 0 else "large"
        return f"the robot file's link {self.j + 1}: {self.key} is about {abs(self.x):.2g} m too {word}"


def lengths(prepared: Prepared, asked: Asked) -> Iterator[Hypothesis]:
    """The one that explains most, beside those that do as much: of links with parallel axes one stands for
    another."""
    made = None if prepared.study.effects else table_and_samples(prepared, asked)
    if made is None:
        return
    table, samples, gravity = made
    whole, how = all_rows(asked.quick.of(samples)), asked.how
    few = whole.of([thinned(s) for s in whole.samples])
    table = with_gravity(table, gravity)
    asks = _worth_asking(table, few.of([s.rows(slice(None, None, 2)) for s in few.samples]), how)
    if not asks:
        return
    plain = Explained.by(with_bodies(table, few), how)
    each = [_followed(Length(table, j, key, 0.0, plain), few, how) for j, key in asks]
    best = max(each, key=lambda its: its.explained.fit.gain_over(plain.fit))
    told, columns, count = best.explained, asked.quick.columns, len(_entries(table))
    of_all = of_several(columns, plain.fit, told.fit, [-1])  # no joint's own torque speaks for a link alone
    if not (told.fit.gain_over(plain.fit) > USUAL and of_all):
        return
    if not (steadily(plain, told, RARE / count) and agreed(plain, told, RARE)):
        return
    pool = standing(asked, few, how, told)
    if pool is None:
        return
    check = Check(
        "joint_axis",
        (),
        f"{best.words}: so taken, {falls(plain.fit, told.fit)} over all recordings",
        "measure it, and correct it in the robot file",
        robot_file=True,
    )
    its = Hypothesis(told.fit.gain_over(plain.fit), how, check, words=best.words)
    near = [o for o in each if o is not best and half_of(plain, told, o.explained)]
    words = [o.words for o in near if not steadily(o.explained, told, RARE)]
    words += [r.words for r in alike(pool, plain, told)]
    yield its.beside([replace(its, check=replace(check, remedy=""), words=w) for w in words])


def _entries(table: Any) -> list[tuple[int, str]]:
    """Rows and keys of the lengths, but of what stands on the base and of a sliding joint's way."""
    return [
        (j, key)
        for j, row in enumerate(table.rows)
        for key in ("d", "r")
        if row.antecedent != -1 and not (key == "r" and row.sigma == 1)
    ]


def _worth_asking(table: Any, quick: Quick, how: Assignment) -> list[tuple[int, str]]:
    """Lengths by which to first order at least half of what the best one explains is explained, and that
    enough."""
    plain = Explained.by(with_bodies(table, quick), how)
    found = {its: _step(table, *its, plain)[1] for its in _entries(table)}
    most = max(found.values(), default=0.0)
    return [its for its, share in found.items() if share > max(HALF * most, 1 - np.exp(-USUAL))]


def _followed(start: Length, quick: Quick, how: Assignment) -> Length:
    best = start
    for _ in range(STEPS):
        step, _ = _step(best.table, best.j, best.key, best.explained)
        step = float(np.clip(step, -MOST, MOST))
        table = _longer(best.table, best.j, best.key, step)
        after = Explained.by(with_bodies(table, quick), how)
        gained = after.fit.gain_over(best.explained.fit)
        if gained > 0:
            best = replace(best, table=table, x=best.x + step, explained=after)
        if gained < ENOUGH:
            break
    return best


def _step(table: Any, j: int, key: str, at: Explained) -> tuple[float, float]:
    """m by which a length explains most to first order, and how much of the torques' weighted squares."""
    longer, joints = _longer(table, j, key, SMALL), at.quick.columns.joint_of
    chi, inverse, scale = at.fit.chi, at.fit.inverse, at.fit.scale
    bodies = chi[: 10 * len(table.rows)]
    zz = zr = rr = 0.0
    zW = np.zeros(len(chi))
    for s in at.quick.samples:
        weight, motion = scale * s.weight, (s.q, s.dq, s.ddq)
        z = (torques(longer, *motion, bodies) - torques(table, *motion, bodies))[joints].T / SMALL
        left = s.Y[:, list(at.how.order)] * at.how.factor - s.predicted(chi)
        zz, zr = zz + float((weight * z * z).sum()), zr + float((weight * z * left).sum())
        rr += float((weight * left * left).sum())
        zW += np.einsum("nc,cnb->b", weight * z, s.W)
    size = zz - float(zW @ inverse @ zW)
    if not size > SEEN * zz:
        return 0.0, 0.0
    return zr / size, zr * zr / size / max(rr, 1e-300)


def _longer(table: Any, j: int, key: str, x: float) -> Any:
    row = table.rows[j]
    other = replace(row, **{key: float(getattr(row, key)) + x})
    return replace(table, rows=(*table.rows[:j], other, *table.rows[j + 1 :]))
