"""The equations of the robot's simulated, noise-free motion: what IDIM-IV and DIDIM are made of.

Each recording's loop is simulated from the positions that were commanded (`q_ref1`, ...) with the present
estimate, and its regressor takes the place of the measured one: at the same instants, with the same weights
and through the same decimation, so every row of it belongs to a row of the recording. Only commanded
positions will do: measured ones, however filtered, carry the noise whose effect is to be taken out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ident.equations.build import build
from ident.equations.columns import Columns
from ident.equations.observation import RecordingSystem
from ident.equations.prepared import Prepared
from ident.errors import FitFailedError, StudyError
from ident.progress import Progress, silent
from ident.recordings.opening import open_recording
from ident.recordings.recording import RecordingStream
from ident.recordings.signal_columns import joint_names
from ident.recordings.study import ColumnMap, RecordingEntry
from ident.signals.filtering import FilteredBlock, LowPass, first_difference, second_difference, zero_phase
from ident.twin.closed_loop import Gains, LoopError, Motion, Plant, Torque, follow

SAMPLES = 20.0  # of a reference, per period of the positions' cut-off
SLOW = 0.01  # of the reference's peak speed: within it simulated friction turns over at least


@dataclass(frozen=True, slots=True)
class Loop:
    """The identify recordings of a study and the motions that were asked of the robot, stretch by stretch."""

    prepared: Prepared
    cutoff_hz: float
    references: dict[str, tuple[Motion, ...]]

    def systems(self, chi: np.ndarray, progress: Progress = silent) -> tuple[RecordingSystem, ...]:
        """Equations of the motion that parameters chi (b,) make. Raises FitFailedError, StudyError."""
        progress("simulating the loop")
        moved = {}
        for stream, bank in zip(self.prepared.streams, self.prepared.banks):
            if stream.label not in self.references:
                continue
            for number, reference in enumerate(self.references[stream.label]):
                vs = np.zeros(reference.q.shape[1]) if bank.vs is None else bank.vs
                width = np.maximum(vs, SLOW * np.abs(reference.dq).max(axis=0))
                width = np.maximum(width, 1e-6)
                plant = Plant(torque_of(self.prepared.columns, chi, stream.payload, width), width)
                try:
                    moved[stream.label, number] = plant, self._followed(plant, reference)
                except LoopError as error:
                    raise FitFailedError(f"{stream.file}: {error}") from None

        def simulated(stream: RecordingStream, index: int, block: FilteredBlock) -> FilteredBlock:
            plant, motion = moved[stream.label, index]
            q, dq, ddq = motion.at(block.t)
            return replace(block, q=q, dq=dq, ddq=ddq, sign_dq=plant.sign(dq), speed=dq, vs=plant.width)

        return build(self.prepared, self.cutoff_hz, roles=("identify",), moved=simulated)

    def _followed(self, plant: Plant, reference: Motion) -> Motion:
        settings, n = self.prepared.study.controller, reference.q.shape[1]
        assert settings is not None
        if settings.kind == "computed_torque":
            return reference
        inertia = plant.inertia(reference.q)
        if settings.kp and settings.kd:
            kp, kd = np.array(settings.kp), np.array(settings.kd)
            gains = Gains(kp, kd, 2 * np.pi * settings.integral_hz * kp)
        else:
            hz = np.broadcast_to(np.array(settings.bandwidth_hz), n)
            gains = Gains.of_bandwidth(inertia, hz, settings.damping, settings.integral_hz)
        return follow(plant, gains, reference)[0]


def loop_of(prepared: Prepared, cutoff_hz: float, progress: Progress = silent) -> Loop:
    """Read what was commanded in the identify recordings. Raises StudyError, RecordingError."""
    study = prepared.study
    settings, n = study.controller, len(prepared.columns.need.joints)
    assert settings is not None
    for key in ("kp", "kd", "bandwidth_hz"):
        values = getattr(settings, key)
        if values is not None and len(values) not in ((1, n) if key == "bandwidth_hz" else (n,)):
            raise StudyError(
                str(study.file),
                f"controller.{key}",
                f"has {len(values)} values, the robot {study.robot} has {n} joints; give one per joint",
            )
    progress("reading the commanded positions")
    entries = {entry.label: entry for entry in study.recordings}
    references = {
        stream.label: tuple(_references(prepared, stream, entries[stream.label]))
        for stream in prepared.streams
        if stream.role == "identify"
    }
    return Loop(prepared, cutoff_hz, references)


def _references(prepared: Prepared, stream: RecordingStream, entry: RecordingEntry) -> list[Motion]:
    """Commanded positions of each stretch, through the positions' filter, and their derivatives."""
    study, need = prepared.study, prepared.columns.need
    columns = {**entry.columns, **_commanded(prepared, stream, entry)}
    asked = study.with_(estimator="wls", controller=None)
    mapped = entry.model_copy(update={"columns": columns})
    told = open_recording(asked, mapped, need, prepared.columns.model.prismatic)
    out = []
    rate_hz = told.rate_hz
    low = LowPass(study.filter.position_cutoff_hz, rate_hz, study.filter.order)
    every = max(int(rate_hz / (SAMPLES * low.cutoff_hz)), 1)
    for segment, blocks in told.segments():
        q, _, _ = told.split(np.concatenate(list(blocks)))
        t = segment.start + np.arange(len(q)) / rate_hz
        q = zero_phase(q, rate_hz, low.cutoff_hz, low.order)
        q = np.vstack([q[:1], q[:1], q, q[-1:], q[-1:]])
        dq, ddq = first_difference(q, rate_hz), second_difference(q, rate_hz)
        out.append(Motion(t[::every], q[2:-2][::every], dq[::every], ddq[::every]))
    if len(out) != len(stream.survey.segments):
        raise StudyError(
            str(study.file),
            "controller.reference",
            f"the commanded positions of {stream.label} have gaps that the measured ones have not; "
            "cut the recording with from and to, or write estimator: wls",
        )
    return out


