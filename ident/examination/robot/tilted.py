"""A base that stands a few degrees otherwise than the robot file says, told where all rows leave it no doubt.

Zeros of joints and factors of torques are fitted with it (`gravity.direction`), and any that is not taken may
be there, too: how well the direction is known then says whether it is another one than the file's.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ident.equations.prepared import Prepared
from ident.examination.check import Check
from ident.examination.fits.bodies import errors, gain, parts_of, with_bodies
from ident.examination.fits.first_axis import FirstAxis, told_by
from ident.examination.fits.hypothesis import Asked, Hypothesis
from ident.examination.fits.sphere import degrees_between, sought
from ident.examination.fits.stretches import RARE, Explained, all_rows, steadily
from ident.examination.rivals.rivals import alike, standing
from ident.examination.robot.base import HALFWAY
from ident.examination.robot.geometry import table_and_samples, with_gravity
from ident.examination.robot.gravity import direction

LEVEL = 1.0  # degrees, to which a floor or a table is level
LEAST = 0.2  # gain by gravity elsewhere, below which its direction is not measured


def tilted(prepared: Prepared, asked: Asked) -> Iterator[Check]:
    """Nothing where the study declares effects: they are not in a quick fit, and one may be the tilt. (Of two
    runs of 3 s of a Franka whose base was 3 degrees off 7 % were foretold for 3, and nothing was said.)"""
    made = None if prepared.study.effects else table_and_samples(prepared, asked)
    if made is None:
        return
    table, samples, gravity = made
    whole, how = all_rows(asked.quick.of(samples)), asked.how
    parts = parts_of(table, whole.columns, whole.samples, how)
    assert parts is not None
    size, plain = float(sum(gravity**2)) ** 0.5, errors(parts, None, gravity)[0]
    best = sought(parts, plain, size)[0] if size else gravity
    far = degrees_between(gravity, best) if size else HALFWAY
    if far >= HALFWAY or gain(plain, errors(parts, None, best)[0]) < LEAST:
        return
    seen = direction(table, whole, how, gravity)
    angle = degrees_between(gravity, seen.gravity)
    if angle < seen.within + LEVEL:
        return
    before, after = (
        Explained.by(with_bodies(with_gravity(table, g), whole), how) for g in (gravity, seen.gravity)
    )
    if not steadily(before, after, RARE):
        return
    pool = standing(asked, whole, how, after)
    if pool is None:
        return
    first = FirstAxis.of(table, asked.joints)
    zero = "" if first is None else first.zero_of(gravity, seen.gravity, seen.within)
    degrees = int(np.ceil(seen.within))
    known = f"{degrees} degree{'s' if degrees > 1 else ''}"
    said = f"gravity is turned by {angle:.0f} degrees against {told_by(asked.gravity)}'s (within {known})"
    check = Check(
        "base_orientation",
        (),
        f"{said}: the base is mounted otherwise, or its frame is{zero}",
        "level it, or ident diagnose measures its tilt",
    )
    its = Hypothesis(after.fit.gain_over(before.fit), how, check, words=said)
    others = [r.words for r in alike(pool, before, after)]
    yield its.beside([replace(its, words=words) for words in others]).check
