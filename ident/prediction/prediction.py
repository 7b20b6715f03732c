"""A kept fit on a new log: predicted torque, its error, its 95 % band, and where the log leaves the band.

The new log goes the way of the fit's own recordings: the same filters, signs, weights and decimation. The
band at the log's rate holds 95 % of the errors that identify and validate runs had (no shape is assumed),
widened by the doubt that the parameters' covariance leaves for this motion. Whether a stretch leaves it is
decided on the decimated rows, where the noise model lives (excursions.py). Rows of a joint at rest are not
judged: friction is then anything between its limits. Of a log without torques (torque_free.py) nothing is
judged: torque and band are all there is.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ident.equations.build import observe
from ident.equations.comparison import Squares, low_pass_blocks, measured_torque, modelled_torque
from ident.equations.observation import RecordingSystem
from ident.errors import RecordingError
from ident.estimation.least_squares import weighted_factor
from ident.export.saved import SavedFit
from ident.prediction.excursions import own_worst, stretches
from ident.prediction.innovations import innovations
from ident.prediction.torque_free import TorqueFree, open_log
from ident.progress import Progress, silent
from ident.recordings.recording import RecordingStream
from ident.signals.filtering import FilterBank, FilteredBlock, filter_stream, prepare

ALPHA = 0.01  # probability that a clean log is told to leave the band
NORMAL = 1.959964  # 95 % of a normal distribution lie within
UNSEEN = 0.05  # of a column that the fit's motion could not tell from others
LASTING = 0.5  # share of a log's rows from which an excursion is lasting


@dataclass(frozen=True, slots=True)
class Excursion:
    """From `start` to `stop` [s of the log] an error is not the fit's; rms, mean and worst in N m [N]."""

    channel: str
    start: float
    stop: float
    rms: float
    mean: float
    worst: float
    times_usual: float  # rms over the standard deviation of the fit's noise
    strength: float
    kind: str  # "short", "lasting" or "to the end"


