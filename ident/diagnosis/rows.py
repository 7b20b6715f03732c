"""Residual rows: torque and every column pass the same zero-phase low-pass and are kept at nearly
independent instants.

    recording --zero-phase position filter, central differences--> fine signals (about 250 Hz)
              --model columns and candidate columns at 250 Hz--> banded low-pass product
              --> rows (about 2.5 x cut-off)

Nonlinear columns and gates are evaluated before the low-pass: a column gated after filtering has edges that
look like events. The low-pass is a windowed sinc sampled at any fractional offset, so a delayed channel is
the same product with shifted taps.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.interpolate
import scipy.signal
import scipy.sparse

from ident.diagnosis.errors import DiagnosisError

FINE_HZ = 250.0
ROW_CUTOFF_HZ = 10.0
ROWS_PER_CUTOFF = 2.5
REST_SECONDS = 0.1  # the stops between point-to-point moves are short, and friction is undetermined in them
MIN_SEGMENT_SECONDS = 1.0


@dataclass(frozen=True, slots=True)
class TurnOver:
    """How dry friction changes sign: within a rate (tanh, rad/s) or within a travel (Dahl, rad)."""

    law: str  # rate | travel
    value: float


@dataclass(frozen=True, slots=True)
class Fine:
    """Signals of all runs one after the other at the fine rate. Angles rad, joint side."""

    t: np.ndarray  # (N,) s since the first sample of the run
    q: np.ndarray  # (N, n)
    dq: np.ndarray  # (N, n)
    ddq: np.ndarray  # (N, n)
    sign: np.ndarray  # (N, n) by turn_over
    run: np.ndarray  # (N,) number of the run
    pieces: tuple[slice, ...]  # segments without a gap
    step: float  # s, between samples
    velocity_noise: np.ndarray  # (runs, n) rad/s
    position_noise: np.ndarray  # (n,) rad, standard deviation of the white part before filtering
    sign_width: np.ndarray  # (n,) rad/s
    turn_over: tuple[TurnOver, ...]  # of each joint's sign


@dataclass(frozen=True, slots=True)
class RowFilter:
    """The low-pass at the kept instants: `apply(columns (N, k)) -> (M, k)`."""

    centres: np.ndarray  # (M,) indices into the fine signals
    cutoff_hz: float
    step: float  # s
    half: int  # taps on each side
    size: int  # N

    def matrix(self, delay: float = 0.0) -> scipy.sparse.csr_array:
        """(M, N): row m holds the taps around centre m, of the signal `delay` seconds earlier."""
        offsets = np.arange(-self.half, self.half + 1)
        taps = _lowpass_taps(offsets + delay / self.step, self.cutoff_hz * self.step, self.half)
        M = len(self.centres)
        columns = np.clip(self.centres[:, None] + offsets[None, :], 0, self.size - 1)
        indptr = np.arange(0, M * len(offsets) + 1, len(offsets))
        values = np.broadcast_to(taps, columns.shape).ravel()
        return scipy.sparse.csr_array((values, columns.ravel(), indptr), shape=(M, self.size))


@dataclass(frozen=True, slots=True)
class RunInfo:
    """One run as the diagnosis sees it."""

    label: str
    role: str  # identify | validate | test
    payload: str | None
    duration: float  # s
    start: float  # s, first time stamp of the recording


@dataclass(frozen=True, slots=True)
class Rows:
    """Everything at the kept instants, channel by channel."""

    fine: Fine
    filter: RowFilter
    low_pass: scipy.sparse.csr_array  # (M, N)
    runs: tuple[RunInfo, ...]
    run: np.ndarray  # (M,)
    t: np.ndarray  # (M,)
    y: np.ndarray  # (channels, M) N m
    y_fine: np.ndarray  # (channels, N) N m, only anti-aliased
    keep: np.ndarray  # (channels, M) bool: the joint moves, friction is determined
    channels: tuple[str, ...]
    notes: tuple[str, ...] = ()
    memo: dict = field(default_factory=dict, compare=False)  # what depends on the motion alone

    def of_role(self, role: str) -> np.ndarray:
        """(M,) True where the row belongs to a run with this role."""
        runs = [i for i, r in enumerate(self.runs) if r.role == role]
        return np.isin(self.run, runs)


def _lowpass_taps(offsets: np.ndarray, cutoff: float, half: int) -> np.ndarray:
    """Windowed sinc (Kaiser, beta 5: 53 dB) with cut-off in cycles per sample, unit gain at rest."""
    inside = np.clip(1.0 - (offsets / (half + 1.0)) ** 2, 0.0, None)
    taps = np.sinc(2.0 * cutoff * offsets) * np.i0(5.0 * np.sqrt(inside)) / np.i0(5.0)
    return taps / taps.sum()


def _zero_phase(x: np.ndarray, cutoff_hz: float, rate_hz: float, order: int = 4) -> np.ndarray:
    if cutoff_hz >= 0.45 * rate_hz:
        return x
    sos = scipy.signal.butter(order, cutoff_hz, fs=rate_hz, output="sos")
    pad = min(len(x) - 1, int(2 * rate_hz / cutoff_hz))
    return scipy.signal.sosfiltfilt(sos, x, axis=0, padlen=pad)


def _split(t: np.ndarray) -> list[slice]:
    """Segments without a gap of more than ten typical steps."""
    steps = np.diff(t)
    typical = float(np.median(steps))
    cuts = np.flatnonzero((steps > max(10 * typical, 0.1)) | (steps <= 0)) + 1
    edges = [0, *cuts.tolist(), len(t)]
    return [slice(a, b) for a, b in itertools.pairwise(edges) if t[b - 1] - t[a] >= MIN_SEGMENT_SECONDS]


def row_cutoff(rate_hz: float, position_cutoff_hz: float | None = None) -> float:
    """Hz. 10 for a fast log, a 24th of the rate for a slow one; never above the study's own position cut-
    off."""
    return min(ROW_CUTOFF_HZ, rate_hz / 24.0, position_cutoff_hz or np.inf)


def _white_noise(q: np.ndarray) -> np.ndarray:
    """Standard deviation of the white part of each column, from fourth differences (a motion's vanish)."""
    if len(q) < 50:
        return np.zeros(q.shape[1])
    d = np.diff(q, 4, axis=0)
    return np.sqrt(np.mean(d * d, axis=0) / 70.0)


def build_rows(
    recordings: Sequence,
    channels: tuple[str, ...],
    position_cutoff_hz: float | None = None,
    sign_width: np.ndarray | float | None = None,
) -> Rows:
    """Rows of all recordings. `recordings` have label, role, payload, t (N,), q (N, n), tau_m, tau_l (N, n)
    | None.

    Raises DiagnosisError when nothing long enough without a gap is left.
    """
    rates = [1.0 / float(np.median(np.diff(r.t))) for r in recordings]
    rate = min(rates)
    cutoff = row_cutoff(rate, position_cutoff_hz)
    fine_rate = min(FINE_HZ, max(50.0 * cutoff, 4 * cutoff))
    step = 1.0 / fine_rate
    n = recordings[0].q.shape[1]
    parts: list[dict] = []
    noise, position_noise = np.zeros((len(recordings), n)), np.zeros(n)
    infos = []
    for number, (r, r_rate) in enumerate(zip(recordings, rates)):
        t0 = float(r.t[0])
        infos.append(RunInfo(r.label, r.role, r.payload, float(r.t[-1] - t0), t0))
        measured = measured_channels(r, channels)
        levels = []
        for piece in _split(r.t):
            part, level, white = _fine_piece(r.t[piece], r.q[piece], measured[piece], r_rate, cutoff, step)
            part["run"] = np.full(len(part["t"]), number)
            part["t"] = part["t"] - t0
            parts.append(part)
            levels.append(level)
            position_noise = np.maximum(position_noise, white)
        if levels:
            noise[number] = np.max(levels, axis=0)
    if not parts:
        raise DiagnosisError(
            f"no recording holds {MIN_SEGMENT_SECONDS:g} s without a gap; check the time stamps."
        )
    edges = np.cumsum([0] + [len(p["t"]) for p in parts])
    pieces = tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(edges))
    joined = {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}
    if sign_width is None:
        sign_width = np.maximum(5.0 * noise.max(axis=0), 2e-3)
    width = np.broadcast_to(np.asarray(sign_width, dtype=float), (n,)).copy()
    fine = Fine(
        joined["t"],
        joined["q"],
        joined["dq"],
        joined["ddq"],
        np.tanh(joined["dq"] / width),
        joined["run"],
        pieces,
        step,
        noise,
        position_noise,
        width,
        tuple(TurnOver("rate", float(w)) for w in width),
    )
    half = int(np.ceil(2.4 / (cutoff * step)))
    hop = 1.0 / (ROWS_PER_CUTOFF * cutoff)
    centres = []
    for piece in pieces:
        first, last = piece.start + half, piece.stop - half - 1
        if last > first:
            count = int((last - first) * step / hop) + 1
            centres.append(np.round(first + np.arange(count) * hop / step).astype(int))
    if not centres:
        raise DiagnosisError("the recordings are shorter than the filter; give longer runs.")
    centre = np.concatenate(centres)
    row_filter = RowFilter(centre, cutoff, step, half, len(fine.t))
    low_pass = row_filter.matrix()
    y_fine = np.ascontiguousarray(joined["y"].T)
    y = np.ascontiguousarray((low_pass @ joined["y"]).T)
    return Rows(
        fine,
        row_filter,
        low_pass,
        tuple(infos),
        fine.run[centre],
        fine.t[centre],
        y,
        y_fine,
        _moving(fine, centre, channels),
        channels,
    )


