"""Filtered signals at a finer rate than the equations' rows, and columns made of them put on those rows.

A candidate column (what some effect would add to a torque) is made where the motion is still whole, at the
fine rate, and only then decimated: a column of sign(dq) that is decimated is not the sign of a decimated dq.
`decimate` gives each fine sample the weight that the equations' own decimation gives that sample, so that a
column passed through it stands beside the equations' columns at the same instants.

Memory: 8 (1 + 5 n + C) bytes for each fine sample of n joints and C channels, half of that for recordings
that are long: 7 joints at 200 Hz are 4 MB a minute, an hour is 120 MB.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ident.equations.columns import Columns
from ident.equations.observation import DecimatedSegment, RecordingSystem
from ident.equations.prepared import Prepared
from ident.recordings.recording import RecordingStream
from ident.signals.decimation import folded, kept_every, means_about
from ident.signals.filtering import FilteredBlock, LowPass

LEAST_HZ = 200.0  # of the fine rate
PER_CUTOFF = 25.0  # fine samples a second and Hz of cut-off
LONG = 400_000  # fine samples of a recording held in double precision


@dataclass(frozen=True, slots=True)
class FineSegment:
    """One uninterrupted stretch: every `stride`-th filtered sample and the rows it belongs to.

    t (N,) s, q, dq, ddq, sign, certain (N, n), torque (N, C) Y as recorded, uniform at rate_hz; certain and
    torque are means over the stride. vs (n,) the speed from which a sign is certain. number (N,) counts the
    stretch's samples at the recording's own rate; rows are the equations' decimated rows of the same stretch.
    """

    recording: str
    role: str
    payload: str | None
    index: int
    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    sign: np.ndarray
    certain: np.ndarray
    torque: np.ndarray
    vs: np.ndarray
    rate_hz: float
    number: np.ndarray
    filter: LowPass
    every: int
    joint_of: np.ndarray
    rows: DecimatedSegment


class FineKeeper:
    """An observer of `build` that keeps strided blocks; `segments` joins them to the systems built."""

    def __init__(self, prepared: Prepared, cutoff_hz: float, rate_hz: float | None = None) -> None:
        self.columns: Columns = prepared.columns
        self.order, self.cutoff_hz = prepared.study.filter.order, cutoff_hz
        self.rate_hz = rate_hz or max(LEAST_HZ, PER_CUTOFF * cutoff_hz)
        self.streams: dict[str, RecordingStream] = {}
        self.blocks: dict[tuple[str, int], list[tuple[np.ndarray, ...]]] = {}
        self.vs: dict[str, np.ndarray] = {}
        self.seen: dict[tuple[str, int], int] = {}

    def __call__(self, stream: RecordingStream, index: int, block: FilteredBlock) -> None:
        key, stride = (stream.label, index), self.stride(stream)
        self.streams[stream.label], self.vs[stream.label] = stream, block.vs
        seen = self.seen.get(key, 0)
        self.seen[key] = seen + len(block.t)
        pick = slice(-seen % stride, None, stride)
        at = np.arange(len(block.t))[pick]
        kind = np.float64 if stream.survey.rows / stride < LONG else np.float32
        parts = [part[pick] for part in (block.q, block.dq, block.ddq, block.sign_dq)]
        parts += [means_about(x, at, stride) for x in (block.certain, self.columns.torque(block))]
        kept = tuple(part.astype(kind) for part in parts)
        self.blocks.setdefault(key, []).append((block.t[pick], *kept, seen + at))

    def stride(self, stream: RecordingStream) -> int:
        return max(1, int(stream.rate_hz / self.rate_hz + 1e-9))

    def segments(self, systems: Sequence[RecordingSystem]) -> dict[str, tuple[FineSegment, ...]]:
        """{recording: its stretches}, those that have rows; what was kept is handed over."""
        out = {}
        for system in systems:
            out[system.label] = tuple(
                self._segment((system.label, rows.index), rows) for rows in system.segments
            )
        return out

    def _segment(self, key: tuple[str, int], rows: DecimatedSegment) -> FineSegment:
        stream = self.streams[key[0]]
        t, q, dq, ddq, sign, certain, torque, number = (
            np.concatenate(parts) for parts in zip(*self.blocks.pop(key))
        )
        return FineSegment(
            recording=stream.label,
            role=stream.role,
            payload=stream.payload,
            index=key[1],
            t=t,
            q=q,
            dq=dq,
            ddq=ddq,
            sign=sign,
            certain=certain,
            torque=torque,
            vs=self.vs[stream.label],
            rate_hz=stream.rate_hz / self.stride(stream),
            number=number,
            filter=LowPass(self.cutoff_hz, stream.rate_hz, self.order),
            every=kept_every(self.cutoff_hz, stream.rate_hz),
            joint_of=self.columns.joint_of,
            rows=rows,
        )


def decimate(fine: FineSegment, columns: np.ndarray, channel: int | None = None) -> np.ndarray:
    """Columns (N, k) made of a stretch's fine signals -> (m, k) at the instants of its rows.

    For a channel its samples weigh as they do in the channel's rows (`certain`), and rows that do not count
    are zero; None weighs all alike.
    """
    if channel is None:
        return folded(columns, fine.number, fine.filter, fine.every, len(fine.rows.t))
    weighted = columns * fine.certain[:, fine.joint_of[channel], None]
    out = folded(weighted, fine.number, fine.filter, fine.every, len(fine.rows.t))
    return np.asarray(out * fine.rows.used[channel][:, None])