@dataclass(frozen=True, slots=True)
class Prediction:
    """What a log showed; the torques themselves come from `full_rate`, block by block."""

    fit: SavedFit
    stream: RecordingStream
    bank: FilterBank
    error_percent: dict[str, float]  # decimated, rows that count
    rms: dict[str, float]
    judged_percent: dict[str, float]  # of the decimated rows
    excursions: tuple[Excursion, ...]
    doubt_t: np.ndarray  # (m,) s
    doubt: np.ndarray  # (m, channels) N m: standard deviation that the parameters' covariance leaves
    used: np.ndarray  # (m, channels) bool: rows that are judged
    warnings: tuple[str, ...]

    @property
    def compared(self) -> bool:
        """Whether the log holds torques to compare with."""
        return not isinstance(self.stream, TorqueFree)

    def band(self, t: np.ndarray) -> np.ndarray:
        """Half width (N, channels) in N m of the 95 % band at times t (N,)."""
        doubt = np.column_stack([np.interp(t, self.doubt_t, column) for column in self.doubt.T])
        return np.sqrt(self.fit.spread**2 + (NORMAL * doubt) ** 2)

    def judged(self, t: np.ndarray) -> np.ndarray:
        """(N, channels) bool: whether the nearest decimated row of each time counts."""
        middle = (self.doubt_t[1:] + self.doubt_t[:-1]) / 2
        return self.used[np.searchsorted(middle, t)]

    def full_rate(self) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Blocks (t (N,), measured (N, C), predicted (N, C)), both behind the position filter."""
        n = len(self.fit.columns.channels)
        blocks = filter_stream(self.stream, self.bank)
        for _, group in itertools.groupby(blocks, key=lambda item: item[0]):
            begin: list[float] = []

            def torques() -> Iterator[np.ndarray]:
                for block, both in self._torques(block for _, block in group):  # noqa: B023
                    begin.append(float(block.t[0]))  # noqa: B023
                    yield both

            for k, both in low_pass_blocks(torques(), self.bank.position):
                t = begin[0] + (k + np.arange(len(both))) / self.stream.rate_hz
                yield t, both[:, :n], both[:, n:]

    def _torques(self, blocks: Iterable[FilteredBlock]) -> Iterator[tuple[FilteredBlock, np.ndarray]]:
        """Blocks of one stretch with [measured predicted] (N, 2 C), not filtered."""
        fit, payload = self.fit, self.stream.payload
        if not fit.terms:
            for block in blocks:
                measured = measured_torque(fit.columns, fit.chi, block)
                yield block, np.hstack([measured, modelled_torque(fit.columns, fit.chi, payload, block)])
            return
        from ident.equations.comparison import fitted_torques

        fitted = fit.fitted(_certain_from(self.stream, self.bank))
        for block, (measured,), (modelled,) in fitted_torques(fit.rigid, self.stream, blocks, [fitted]):
            yield block, np.hstack([measured, modelled])


def predict(
    fit: SavedFit,
    recording: str | Path,
    payload: str | None = None,
    progress: Progress = silent,
    episode: int | None = None,
) -> Prediction:
    """Predict a new log (or one of its episodes) with a kept fit.

    Raises RecordingError and what reading a recording raises.
    """
    study, columns = fit.study, fit.columns
    if payload is not None and payload not in study.payloads:
        known = ", ".join(study.payloads) or "none"
        raise RecordingError(str(recording), f"payload {payload} is not one that the fit knows ({known})")
    anew = {
        "use": "identify",
        "name": None,
        "from_s": None,
        "to_s": None,
        "episode": episode,
    }  # a study needs one; nothing is fitted
    entry = study.recordings[0].model_copy(
        update={**anew, "file": str(Path(recording).resolve()), "payload": payload}
    )
    one = study.with_(recordings=(entry,), payload_mass={})
    progress("reading the log")
    stream = open_log(one, entry, columns.need, columns.model.prismatic)
    bank = prepare(stream, one.filter, study.turn_overs)
    progress("predicting")
    system = observe(stream, bank, fit.rigid, fit.cutoff_hz, study.filter.order)
    measured = [segment.Y for segment in system.segments]
    if fit.terms:
        from ident.equations.attaching import attach

        model = fit.fitted(_certain_from(stream, bank)).model
        assert model is not None
        system = attach([system], {stream.label: (stream, bank)}, model, fit.terms, fit.cutoff_hz)[0]
    rhos = system.residuals(fit.chi)
    squares = Squares.empty(columns.channels, {stream.label: "test"})
    doubts, judged, rms = [], np.zeros(len(columns.channels)), np.zeros(len(columns.channels))
    excursions: list[Excursion] = []
    rows = sum(len(segment.t) for segment in system.segments)
    alpha = ALPHA / len(columns.channels) / len(system.segments)
    own = [own_worst([innovations(piece.rho[j], piece.used[j], noise) for piece in fit.residuals
                      if piece.role != "test"]) for j, noise in enumerate(fit.noises)]  # fmt: skip
    for segment, rho, Y in zip(system.segments, rhos, measured):
        squares.add(stream.label, Y.T, (Y - rho).T)
        doubt = np.zeros((len(segment.t), len(columns.channels)))
        for j, name in enumerate(columns.channels):
            W = system.dense(segment, j, len(fit.chi))
            doubt[:, j] = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", W, fit.covariance, W), 0))
            if isinstance(stream, TorqueFree):
                continue
            white = innovations(rho[j], segment.used[j], fit.noises[j], W)
            usual = float(np.sqrt(fit.noises[j].variance))
            for piece in stretches(white, fit.covariance, own[j], alpha):
                inside = np.arange(piece.first, piece.last + 1)
                inside = _trimmed(inside[segment.used[j][inside]], rho[j], NORMAL * usual)
                excursions.append(_excursion(name, segment.t, rho[j], inside, usual, piece.strength))
            judged[j] += segment.used[j].sum()
            rms[j] += np.sum(rho[j] ** 2)
        doubts.append((segment.t, doubt))
    compared = columns.channels if not isinstance(stream, TorqueFree) else ()
    return Prediction(
        fit, stream, bank, squares.by_recording()[stream.label] if compared else {},
        dict(zip(compared, np.sqrt(rms / np.maximum(judged, 1)).tolist())),
        dict(zip(compared, (100 * judged / max(rows, 1)).tolist())),
        tuple(sorted(excursions, key=lambda e: -e.strength)),
        np.concatenate([t for t, _ in doubts]), np.concatenate([d for _, d in doubts]),
        np.concatenate([segment.used.T for segment in system.segments]),
        (*stream.warnings, *_unseen(fit, system)),
    )  # fmt: skip


def _unseen(fit: SavedFit, system: RecordingSystem) -> list[str]:
    """Parameters that this log excites and the fit's motion did not: nothing is known of their torque."""
    b = len(fit.chi)
    own, new = fit.R[:, :b], weighted_factor(system.factors, fit.sigma, b)[:, :b]
    kept = np.flatnonzero(fit.full_active)
    out = []
    for k in np.flatnonzero(~fit.full_active):
        mix = np.linalg.lstsq(own[:, kept], own[:, k], rcond=None)[0]
        apart = np.linalg.norm(new[:, k] - new[:, kept] @ mix)
        if apart > UNSEEN * max(np.linalg.norm(new[:, k]), 1e-9 * np.linalg.norm(new)):
            out.append(fit.columns.parameters[k])
    if not out:
        return []
    return [f"this log excites {', '.join(out)}, the fit's motion did not: their torque is not predicted"]


def _certain_from(stream: RecordingStream, bank: FilterBank) -> dict[str, np.ndarray]:
    return {} if bank.vs is None else {stream.label: bank.vs}


def _trimmed(inside: np.ndarray, rho: np.ndarray, limit: float) -> np.ndarray:
    """The rows of a stretch from the first to the last whose error is beyond the band itself."""
    beyond = np.flatnonzero(np.abs(rho[inside]) > limit)
    return inside[beyond[0] : beyond[-1] + 1] if len(beyond) else inside


def _excursion(
    name: str, t: np.ndarray, rho: np.ndarray, inside: np.ndarray, usual: float, strength: float
) -> Excursion:
    error = rho[inside]
    half = (t[1] - t[0]) / 2 if len(t) > 1 else 0.0
    start, stop = float(t[inside[0]] - half), float(t[inside[-1]] + half)
    rms = float(np.sqrt(np.mean(error**2)))
    lasting = len(inside) >= LASTING * len(t)
    to_end = inside[-1] >= len(t) - 4 and len(inside) > 0.1 * len(t)
    kind = "lasting" if lasting else ("to the end" if to_end else "short")
    worst = float(error[np.argmax(np.abs(error))])
    return Excursion(name, start, stop, rms, float(error.mean()), worst, rms / usual, strength, kind)
