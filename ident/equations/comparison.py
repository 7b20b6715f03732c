"""Measured against modelled torque, over all samples: decimated, and at the full rate.

At the full rate both sides run through the position filter and nothing else; the model's friction with them:
without that, a sign that jumps at a reversal would be held against a measurement that cannot jump. At the
decimated rate both run through the decimation filter, as Y and W do in the fit. Samples of joints at rest,
which the fit leaves out, are in both; what was put in for samples that were lost is in neither.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ident.equations.attaching import halo_of, motion_of
from ident.equations.columns import Columns
from ident.equations.fitted import FittedModel
from ident.equations.prepared import Prepared
from ident.equations.terms import Chain, Term
from ident.progress import Progress, silent
from ident.recordings.recording import RecordingStream
from ident.recordings.study import ROLES
from ident.signals.decimation import Decimator, kept_every
from ident.signals.filtering import FilteredBlock, LowPass, filter_stream, windows
from ident.signals.low_pass import filtered
from ident.signals.neighbours import by_segment, sliced, wide_blocks

CURVE_RATE = 5.0  # drawn samples per second and Hz of position cut-off
CURVE_POINTS = 12000  # of one recording; less where more than twenty share CURVES
CURVES, LEAST_POINTS = 240_000, 400
LOST = 0.5  # share of a filtered sample that was not measured, from which it is not compared


@dataclass(frozen=True, slots=True)
class Curves:
    """Torques of one recording for plots: t (m,), measured, modelled (m, channels); NaN rows part
    segments, and measured is NaN where it was lost."""

    label: str
    role: str
    t: np.ndarray
    measured: np.ndarray
    modelled: np.ndarray


@dataclass(frozen=True, slots=True)
class FullRate:
    """Errors at the full rate, at the decimated rate, and decimated with the full model; curves to draw."""

    full_rate: Squares
    decimated: Squares
    decimated_full_model: Squares
    curves: tuple[Curves, ...]


@dataclass(frozen=True, slots=True)
class Squares:
    """above, below: sums of squares of error and of torque, {recording label: (channels,)}; roles of the
    labels."""

    channels: tuple[str, ...]
    roles: dict[str, str]
    above: dict[str, np.ndarray]
    below: dict[str, np.ndarray]

    @classmethod
    def empty(cls, channels: tuple[str, ...], roles: dict[str, str]) -> Squares:
        return cls(
            channels,
            roles,
            {label: np.zeros(len(channels)) for label in roles},
            {label: np.zeros(len(channels)) for label in roles},
        )

    def add(
        self, label: str, measured: np.ndarray, modelled: np.ndarray, lost: np.ndarray | None = None
    ) -> None:
        """Rows (N, channels) of one recording; lost: their share that was not measured."""
        real: Any = True if lost is None or not lost.size else lost < LOST
        self.above[label] += np.sum((measured - modelled) ** 2, axis=0, where=real)
        self.below[label] += np.sum(measured**2, axis=0, where=real)

    def by_role(self) -> dict[str, dict[str, float]]:
        """100 ||error|| / ||torque||: {role: {"total" | channel: percent}}; NaN of a torque that reads 0
        throughout."""
        out: dict[str, dict[str, float]] = {}
        for role in ROLES:
            labels = [label for label, its in self.roles.items() if its == role]
            if labels:
                out[role] = self._percent(labels)
        return out

    def by_recording(self) -> dict[str, dict[str, float]]:
        return {label: self._percent([label]) for label in self.roles}

    def _percent(self, labels: Sequence[str]) -> dict[str, float]:
        above = np.sum([self.above[label] for label in labels], axis=0)
        below = np.sum([self.below[label] for label in labels], axis=0)
        parts = {"total": (above.sum(), below.sum())} | dict(zip(self.channels, zip(above, below)))
        return {name: float(100 * np.sqrt(a / b)) if b else np.nan for name, (a, b) in parts.items()}


def modelled_torque(
    columns: Columns, chi: np.ndarray, payload: str | None, block: FilteredBlock
) -> np.ndarray:
    """W chi of a block (N, channels) with the study's own columns; drive gains are left to the measured
    side."""
    model = columns.model
    torque = np.asarray(
        model.torque(block.q, block.dq, block.ddq, columns.model_chi(chi, payload), sign=block.sign_dq)
    )[:, columns.rows]
    gains = set(columns.gain_columns.values())
    for extra in columns.extras:
        if extra.column not in gains and chi[extra.column] != 0:
            torque[:, extra.channel] += chi[extra.column] * extra.values(block)
    return torque


def measured_torque(columns: Columns, chi: np.ndarray, block: FilteredBlock) -> np.ndarray:
    """Y of a block (N, channels), with identified drive gains where there are any."""
    motor = block.motor
    if columns.gain_columns and motor is not None:
        channel_of = {c.joint: k for k, c in enumerate(columns.need.channels) if c.side != "sensor"}
        motor = motor * chi[[columns.gain_columns[channel_of[joint]] for joint in columns.need.motor]]
    return columns.need.torque(motor, block.sensor)


@dataclass(frozen=True, slots=True)
class Fitted:
    """An estimate chi (b,) and the terms at it; `model` is what they read, None without terms."""

    model: FittedModel | None
    chi: np.ndarray
    terms: tuple[Term, ...] = ()

    def chain(self) -> Chain | None:
        """What computes the terms' torques in one pass."""
        if self.model is None or not self.terms:
            return None
        return Chain(replace(self.model, chi=self.chi[: len(self.model.columns.parameters)]), self.terms)


