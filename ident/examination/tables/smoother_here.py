"""Torques that are far smoother in one recording than in all others: filtered or smoothed there alone.

Noise goes with a sensor and its logger. What smooths one run takes from its torques what is fast, and makes
them late where it looks back; positions of the run stay as they are. (Of a rokae whose second torque was
behind a filter of 1 Hz in the run that judges 9.7 % were left for 3.3, of a UR10e whose fitted run was
smoothed 6.4 for 4.8, and nothing was said. Of eleven arms as they are a torque has a third of its noise in
the other runs, at least, or a fifth.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.tables.signals import MOVED
from ident.recordings.recording import RecordingStream, raw_blocks

LEAST, ROWS = 100, 16_000  # of a recording
LESS = 0.05  # of a torque's noise in every other recording, in its unit and as a share of its deviation
ALIKE = 1.2  # times the least rate
OTHERS = 2  # recordings at least: of two one may be noisy


def smoother_here(streams: Sequence[RecordingStream], currents: bool) -> Iterator[Check]:
    """Not of signals of which a recording's own checks say more, nor of recordings of several rates."""
    rates = [stream.rate_hz for stream in streams]
    if len(streams) <= OTHERS or max(rates) > ALIKE * min(rates):
        return
    noise, share = (np.stack(its) for its in zip(*(_noise(stream) for stream in streams)))
    names = _names(streams[0], currents)
    for r, stream in enumerate(streams):
        told = {name for check in stream.checks for name in check.signals}
        less = np.full(noise.shape[1], True)
        for its in (noise, share):
            others = np.delete(its, r, axis=0).min(axis=0)
            less &= (its[r] > 0) & (its[r] < LESS * others)
        which = [c for c in np.flatnonzero(less) if names[c] not in told]
        if which:
            part = float((noise[r] / np.delete(noise, r, axis=0).min(axis=0))[which].max())
            said = listed(names[c] for c in which)
            yield Check(
                "smoothed_torque",
                tuple(names[c] for c in which),
                f"{said} {'is' if len(which) == 1 else 'are'} far smoother than in the other recordings "
                f"(noise of {100 * part:.1g} % of theirs at most): filtered or smoothed here alone, which "
                "takes away what is fast, and makes late what a filter looks back for",
                "log torques alike in all recordings",
                recording=stream.label,
            )


def _noise(stream: RecordingStream) -> tuple[np.ndarray, np.ndarray]:
    """(C,) of a recording's torques: what their third differences show, and its share of their deviation; 0
    where their joints hardly move."""
    n, parts, rows = len(stream.need.joints), list[np.ndarray](), 0
    for _, _, values in raw_blocks(stream):
        parts.append(values)
        rows += len(values)
        if rows >= ROWS:
            break
    values = np.concatenate(parts)[:ROWS]
    values = values[np.isfinite(values).all(axis=1)]
    if len(values) < LEAST:
        return np.zeros(values.shape[1] - n), np.zeros(values.shape[1] - n)
    moves = np.ptp(values[:, stream.signal_joints[n:]], axis=0) > MOVED
    torques = values[:, n:]
    with np.errstate(over="ignore", invalid="ignore"):  # a logger's marks may be as large as numbers get
        noise = np.where(moves, np.median(np.abs(np.diff(torques, 3, axis=0)), axis=0), 0.0)
        return noise, noise / np.maximum(np.std(torques, axis=0), 1e-300)


def _names(stream: RecordingStream, currents: bool) -> list[str]:
    """(C,) of its torques' signals."""
    labels, need = [str(joint) for joint in stream.need.joints], stream.need
    motor = [f"{'i' if currents else 'tau_m'}{labels[j]}" for j in need.motor]
    return [*motor, *(f"tau_l{labels[j]}" for j in need.sensor)]