def _commanded(prepared: Prepared, stream: RecordingStream, entry: RecordingEntry) -> dict[str, ColumnMap]:
    """{q1: its commanded position's column} with the scale and sign of the measured one."""
    study, need = prepared.study, prepared.columns.need
    assert study.controller is not None
    prefix, present, out = study.controller.reference, set(stream.table.columns), {}
    for joint, name in zip(need.joints, joint_names(study, need)):
        column = next((c for c in (f"{prefix}{joint}", f"{prefix}{name}") if c in present), None)
        if column is None:
            raise StudyError(
                str(study.file),
                "controller.reference",
                f"{stream.label} has no column {prefix}{joint}, and the loop is simulated from the positions "
                "that were commanded; log them, name them with controller: {reference: PREFIX}, or write "
                "estimator: wls",
            )
        maps = {**study.columns, **entry.columns}
        its = maps.get(f"q{joint}", maps.get(name, ColumnMap(column=column)))
        out[f"q{joint}"] = its.model_copy(update={"column": column})
    return out


def torque_of(columns: Columns, chi: np.ndarray, payload: str | None, width: np.ndarray) -> Torque:
    """Motor torques of the study's columns at chi (b,); width (n,) of the turn-over of coupled friction."""
    model, values = columns.model, columns.model_chi(chi, payload)
    drives = [k for k, channel in enumerate(columns.need.channels) if channel.side == "motor"]
    rows = columns.rows[drives]
    place = {k: position for position, k in enumerate(drives)}
    extras = [extra for extra in columns.extras if extra.channel in place]

    def torque(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, sign: np.ndarray) -> np.ndarray:
        tau = np.asarray(model.torque(q, dq, ddq, values, sign=sign))[:, rows]
        if extras:
            block = FilteredBlock(np.zeros(len(q)), q, dq, ddq, sign, None, None, width, np.ones_like(q), dq)
            for extra in extras:
                tau[:, place[extra.channel]] += chi[extra.column] * extra.values(block)
        return tau

    return torque