def fitted_torques(
    columns: Columns, stream: RecordingStream, blocks: Iterable[FilteredBlock], fits: Sequence[Fitted]
) -> Iterator[tuple[FilteredBlock, list[np.ndarray], list[np.ndarray]]]:
    """Blocks of one stretch with measured and modelled torque (N, channels) by each of the fits."""
    chains = [fit.chain() for fit in fits]
    halo = halo_of([term for fit in fits for term in fit.terms], stream.rate_hz)
    for wide, inner in wide_blocks(blocks, halo):
        block = wide if inner == slice(0, len(wide.t)) else sliced(wide, inner)
        motion = motion_of(stream, wide, columns)
        measured, modelled = [], []
        for fit, chain in zip(fits, chains):
            torque = modelled_torque(columns, fit.chi, stream.payload, block)
            modelled.append(torque if chain is None else torque + chain.torque(motion)[inner])
            measured.append(measured_torque(columns, fit.chi, block))
            if chain is not None:
                chain.forget()
        yield block, measured, modelled


def compare_torques(
    prepared: Prepared, fit: Fitted, full: Fitted, cutoff_hz: float, progress: Progress = silent
) -> FullRate:
    """One pass over all recordings: a fit at both rates, the full model's at the decimated one."""
    columns, order = prepared.columns, prepared.study.filter.order
    channels = columns.channels
    roles: dict[str, str] = {stream.label: stream.role for stream in prepared.streams}
    at_full_rate, decimated, full_model = (Squares.empty(channels, roles) for _ in range(3))
    n = len(channels)
    curves, points = [], min(CURVE_POINTS, max(CURVES // len(prepared.streams), LEAST_POINTS))
    total = sum(stream.survey.rows for stream in prepared.streams)
    done = 0
    for stream, bank in zip(prepared.streams, prepared.banks):
        stride = max(
            1,
            int(stream.rate_hz / (CURVE_RATE * bank.position.cutoff_hz)),
            -(-stream.survey.rows // points),
        )
        kept: list[np.ndarray] = []
        filter, every = LowPass(cutoff_hz, stream.rate_hz, order), kept_every(cutoff_hz, stream.rate_hz)
        for _, blocks in by_segment(filter_stream(stream, bank)):
            holes = len(stream.survey.mending.rows) > 0
            tap = _Tap(Decimator(filter, every, (3 + holes) * n), columns, holes)
            if kept:
                kept.append(np.full((1, 1 + 2 * n), np.nan))
            torques = tap.torques(fitted_torques(columns, stream, blocks, (fit, full)))
            for k, both in low_pass_blocks(torques, bank.position):
                measured, modelled, lost = both[:, :n], both[:, n : 2 * n], both[:, 2 * n :]
                at_full_rate.add(stream.label, measured, modelled, lost)
                t = tap.start + (k + np.arange(len(both))) / stream.rate_hz
                seen = np.where(lost < LOST, measured, np.nan) if holes else measured
                drawn = slice(-k % stride, None, stride)
                kept.append(np.column_stack([t[drawn], seen[drawn], modelled[drawn]]))
                done += len(both)
                progress("comparing measured and modelled torque", min(done / total, 1.0))
                for part in tap.taken():
                    decimated.add(stream.label, part[:n].T, part[n : 2 * n].T, part[3 * n :].T)
                    full_model.add(stream.label, part[:n].T, part[2 * n : 3 * n].T, part[3 * n :].T)
            for part in (*tap.taken(), tap.fold.finish()):
                decimated.add(stream.label, part[:n].T, part[n : 2 * n].T, part[3 * n :].T)
                full_model.add(stream.label, part[:n].T, part[2 * n : 3 * n].T, part[3 * n :].T)
        rows = np.concatenate(kept) if kept else np.zeros((0, 1 + 2 * n))
        curves.append(Curves(stream.label, stream.role, rows[:, 0], rows[:, 1 : 1 + n], rows[:, 1 + n :]))
    return FullRate(at_full_rate, decimated, full_model, tuple(curves))


class _Tap:
    """Decimates the torques of one stretch on their way to the full-rate comparison.

    holes: samples were lost. The fit's own torque stands in for them, so that the filters spread no error
    into those beside them, and their share of a sample is handed on with it."""

    def __init__(self, fold: Decimator, columns: Columns, holes: bool) -> None:
        self.fold, self.holes = fold, holes
        self.joint_of = columns.joint_of
        self.kept: list[np.ndarray] = []
        self.start = 0.0

    def taken(self) -> list[np.ndarray]:
        """What was decimated since the last time."""
        out, self.kept = self.kept, []
        return out

    def torques(
        self, found: Iterable[tuple[FilteredBlock, list[np.ndarray], list[np.ndarray]]]
    ) -> Iterator[np.ndarray]:
        """[measured modelled] (N, 2 channels) of each block, [measured modelled lost] with holes."""
        for number, (block, measured, modelled) in enumerate(found):
            if number == 0:
                self.start = float(block.t[0])
            one, lost = measured[0], []
            if self.holes and block.real is not None:
                real = block.real[:, self.joint_of]
                one, lost = np.where(real, one, modelled[0]), [1.0 - real]
            done = self.fold.push(np.hstack([one, *modelled, *lost]).T)
            if done is not None:
                self.kept.append(done)
            yield np.hstack([one, modelled[0], *lost])


def low_pass_blocks(blocks: Iterator[np.ndarray], filter: LowPass) -> Iterator[tuple[int, np.ndarray]]:
    """Zero-phase filter of a stream of blocks (N, m): (number of the first row, filtered rows)."""
    for start, window, inner in windows(blocks, filter.halo):
        yield start, filtered(filter, window, inner)
