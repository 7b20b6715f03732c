"""Filtered signals at a rate fine enough to make columns of, and columns put on the equations' rows.

A candidate column is made where the motion is still whole and only then decimated: a column of sign(dq)
that is decimated is not the sign of a decimated dq. Kept is every s-th sample of a stretch, s a divisor of
the distance of its rows, so the impulse response of the equations' own decimation, sampled at s, puts a
column on the very instants of the rows (each row rescaled to unit gain, as there).

Memory: 8 (1 + 6 n + C) bytes for each fine sample of n joints and C channels, half of that for stretches that
are long. An hour of 7 joints at 200 Hz would be 290 MB: where only parts of long recordings are looked at
they wait on disk, until it is known which."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ident.equations.columns import Columns
from ident.equations.observation import RecordingSystem
from ident.equations.prepared import Prepared
from ident.equations.spilled import SpilledRows, Spool, joined
from ident.recordings.recording import RecordingStream
from ident.signals.decimation import FINE_HZ, at_most, kept_every, means_about, response_terms
from ident.signals.filtering import FilteredBlock, LowPass
from modelgen.geometry.place import Motion

LONG = 400_000  # fine samples of a stretch that is held in double precision
TAIL = 1e-5  # of the impulse response's peak
SIGNALS = 8  # decimated at a time
FRAME = 12  # rows of one product


@dataclass(frozen=True, slots=True)
class Cut:
    """Rows of one stretch of one recording: systems[system].segments[segment], rows start to stop."""

    system: int
    segment: int
    start: int
    stop: int


@dataclass(frozen=True, slots=True)
class FineSegment:
    """One uninterrupted stretch of a recording. N fine samples, n joints, C channels.

    recording: the number of its system; t (N,) [s] of the recording's own time, begun (s): the recording's
    first; q, dq, ddq, sign_dq (N, n), speed (N, n) whose sign it is, certain (N, n) 0..1, the mean of the
    samples about each, measured (N, C) Y as recorded (a mean of it has no steps where friction turns over: a
    TX40's torques that all came 20 ms late were then told of no delay); rate_hz of the fine samples; every:
    fine samples from one row to the next; vs (n,) the speed from which a sign is certain;
    path (N, n) the positions along which memories go on, where these are not q; before (k, n) the same on the
    way to the first sample."""

    recording: int
    label: str
    payload: str | None
    begun: float
    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    sign_dq: np.ndarray
    speed: np.ndarray
    certain: np.ndarray
    measured: np.ndarray
    rate_hz: float
    filter: LowPass
    every: int
    vs: np.ndarray
    path: np.ndarray | None = None
    before: np.ndarray | None = None

    @property
    def rows(self) -> int:
        return len(self.t) // self.every

    @property
    def taps(self) -> np.ndarray:
        """(L,) of the filter between fine samples and rows."""
        return _taps(self.filter)

    @property
    def motion(self) -> Motion:
        """The stretch as effects see it."""
        moving, measured = (self.q, self.dq, self.ddq, self.sign_dq), (self.measured, self.rate_hz)
        went = (self.before, self.path)
        return Motion(self.label, self.payload, self.t - self.begun, *moving, *measured, *went)

    def decimate(self, columns: np.ndarray, joint: int | None = None) -> np.ndarray:
        """(N, k), weighted by a joint's certainty as its rows are -> (rows, k)."""
        weight = None if joint is None else self.certain[:, joint]
        made = _strided(self.filter, columns, self.every, weight)
        made /= _unit(self.filter, self.every, len(columns))[:, None]
        return made


@lru_cache(maxsize=16)
def _taps(filter: LowPass) -> np.ndarray:
    p, c, d = response_terms(filter)
    length = int(np.ceil(np.log(TAIL) / np.log(np.abs(p).max())))
    n = np.abs(np.arange(-length, length + 1))
    h = (p[None, :] ** n[:, None] @ c).real
    h[length] += d
    return h


@lru_cache(maxsize=16)
def _frame(filter: LowPass, every: int) -> np.ndarray:
    """(W, FRAME): what W samples on end add to FRAME rows on end, the taps once for each row."""
    taps = _taps(filter)
    out = np.zeros(((FRAME - 1) * every + len(taps), FRAME))
    for row in range(FRAME):
        out[row * every : row * every + len(taps), row] = taps
    return out


@lru_cache(maxsize=256)
def _unit(filter: LowPass, every: int, length: int) -> np.ndarray:
    """What becomes of ones: the gain that is left near the ends."""
    return _strided(filter, np.ones((length, 1)), every)[:, 0]


def _strided(filter: LowPass, x: np.ndarray, every: int, weight: np.ndarray | None = None) -> np.ndarray:
    """(N, k), samples weighted (N,) -> (N // every, k): convolution with symmetric taps (L,), at every
    so-manieth sample alone.

    FRAME rows at a time are one matrix product of the samples that reach them. Frames overlap; every c-th
    one does not, so c views of the same samples hold them all and nothing is copied."""
    frame, half = _frame(filter, every), len(_taps(filter)) // 2
    width, hop = len(frame), FRAME * every
    rows, views = len(x) // every, -(-width // hop)
    count = -(-rows // (FRAME * views))  # frames of a view
    before = half - (every - 1)  # zeros ahead of the first sample; negative: samples that no row reaches
    ahead = max(before, 0)
    padded = np.zeros((min(SIGNALS, x.shape[1]), (count + 1) * views * hop))
    reach = slice(max(-before, 0), max(-before, 0) + padded.shape[1] - ahead)
    x, weight = x[reach], np.ones(1) if weight is None else weight[reach]
    one, step = padded.strides
    out = np.empty((rows, x.shape[1]))
    for begin in range(0, x.shape[1], SIGNALS):
        part = x[:, begin : begin + SIGNALS].T
        np.multiply(part, weight, out=padded[: len(part), ahead : ahead + len(x)])
        shape, strides = (views, len(part), count, width), (hop * step, one, views * hop * step, step)
        made = np.lib.stride_tricks.as_strided(padded, shape, strides, writeable=False) @ frame
        out[:, begin : begin + SIGNALS] = made.transpose(2, 0, 3, 1).reshape(-1, len(part))[:rows]
    return out


class FineKeeper:
    """An observer of `equations.build` that keeps strided samples of every block, on disk where they are
    many; least_hz: of the fine rate."""

    def __init__(
        self, columns: Columns, cutoff_hz: float, order: int, on_disk: bool = False, least_hz: float = FINE_HZ
    ) -> None:
        self.columns, self.cutoff_hz, self.order, self.least_hz = columns, cutoff_hz, order, least_hz
        self.t: dict[tuple[str, int], list[np.ndarray]] = {}
        self.parts: dict[tuple[str, int], list[np.ndarray | SpilledRows]] = {}
        self.streams: dict[str, RecordingStream] = {}
        self.seen: dict[tuple[str, int], int] = {}
        self.vs: dict[str, np.ndarray] = {}
        self.before: dict[tuple[str, int], np.ndarray] = {}
        self.spool = Spool() if on_disk else None

    def __call__(self, stream: RecordingStream, index: int, block: FilteredBlock) -> None:
        key, (_, step) = (stream.label, index), self._steps(stream)
        seen = self.seen.get(key, 0)
        pick = slice((step - 1 - seen) % step, None, step)
        self.seen[key] = seen + len(block.t)
        if key not in self.before and block.before is not None:  # copied: a view would hold its whole window
            self.before[key] = block.before[::-step][::-1].copy()
        self.streams[stream.label], self.vs[stream.label] = stream, block.vs
        speed = block.dq if block.speed is None else block.speed
        signals = [part[pick].T for part in (block.q, block.dq, block.ddq, block.sign_dq, speed)]
        # at a turn it falls and rises within few samples: one of them taken for all puts rows 6 % off
        certain = means_about(block.certain, np.arange(len(block.t))[pick], step)
        signals += [certain.T, self.columns.torque(block)[pick].T]
        signals += [] if block.path is None else [block.path[pick].T]
        kind = np.float64 if stream.survey.rows / step < LONG else np.float32
        kept = np.vstack(signals).astype(kind)
        self.t.setdefault(key, []).append(block.t[pick].copy())
        self.parts.setdefault(key, []).append(kept if self.spool is None else self.spool.append(kept))

    def segments(
        self, systems: Sequence[RecordingSystem], cuts: Sequence[Cut] | None = None
    ) -> tuple[FineSegment, ...]:
        """One a cut, in the order of the cuts; None: of every stretch that has rows. What was kept is handed
        over."""
        whole = (
            Cut(k, s, 0, len(rows.t)) for k, its in enumerate(systems) for s, rows in enumerate(its.segments)
        )
        return tuple(self._segment(systems[cut.system], cut) for cut in (whole if cuts is None else cuts))

    def _segment(self, system: RecordingSystem, cut: Cut) -> FineSegment:
        key, stream = (system.label, system.segments[cut.segment].index), self.streams[system.label]
        every, step = self._steps(stream)
        t, whole = np.concatenate(self.t[key]), joined(self.parts[key])
        self.t[key], self.parts[key] = [t], [whole]
        each = every // step
        pick = slice(cut.start * each, len(t) if cut.stop >= len(t) // each else cut.stop * each)
        n = len(self.columns.need.joints)
        C = len(self.columns.channels)
        ends = [*(np.arange(1, 7) * n), 6 * n + C]
        kind = np.float64 if len(t[pick]) < LONG else np.float32
        q, dq, ddq, sign, speed, certain, measured, path = (
            np.array(part.T, kind, order="C") for part in np.split(whole[:, pick], ends)
        )
        return FineSegment(
            cut.system,
            stream.label,
            stream.payload,
            stream.survey.segments[0].start,
            t[pick].copy(),
            q,
            dq,
            ddq,
            sign,
            speed,
            certain,
            measured,
            stream.rate_hz / step,
            LowPass(self.cutoff_hz, stream.rate_hz / step, self.order),
            each,
            self.vs[stream.label],
            path if path.size else None,
            None if cut.start else self.before.get(key),
        )

    def _steps(self, stream: RecordingStream) -> tuple[int, int]:
        """Samples from one row to the next, and from one fine sample to the next."""
        every = kept_every(self.cutoff_hz, stream.rate_hz)
        return every, stride_of(every, stream.rate_hz, self.least_hz)


def bytes_of(prepared: Prepared, cutoff_hz: float) -> float:
    """What the fine signals of a study take in double precision."""
    wide = 1 + 6 * len(prepared.columns.need.joints) + len(prepared.columns.channels)
    return sum(
        8 * wide * stream.survey.rows / stride_of(kept_every(cutoff_hz, stream.rate_hz), stream.rate_hz)
        for stream in prepared.streams
    )


def stride_of(every: int, rate_hz: float, least_hz: float = FINE_HZ) -> int:
    """The largest divisor of `every` that leaves about such a rate."""
    most = min(every, at_most(rate_hz, least_hz))
    return next(s for s in range(most, 0, -1) if every % s == 0)
