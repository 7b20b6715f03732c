"""A base that is mounted otherwise in one recording: gravity has another direction there alone.

Bodies are those of all recordings; in the one gravity is taken apart (bodies.py), and sought on its sphere.
(Of an LWR4+ one of whose runs was tilted by 8 degrees another zero of its second position was told, or of its
torques, or a load.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ident.examination.fits.bodies import errors, parts_with_gravity_of, with_bodies
from ident.examination.fits.hypothesis import Asked
from ident.examination.fits.quick import Quick, quick_of
from ident.examination.fits.sphere import degrees_between, sought
from ident.examination.fits.stretches import Explained
from ident.examination.one_recording.changed import Changed
from modelgen.geometry.kinematics import Geometry

REMEDY = "give it a study of its own with its gravity:, or leave it out"


def mounted_otherwise(asked: Asked, whole: Quick) -> Iterator[Changed]:
    """Each recording with gravity where all of them are explained best, the others with the study's."""
    columns, how = whole.columns, asked.how
    table = Geometry.of(columns.model.geometry)
    gravity = np.array(table.gravity, float)  # the study's, where it has one
    joints = sum(row.sigma != 2 for row in table.rows)
    if columns.need.model == "D" or not gravity.any() or joints != len(asked.joints):
        return
    usual = with_bodies(table, whole).samples
    for k, s in enumerate(whole.samples):
        parts = parts_with_gravity_of(s, table, columns, whole.samples, how)
        best = sought(parts, errors(parts, None, gravity)[0], float(np.linalg.norm(gravity)))[0]
        there = with_bodies(replace(table, gravity=tuple(best.tolist())), whole.of([s])).samples[0]
        explained = Explained.by(quick_of(columns, [*usual[:k], there, *usual[k + 1 :]]), how)
        degrees = degrees_between(gravity, best)
        words = f"its base is mounted otherwise, gravity turned by about {degrees:.0f} degrees"
        yield Changed(s.label, (), "base_orientation", words, REMEDY, explained)
