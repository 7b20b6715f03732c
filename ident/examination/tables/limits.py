"""Recordings against the limits that the robot file states: what no joint of this robot does.

Positions out of reach and torques of twice a joint's limit tell a wrong unit, zero, gain or order of joints.
Limits in files are often chosen with care for software, not for steel, so that little is never told.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ident.equations.prepared import Prepared
from ident.examination.check import Check
from ident.recordings.recording import RecordingStream

BEYOND = 0.05  # of the joint's range, and 0.1 rad at least
LEAST = 0.1
TURNS = tuple(2 * np.pi * k for k in (-2, -1, 1, 2))
TIMES = 2.0  # a joint's torque limit


def beyond_limits(prepared: Prepared, torques: bool = True) -> Iterator[Check]:
    """A warning for each recording and kind of signal, joints together; `torques`: whether these are known to
    be torques."""
    study, need = prepared.study, prepared.columns.need
    limits = list(prepared.columns.model.limits)
    prismatic = [str(joint) in prepared.columns.model.prismatic for joint in need.joints]
    for stream in prepared.streams:
        yield from _positions(stream, limits, prismatic)
        if torques and study.drive_gains != "identify":  # else motor signals are in the drive's own unit
            yield from _torques(stream, limits, "i" if reads_currents(prepared) else "tau_m")


def reads_currents(prepared: Prepared) -> bool:
    """Whether motor torques are computed from currents."""
    study, stream = prepared.study, prepared.streams[0]
    number = f"i{stream.need.joints[0]}"
    return study.drive_gains is not None and (number in study.columns or number in stream.names)


def _positions(
    stream: RecordingStream, limits: list[Mapping[str, Any]], prismatic: list[bool]
) -> Iterator[Check]:
    low, high = stream.survey.lowest, stream.survey.highest
    told, names = [], []
    for k, (joint, its) in enumerate(zip(stream.need.joints, limits)):
        if "q" not in its:
            continue
        margin = max(BEYOND * (its["q"][1] - its["q"][0]), 0.0 if prismatic[k] else LEAST)
        turns = [0.0] if prismatic[k] else [0.0, *TURNS]  # a zero that is whole turns away changes nothing
        beyond = [_beyond(low[k] + turn, high[k] + turn, its["q"]) for turn in turns]
        if min(by for by, _ in beyond) > margin:
            names.append(f"q{joint}")
            told.append(
                f"q{joint} reaches {beyond[0][1]:.3g} (limits {its['q'][0]:.3g} to {its['q'][1]:.3g})"
            )
    if told:
        yield _check(stream, names, told, "the unit, the zero and the order of the joints")


def _beyond(low: float, high: float, limits: tuple[float, float]) -> tuple[float, float]:
    """How far a range goes out of the limits, and where to."""
    return max((limits[0] - low, low), (high - limits[1], high))


def _torques(stream: RecordingStream, limits: list[Mapping[str, Any]], motor: str) -> Iterator[Check]:
    n, need = len(stream.need.joints), stream.need
    places = [(k, "tau_m", motor) for k in need.motor] + [(k, "tau_l", "tau_l") for k in need.sensor]
    largest = np.maximum(np.abs(stream.survey.lowest), np.abs(stream.survey.highest))[n:]
    told, names = [], []
    for (k, torque, recorded), reached in zip(places, largest):
        most = limits[k].get("tau")
        if most is not None and reached > TIMES * most:
            names.append(f"{recorded}{need.joints[k]}")
            told.append(f"{torque}{need.joints[k]} reaches {reached:.3g} (limit {most:.3g})")
    if told:
        yield _check(stream, names, told, "its unit, the drive's gain and the order of the joints")


def _check(stream: RecordingStream, signals: list[str], told: list[str], look: str) -> Check:
    return Check(
        "beyond_limits",
        tuple(signals),
        f"{', '.join(told[:4])}{' and others' if len(told) > 4 else ''}: far beyond what the robot file says",
        f"check {look}, or correct the limits in the robot file",
        recording=stream.label,
        hint=True,
    )
