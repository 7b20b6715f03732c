"""The cut-off of the decimation filter by the Durbin-Watson rule (paper 3.3).

dw must lie between 1 and 3, best at 2; a low cut-off brings it there and takes the robot's dynamics with it.
The compromise made here: of the candidates whose |dw - 2| is within `TOLERANCE` of the best one's, the
highest cut-off is taken, as it keeps most of the dynamics. Residuals hardly depend on the cut-off through
chi, so all candidates are judged on the residual of one first fit, decimated once for each of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ident.equations.comparison import Fitted, fitted_torques
from ident.equations.prepared import Prepared
from ident.estimation.noise import durbin_watson
from ident.progress import Progress, silent
from ident.recordings.recording import RecordingStream
from ident.recordings.study import Study
from ident.signals.decimation import Decimator, kept_every
from ident.signals.filtering import LowPass, filter_stream
from ident.signals.neighbours import by_segment, first_samples

TOLERANCE = 0.15  # of |dw - 2|: below it candidates count as equally good
CANDIDATES = (0.25, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 20.0, 40.0)  # Hz
ROWS_PER_PARAMETER = 10.0  # fewer, and dw near 2 comes from having fitted away the dynamics
EXCERPT_S = 30.0  # of each recording


@dataclass(frozen=True, slots=True)
class CutoffTrial:
    """One candidate: its cut-off, the dw of its residuals, the rows it leaves."""

    cutoff_hz: float
    durbin_watson: float
    rows: int


def candidates(streams: Sequence[RecordingStream], study: Study, b: int) -> list[float]:
    """Cut-offs that leave enough rows and stay below the position filter's half."""
    fitted = [stream for stream in streams if stream.role == "identify"]
    seconds = sum(s.move_end - s.move_start for stream in fitted for s in stream.survey.segments)
    n_channels = len(fitted[0].need.channels)
    least = ROWS_PER_PARAMETER * b / (n_channels * 2.5 * max(seconds, 1e-9))
    highest = min(0.5 * study.filter.position_cutoff_hz, 0.2 * min(stream.rate_hz for stream in streams))
    found = [cutoff for cutoff in CANDIDATES if least <= cutoff <= highest]
    return found or [min(highest, max(least, 0.25))]


def first_cutoff(streams: Sequence[RecordingStream], study: Study, b: int) -> float:
    """Where to begin: the candidate nearest to a twelfth of the position cut-off, the paper's 0.8 for 10
    Hz."""
    return min(
        candidates(streams, study, b), key=lambda c: abs(np.log(c / (0.08 * study.filter.position_cutoff_hz)))
    )


def excerpt_seconds(cutoff_hz: float, channels: int, b: int) -> float:
    """Seconds of each recording on which the choice is made: EXCERPT_S, or what b parameters need."""
    return max(EXCERPT_S, ROWS_PER_PARAMETER * b / (channels * 2.5 * cutoff_hz))


def choose_cutoff(
    prepared: Prepared,
    fitted: Fitted,
    excerpt_s: float,
    progress: Progress = silent,
) -> tuple[float, tuple[CutoffTrial, ...]]:
    """Judge every candidate on the residual of a fit over an excerpt. -> the choice and all trials."""
    study = prepared.study
    cutoffs = candidates(prepared.streams, study, len(prepared.columns.parameters))
    sequences: dict[float, list[np.ndarray]] = {cutoff: [] for cutoff in cutoffs}
    progress("choosing the decimation cut-off")
    for stream, bank in zip(prepared.streams, prepared.banks):
        if stream.role != "identify":
            continue
        blocks = first_samples(filter_stream(stream, bank), int(excerpt_s * stream.rate_hz))
        for _, its in by_segment(blocks):
            count = len(prepared.columns.channels)
            folds = {cutoff: _decimator(cutoff, stream, study, count) for cutoff in cutoffs}
            parts: dict[float, list[np.ndarray]] = {cutoff: [] for cutoff in cutoffs}
            for block, measured, modelled in fitted_torques(prepared.columns, stream, its, (fitted,)):
                rho = (measured[0] - modelled[0]) * block.certain[:, prepared.columns.joint_of]
                for cutoff, fold in folds.items():
                    done = fold.push(np.ascontiguousarray(rho.T))
                    if done is not None:
                        parts[cutoff].append(done)
            for cutoff, fold in folds.items():
                sequences[cutoff].append(np.hstack([*parts[cutoff], fold.finish()]))
    trials = tuple(_trial(cutoff, sequences[cutoff]) for cutoff in cutoffs)
    fair = [trial for trial in trials if 1 <= trial.durbin_watson <= 3] or list(trials)
    best = min(abs(trial.durbin_watson - 2) for trial in fair)
    good = [trial for trial in fair if abs(trial.durbin_watson - 2) <= best + TOLERANCE]
    return max(trial.cutoff_hz for trial in good), trials


def _decimator(cutoff: float, stream: RecordingStream, study: Study, rows: int) -> Decimator:
    return Decimator(
        LowPass(cutoff, stream.rate_hz, study.filter.order), kept_every(cutoff, stream.rate_hz), rows
    )


def _trial(cutoff: float, sequences: list[np.ndarray]) -> CutoffTrial:
    """dw of residuals divided by each channel's rms."""
    joined = np.hstack(sequences)
    rms = np.maximum(np.sqrt(np.mean(joined**2, axis=1, keepdims=True)), 1e-300)
    return CutoffTrial(cutoff, durbin_watson([rho / rms for rho in sequences]), joined.size)
