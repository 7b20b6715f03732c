"""Whether the table of a robot that comes with the package explains recordings, and the robot file's not.

Bodies of any size fit in either table, so that what the wrong one leaves looks like a length or a clock that
is off. The right one makes one robot of all torques. (Of a UR10e with the table of a KR 300 it was told that
its lengths are 9.15 times too large, or t 3 times too small, for 11 to 10 % of the torques; 7 are left by its
own table.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import Any

from ident.equations.prepared import Prepared
from ident.examination.check import Check, listed
from ident.examination.fits.bodies import beyond_own, with_bodies
from ident.examination.fits.hypothesis import Asked, Hypothesis, falls
from ident.examination.fits.quick import gain_of
from ident.examination.fits.samples import Sample
from ident.examination.fits.stretches import RARE, Explained, all_rows, half_of, steadily
from ident.examination.rivals.recordings_apart import thinned
from ident.examination.rivals.rivals import alike, standing
from ident.examination.robot.geometry import table_and_samples, with_gravity

CLEARLY = 1.0  # gain, summed over the channels


def known_tables(prepared: Prepared, asked: Asked, found: Sequence[Hypothesis]) -> Iterator[Hypothesis]:
    """The table with which all recordings are explained best, where that is far better than the file's,
    stretch by stretch, and about as well as torques by themselves are; beside what was `found` and everyday
    faults that are not rejected there."""
    made = None if prepared.study.effects else table_and_samples(prepared, asked)
    if made is None:
        return
    table, samples, gravity = made
    table = with_gravity(table, gravity)
    whole, how = all_rows(asked.quick.of(samples)), asked.how
    few = whole.of([thinned(s) for s in whole.samples])
    plain = Explained.by(with_bodies(table, few), how)
    tables = [(name, with_gravity(other, gravity)) for name, other in _alike(table)]
    each = [(name, Explained.by(with_bodies(other, few), how)) for name, other in tables]
    name, told = max(each, key=lambda its: its[1].fit.gain_over(plain.fit), default=("", plain))
    if not told.fit.gain_over(plain.fit) > CLEARLY or beyond_own(told.fit.error, few.alone(how)).any():
        return
    if not steadily(plain, told, RARE / len(each)):
        return
    pool = standing(asked, few, how, told)
    if pool is None:
        return
    near = [other for other, its in each if half_of(plain, told, its) and not steadily(its, told, RARE)]
    names = [name, *(other for other in near if other != name)]
    words = f"the table of {' or '.join(names)} explains these recordings, not the robot file's, which is "
    words += f"another in {_unlike(table, dict(tables)[name])}"
    check = Check(
        "wrong_robot",
        (),
        f"{words}: so taken, {falls(plain.fit, told.fit)} over all recordings",
        f"write robot: {' or '.join(names)} in the study if it is one, or correct the robot file",
        robot_file=True,
    )
    own = gain_of(*(way.quick.alone(how) for way in (plain, told)))
    its = Hypothesis(told.fit.gain_over(plain.fit), how, check, words=words, each=own)
    others = [h for h in found if h.words and _near(h, asked, table, samples, plain, told)]
    others += [replace(its, words=r.words) for r in alike(pool, plain, told)]
    yield its.beside([replace(h, check=replace(h.check, remedy="")) for h in others])


def _near(
    h: Hypothesis, asked: Asked, table: Any, samples: Sequence[Sample], plain: Explained, told: Explained
) -> bool:
    """Whether torques or motion taken otherwise, in the table as it is, are not rejected beside another."""
    kept = {s.label for s in samples}
    moved = [s for s in (h.quick or asked.quick).samples if s.label in kept]
    few = all_rows(asked.quick.of([thinned(s) for s in moved]))
    other = Explained.by(with_bodies(table, few), h.how)
    return half_of(plain, told, other) and not steadily(other, told, RARE)


def _alike(table: Any) -> Iterator[tuple[str, Any]]:
    """Tables of the robots that come with the package whose joints turn and slide as this one's."""
    from modelgen.geometry.kinematics import geometry
    from modelgen.geometry.robot_file import built_in_names, load_robot

    def joints(its: Any) -> list[int]:
        return [row.sigma for row in its.rows if row.sigma != 2]

    for name in built_in_names():
        other = geometry(load_robot(name)).mapped(float)
        if joints(other) == joints(table):
            yield name, other


def _unlike(table: Any, other: Any) -> str:
    """Links of the table that are another one's in the other."""
    pairs = list(zip_longest(table.rows, other.rows))
    links = [str(j + 1) for j, (one, its) in enumerate(pairs) if one != its]
    return f"link{'s' if len(links) > 1 else ''} {listed(links)}" if len(links) < len(pairs) else "every link"