def measured_channels(recording, channels: tuple[str, ...]) -> np.ndarray:
    """(N, channels) torque of the named channels; tau_d is tau_m - tau_l."""
    columns = []
    for name in channels:
        kind, joint = name[:5], int(name[5:]) - 1
        if kind == "tau_d":
            columns.append(recording.tau_m[:, joint] - recording.tau_l[:, joint])
        else:
            source = recording.tau_m if kind == "tau_m" else recording.tau_l
            if source is None:
                raise DiagnosisError(f"{recording.label} has no {kind}; the model needs it.")
            columns.append(source[:, joint])
    return np.stack(columns, axis=1)


def _fine_piece(t, q, y, rate, cutoff, step) -> tuple[dict, np.ndarray, np.ndarray]:
    """Signals of one segment at the fine rate, and the standard deviations of its velocity noise and of the
    white noise of its positions, (n,) each."""
    steps = np.diff(t)
    uniform = np.max(np.abs(steps - 1.0 / rate)) < 0.02 / rate
    factor = rate * step
    prefilter = min(4.0 * cutoff, rate / 8.0)
    work_rate = rate
    if not uniform or factor < 0.999:  # resample (cubic for positions, linear for torque) before filtering
        work_rate = (1.0 / step) * max(1, round(rate * step))
        grid = np.arange(t[0], t[-1], 1.0 / work_rate)
        q = scipy.interpolate.make_interp_spline(t, q, k=3)(grid)
        y = np.stack([np.interp(grid, t, c) for c in y.T], axis=1)
        t = grid
    sigma = _white_noise(q) if uniform else np.full(q.shape[1], 3e-5)
    q = _zero_phase(q, prefilter, work_rate)
    dq = np.gradient(q, 1.0 / work_rate, axis=0)
    ddq = np.gradient(dq, 1.0 / work_rate, axis=0)
    y = _zero_phase(y, min(8.0 * cutoff, 0.4 / step), work_rate)
    ratio = work_rate * step
    if abs(ratio - round(ratio)) > 1e-6:
        grid = np.arange(t[0], t[-1], step)
        both = scipy.interpolate.make_interp_spline(t, np.hstack([q, dq, ddq, y]), k=3)(grid)
        n = q.shape[1]
        q, dq, ddq, y = both[:, :n], both[:, n : 2 * n], both[:, 2 * n : 3 * n], both[:, 3 * n :]
        t = grid
    else:
        hop = round(ratio)
        t, q, dq, ddq, y = t[::hop], q[::hop], dq[::hop], ddq[::hop], y[::hop]
    level = sigma * 2 * np.pi * prefilter / np.sqrt(3.0) * np.sqrt(prefilter / (0.5 * rate))
    return {"t": t, "q": q, "dq": dq, "ddq": ddq, "y": y}, level, sigma


