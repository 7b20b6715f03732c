"""Measured against modelled torque at the full rate: after the position filter, before any decimation.

Both sides run through the same zero-phase filter, and the model's friction with them: without that, a sign that
jumps at a reversal would be held against a measurement that cannot jump.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.fft

from ident.columns import Columns
from ident.filtering import FilterBank, FilteredBlock, LowPass, filter_stream, windows
from ident.progress import Progress, silent
from ident.reading import RecordingStream

CURVE_RATE = 5.0        # drawn samples per second and Hz of position cut-off
CURVE_POINTS = 12000    # of one recording


@dataclass(frozen=True, slots=True)
class Curves:
    """Torques of one recording for plots: t (m,), measured, modelled (m, channels); NaN rows part segments."""

    label: str
    role: str
    t: np.ndarray
    measured: np.ndarray
    modelled: np.ndarray


@dataclass(frozen=True, slots=True)
class FullRate:
    """above, below: sums of squares of error and of torque, {recording label: (channels,)}; roles of the labels."""

    above: dict[str, np.ndarray]
    below: dict[str, np.ndarray]
    roles: dict[str, str]
    curves: tuple[Curves, ...]

    def errors(self, channels: Sequence[str]) -> dict[str, dict[str, float]]:
        """100 ||error|| / ||torque||: {role: {"total" | channel: percent}}."""
        out: dict[str, dict[str, float]] = {}
        for role in ("identify", "validate", "test"):
            labels = [label for label, its in self.roles.items() if its == role]
            if labels:
                out[role] = self._percent(labels, channels)
        return out

    def recording_errors(self, channels: Sequence[str]) -> dict[str, dict[str, float]]:
        return {label: self._percent([label], channels) for label in self.roles}

    def _percent(self, labels: Sequence[str], channels: Sequence[str]) -> dict[str, float]:
        above = sum(self.above[label] for label in labels)
        below = sum(self.below[label] for label in labels)
        out = {"total": float(100 * np.sqrt(np.sum(above) / max(np.sum(below), 1e-300)))}
        for j, name in enumerate(channels):
            out[name] = float(100 * np.sqrt(above[j] / max(below[j], 1e-300)))  # type: ignore[index]
        return out


def modelled_torque(columns: Columns, chi: np.ndarray, payload: str | None, block: FilteredBlock) -> np.ndarray:
    """W chi of a block (N, channels) with the study's own columns; drive gains are left to the measured side."""
    model = columns.model
    torque = np.asarray(model.torque(block.q, block.dq, block.ddq, columns.model_chi(chi, payload), sign=block.sign_dq))
    gains = set(columns.gain_columns.values())
    for extra in columns.extras:
        if extra.column not in gains and chi[extra.column] != 0:
            torque[:, extra.channel] += chi[extra.column] * extra.values(block)
    return torque


def measured_torque(columns: Columns, chi: np.ndarray, block: FilteredBlock) -> np.ndarray:
    """Y of a block (N, channels), with identified drive gains where there are any."""
    motor = block.motor
    if columns.gain_columns and motor is not None:
        motor = motor * chi[[columns.gain_columns[k] for k in range(motor.shape[1])]]
    return columns.need.torque(motor, block.sensor)


def full_rate(streams: Sequence[RecordingStream], banks: Sequence[FilterBank], columns: Columns, chi: np.ndarray,
              progress: Progress = silent) -> FullRate:  # fmt: skip
    """One pass over all recordings."""
    above: dict[str, np.ndarray] = {}
    below: dict[str, np.ndarray] = {}
    curves = []
    total = sum(stream.survey.rows for stream in streams)
    done = 0
    for stream, bank in zip(streams, banks):
        n = len(columns.channels)
        above[stream.label], below[stream.label] = np.zeros(n), np.zeros(n)
        stride = max(1, int(stream.rate_hz / (CURVE_RATE * bank.position.cutoff_hz)),
                     -(-stream.survey.rows // CURVE_POINTS))  # fmt: skip
        kept: list[np.ndarray] = []
        for index, t, both in _compared(stream, bank, columns, chi):
            measured, modelled = both[:, :n], both[:, n:]
            above[stream.label] += np.sum((measured - modelled) ** 2, axis=0)
            below[stream.label] += np.sum(measured**2, axis=0)
            if kept and index != current:
                kept.append(np.full((1, 1 + 2 * n), np.nan))
            current = index
            kept.append(np.column_stack([t[::stride], both[::stride]]))
            done += len(t)
            progress("comparing at the full rate", min(done / total, 1.0))
        rows = np.concatenate(kept) if kept else np.zeros((0, 1 + 2 * n))
        curves.append(Curves(stream.label, stream.role, rows[:, 0], rows[:, 1 : 1 + n], rows[:, 1 + n :]))
    return FullRate(above, below, {stream.label: stream.role for stream in streams}, tuple(curves))


def _compared(stream: RecordingStream, bank: FilterBank, columns: Columns, chi: np.ndarray
              ) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:  # fmt: skip
    """(segment, t, [measured modelled] (N, 2 channels)) through the position filter."""
    segment, start = -1, 0.0
    pending: list[np.ndarray] = []

    def of_segment(blocks: Iterator[tuple[int, FilteredBlock]], first: FilteredBlock) -> Iterator[np.ndarray]:
        nonlocal following
        block: FilteredBlock | None = first
        while block is not None:
            yield np.hstack([measured_torque(columns, chi, block), modelled_torque(columns, chi, stream.payload, block)])
            item = next(blocks, None)
            if item is None or item[0] != segment:
                following = item
                return
            block = item[1]

    blocks = filter_stream(stream, bank)
    following = next(blocks, None)
    while following is not None:
        segment, first = following
        following = None
        start = float(first.t[0])
        yield from ((segment, start + (k + np.arange(len(values))) / stream.rate_hz, values)
                    for k, values in low_pass_blocks(of_segment(blocks, first), bank.position))  # fmt: skip
        pending.clear()


def low_pass_blocks(blocks: Iterator[np.ndarray], filter: LowPass) -> Iterator[tuple[int, np.ndarray]]:
    """Zero-phase filter of a stream of blocks (N, m): (number of the first row, filtered rows)."""
    for start, window, inner in windows(blocks, filter.halo):
        size = scipy.fft.next_fast_len(len(window), real=True)
        response = filter.response(scipy.fft.rfftfreq(size, 1.0 / filter.rate_hz))
        spectrum = scipy.fft.rfft(window, size, axis=0)
        yield start, scipy.fft.irfft(spectrum * response[:, None], size, axis=0)[inner]
