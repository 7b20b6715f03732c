"""Every check of one table, one after the other."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from ident.examination.check import Check
from ident.examination.tables import processed, repeats
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.mending import Mender
from ident.examination.tables.noise_bursts import noise_bursts
from ident.examination.tables.signals import (
    Columns,
    dead_and_resting,
    dead_bands,
    flags,
    limits_hit,
    lost_samples,
    posed,
    position_steps,
    units,
    wraps,
)
from ident.examination.tables.smoothed_wraps import smoothed_wraps
from ident.examination.tables.stopped_at_once import stopped_at_once
from ident.examination.tables.torque_drops import torque_drops
from ident.examination.tables.torque_leaps import torque_leaps
from ident.recordings.counted_from_zero import from_zero

TORQUES = ("tau_m", "tau_l", "i")


def of_table(
    columns: Columns,
    mender: Mender,
    excerpt: Excerpt,
    lowest: np.ndarray,
    highest: np.ndarray,
    rows: int,
    resting: Sequence[Collection[int]] = (),
) -> list[Check]:
    """Every check of one table, with the recording's name; resting: joints that stand, stretch by stretch."""
    periods = repeats.periods(columns, excerpt)
    told = {k: its for k, its in periods.items() if repeats.seldom(its[0], columns)}
    slow = set(told)
    lost = sum(
        (c for kind, c in mender.counts.items() if kind not in ("spike", "ended")),
        np.zeros(len(columns.signals)),
    )
    coarse = tuple(repeats.coarse(columns, excerpt, slow))
    few = {columns.signals.index(name) for check in coarse for name in check.signals}  # one is the largest
    bands = tuple(dead_bands(columns, mender, rows))
    banded = {columns.signals.index(name) for check in bands for name in check.signals}  # told with its size
    gone = {int(k) for k in np.flatnonzero(lost >= repeats.STILL_ROWS)}  # interpolated, so they stand still
    lines = tuple(processed.interpolated(columns, excerpt, slow | few))
    between = {columns.signals.index(name) for check in lines for name in check.signals}
    found = chain(
        lost_samples(columns, mender, rows),
        wraps(columns, mender),
        smoothed_wraps(columns, excerpt),
        units(columns, mender, excerpt, lowest, highest),
        position_steps(columns, mender, excerpt, periods),
        dead_and_resting(columns, lowest, highest, np.flatnonzero(lost >= rows)),
        posed(columns, lowest, highest, resting),
        flags(columns, excerpt),
        limits_hit(columns, excerpt, slow | few | gone, repeats.stepped),
        bands,
        repeats.held(columns, told),
        repeats.stale(columns, excerpt) if not slow else (),
        lines,
        processed.scaled(columns, excerpt),
        stopped_at_once(columns, excerpt, slow | gone),
        torque_leaps(columns, excerpt),
        noise_bursts(columns, excerpt, slow | few),
        torque_drops(columns, excerpt),
        repeats.copies(columns, excerpt),
        repeats.standing(columns, excerpt, slow | gone | banded | between),
        repeats.noise_alone(columns, excerpt),
        repeats.unsigned(columns, excerpt),
        coarse,
        repeats.noisy(columns, excerpt, slow | few),
    )
    return [replace(check, recording=columns.recording) for check in found]


def more_joints(recording: str, columns: Collection[str], joints: Collection[str]) -> list[Check]:
    """Position and torque of joints that the robot does not have: the recording may be another robot's."""
    measured = {name[1:] for name in columns if name.startswith("q") and name[1:].isdigit()}
    measured &= {name[len(t) :] for t in TORQUES for name in columns if name.startswith(t)}
    others = sorted(measured - set(joints), key=int)
    if not others or not set(joints) < measured:
        return []
    which = f"joint{'s' if len(others) > 1 else ''} {', '.join(others)}"
    counted = from_zero(columns, joints)
    from_0 = f"where the log counts joints from 0 write columns: {counted}; " if counted else ""
    return [
        Check(
            "joint_numbers" if counted else "more_joints",
            (),
            f"position and torque of {which} are recorded, which the robot does not have",
            f"{from_0}if another robot was recorded, name that; a tool's joints may be left out",
            recording=recording,
        )
    ]
