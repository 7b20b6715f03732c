"""What is asked of gravity and of the robot file's table, with bodies of their own."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ident.equations.prepared import Prepared
from ident.examination.check import Check
from ident.examination.fits.bodies import Parts, errors, parts_of
from ident.examination.fits.first_axis import FirstAxis, told_by
from ident.examination.fits.hypothesis import CLEARLY, Asked, Hypothesis
from ident.examination.fits.quick import gain_of
from ident.examination.fits.samples import Sample
from ident.examination.fits.sphere import sought
from ident.examination.fits.stretches import all_rows, pieces
from ident.examination.rivals.carried import Carried, carried_faults
from ident.examination.robot.axes import OtherTables
from ident.examination.robot.base import Tilt, base_orientation, unseen
from ident.examination.robot.gravity import Direction, direction


def of_geometry(prepared: Prepared, asked: Asked, prior: float) -> Iterable[Hypothesis | Tilt]:
    """Gravity and the axes of the table; asked last because they cost most."""
    made = table_and_samples(prepared, asked)
    if made is None:
        return
    table, samples, gravity = made
    columns, how = prepared.columns, asked.how
    identify, validate = _parts(table, samples, asked)

    def rivals() -> list[Carried]:
        return carried_faults(asked)

    def stretches() -> tuple[Parts, list[Parts]]:
        whole = all_rows(asked.quick.of(samples))
        parts = [parts_of(table, columns, [s.rows(k)], how) for s in whole.samples for k in pieces(whole, s)]
        one = parts_of(table, columns, whole.samples, how)
        assert one is not None
        return one, [its for its in parts if its is not None]

    def measured(near: np.ndarray, aside: Sequence[int]) -> Direction:
        whole = all_rows(asked.quick.of([s.without(aside) for s in samples]))
        return direction(table, whole, how, near)

    alone = prior == 0 and how == asked.quick.plain()
    others, names = rivals if alone else None, asked.names(range(len(columns.channels)))
    tables = _tables(made, asked)

    def instead(g: np.ndarray, aside: Sequence[int]) -> list[str]:
        return tables.instead_of(with_gravity(table, g), how, aside)

    asks = (others, stretches, names, None, measured, FirstAxis.of(table, asked.joints), instead)
    tilted = list(base_orientation(identify, validate, gravity, how, *asks, told_by(asked.gravity)))
    yield from tilted
    # a row of the table may stand for the base, or for a joint that is recorded the other way
    clearly = [its.gain + CLEARLY * isinstance(its, Hypothesis) for its in tilted]
    prior = max([prior + CLEARLY if prior else 0.0, *clearly])
    for axis in tables.told(prior):
        plain = errors(identify, None, gravity)[0]
        best = sought(identify, plain, float(np.linalg.norm(gravity)) or 9.81)[0]
        if axis.gain > gain_of(plain, errors(identify, None, best)[0]):
            yield axis


def tables_instead(prepared: Prepared, asked: Asked, h: Hypothesis) -> list[str]:
    """What the robot file may have wrong in the place of torques or motions taken otherwise, in words."""
    made = table_and_samples(prepared, asked)
    if made is None:
        return []
    tables, kept = _tables(made, asked), {s.label for s in made[1]}
    other = h.quick and h.quick.of([s for s in h.quick.samples if s.label in kept])
    return tables.instead_of(tables.table, h.how, other=other)


def _tables(made: tuple[Any, list[Sample], np.ndarray], asked: Asked) -> OtherTables:
    table, samples, gravity = made
    names = asked.names(range(len(asked.how.order)))
    return OtherTables(with_gravity(table, gravity), asked.quick.of(samples), asked.how, names)


def with_gravity(table: Any, gravity: np.ndarray) -> Any:
    return replace(table, gravity=tuple(float(g) for g in gravity))


def unseen_base(prepared: Prepared, asked: Asked) -> Iterable[Check]:
    made = table_and_samples(prepared, asked)
    return () if made is None else unseen(*_parts(*made[:2], asked), made[2], told_by(asked.gravity))


def table_and_samples(prepared: Prepared, asked: Asked) -> tuple[Any, list[Sample], np.ndarray] | None:
    """Table, samples of the usual load, gravity (3,) as the study has it; None where nothing is fitted or the
    table is of other joints."""
    from modelgen.geometry.kinematics import Geometry

    study, everything = prepared.study, asked.quick.samples
    table = Geometry.of(prepared.columns.model.geometry)
    loads = [s.payload for s in everything]
    usual = max(set(loads), key=loads.count)
    samples = [s for s in everything if s.payload == usual]
    rows = sum(len(s.q) for s in samples if s.role == "identify")
    if not rows or len([row for row in table.rows if row.sigma != 2]) != everything[0].q.shape[1]:
        return None
    gravity = np.array(study.gravity if study.gravity is not None else [float(g) for g in table.gravity])
    return table, samples, gravity


def _parts(table: Any, samples: Sequence[Sample], asked: Asked) -> tuple[Parts, Parts | None]:
    """Of identify and validate, with gravity apart."""
    each = ([s for s in samples if s.role == role] for role in ("identify", "validate"))
    identify, validate = (parts_of(table, asked.quick.columns, its, asked.how) for its in each)
    assert identify is not None
    return identify, validate


def beside_tilt(prepared: Prepared, asked: Asked, h: Hypothesis, tilt: Tilt) -> bool:
    """Whether a hypothesis explains beside a small tilt, which explains more, most of what it does without
    it: a UR10e's first torque looked three times too small where the base was tilted by 6 degrees."""
    each = ((table_and_samples(prepared, its), its) for its in (asked, asked.after(h)))
    made = [_parts(*told[:2], its)[0] for told, its in each if told is not None]
    before, after = (errors(its, None, tilt.gravity)[0] for its in made)
    return gain_of(before, after) > 0.5 * h.gain