def _moving(fine: Fine, centres: np.ndarray, channels: tuple[str, ...]) -> np.ndarray:
    """(channels, M) False where the channel's joint stands still for a while: its friction is undetermined
    there."""
    noise = fine.velocity_noise.max(axis=0)
    slow = np.maximum(3.0 * noise, 0.01 * np.abs(fine.dq).max(axis=0))
    rest = np.abs(fine.dq) < slow
    window = max(1, int(REST_SECONDS / fine.step))
    keep = np.ones((len(channels), len(centres)), dtype=bool)
    for c, name in enumerate(channels):
        joint = int(name[5:]) - 1
        for piece in fine.pieces:
            still = _long_runs(rest[piece, joint], window)
            grown = np.convolve(still, np.ones(2 * (window // 4) + 1), mode="same") > 0
            inside = (centres >= piece.start) & (centres < piece.stop)
            keep[c, inside] = ~grown[centres[inside] - piece.start]
        if keep[c].mean() < 0.2:
            keep[c] = True
    return keep


def _long_runs(flag: np.ndarray, length: int) -> np.ndarray:
    """True where `flag` holds for at least `length` samples in a row."""
    padded = np.concatenate([[False], flag, [False]])
    change = np.flatnonzero(np.diff(padded.astype(int)))
    out = np.zeros(len(flag), dtype=float)
    for a, b in zip(change[::2], change[1::2]):
        if b - a >= length:
            out[a:b] = 1.0
    return out
