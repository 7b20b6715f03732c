"""What a study's recordings are asked: samples without what is broken, clipped or at rest, and their fit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ident.equations.prepared import Prepared, resting_joints
from ident.examination.fits.hypothesis import Asked, signal_of
from ident.examination.fits.quick import quick_of
from ident.examination.fits.samples import Sample, take
from ident.examination.tables.limits import reads_currents
from ident.examination.tables.velocity import logged_velocities

BROKEN = ("dead_channel", "unsigned_torque")  # of a torque, which is then asked nothing


def asked_of(prepared: Prepared) -> Asked | None:
    """None where too little is fitted to ask anything."""
    columns, clipped = prepared.columns, _clipped(prepared)
    broken = {n for s in prepared.streams for c in s.checks if c.check in BROKEN for n in c.signals}
    still = np.flatnonzero(np.isin(columns.joint_of, resting_joints(prepared.streams))).tolist()
    taken = [
        s for role in ("identify", "validate") for s in take(prepared.streams, prepared.banks, columns, role)
    ]
    samples = _unclipped(prepared, taken, clipped)
    samples = [s.without([*_channels(prepared, broken), *still]) for s in samples]
    for sample in samples:  # motor signals of unknown gain are no torques yet
        sample.weight[:, list(columns.gain_columns)] = 0.0
    if not any(s.role == "identify" for s in samples):
        return None
    quick = quick_of(columns, samples)
    if not (quick.identify.rows > 10).any():
        return None
    how, currents = quick.plain(), reads_currents(prepared)
    gains, maps = _gains(prepared, currents), _maps(prepared)
    anywhere = frozenset().union(*clipped.values())
    its = quick, how, quick.fit(how), maps, currents, gains, _velocities(prepared), anywhere
    return Asked(*its, _hidden_steps(prepared), prepared.study.gravity)


def _clipped(prepared: Prepared) -> dict[str, set[str]]:
    """Of every recording the torques that are."""
    return {
        s.label: {n for c in s.checks if c.check == "saturation" for n in c.signals} for s in prepared.streams
    }


def _unclipped(prepared: Prepared, samples: list[Sample], clipped: Mapping[str, set[str]]) -> list[Sample]:
    """Without what is clipped: no model explains it, and other faults took its place (of an AIRBOT's clipped
    torque a factor, of a Barrett's another zero was told)."""
    return [s.unclipped(_channels(prepared, clipped[s.label])) for s in samples]


def _channels(prepared: Prepared, signals: set[str]) -> list[int]:
    """Places of the torques that are read from these signals."""
    currents, columns = reads_currents(prepared), prepared.columns
    return [c for c in range(len(columns.channels)) if signal_of(columns, c, currents) in signals]


def _gains(prepared: Prepared, currents: bool) -> np.ndarray:
    """(C,) N m per unit of what is recorded of each channel, where the study knows it."""
    told, columns = prepared.study.drive_gains, prepared.columns
    if not currents or told is None or isinstance(told, str):
        return np.ones(len(columns.channels))
    motor = [c.side in ("motor", "drive") for c in columns.need.channels]
    return np.where(motor, np.array(told, float)[np.array(columns.joint_of, int)], 1.0)


def _hidden_steps(prepared: Prepared) -> np.ndarray:
    """(n,) rad | m, of all recordings the largest."""
    none = np.zeros(len(prepared.columns.need.joints))
    return np.max([none, *(np.array(bank.hidden) for bank in prepared.banks if bank.hidden)], axis=0)


def _maps(prepared: Prepared) -> dict[str, Any]:
    """The study's maps, and those that all recordings were read by, into which a line is put."""
    first, *others = (stream.maps for stream in prepared.streams)
    shared = {name: its for name, its in first.items() if all(other.get(name) == its for other in others)}
    return {**shared, **prepared.study.columns}


def _velocities(prepared: Prepared) -> frozenset[str]:
    """Joints whose velocity is logged in every recording."""
    labels = [str(joint) for joint in prepared.columns.need.joints]
    logged = [set(logged_velocities(labels, stream.maps, stream.table)) for stream in prepared.streams]
    return frozenset(set(labels).intersection(*logged))
