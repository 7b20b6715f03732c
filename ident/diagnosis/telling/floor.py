"""The noise of a channel, in percent of its rms torque on the fitted recordings, as the error is.

The floor is what is left of the error without all that is explained: by effects in the last fit, and where
more is told that has no name, by functions without a name, one after the other as long as fitted rows ask for
one. Slow noise is in it, and what these motions do not tell from noise. It is that of the samples which the
equations count: the error is of all, and where a joint rests friction is anything, which no model foretells.

The white noise is what no model of the motion could ever explain. Where the model's own torque has little
power against what is left, a model that is wrong by a fifth could not make what is left: that is noise,
whatever the model lacks. Below, where the robot moves, the noise is taken to be as dense as at the lowest of
such frequencies, and no denser than what is left. So it does not follow the residual; slow noise is
not in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy.signal

from ident.diagnosis.evidence.state import Found, solved
from ident.diagnosis.evidence.sufficiency import heard
from ident.diagnosis.left_over import chosen_by_chance
from ident.diagnosis.outcome import Outcome
from ident.diagnosis.rows.counted import counted
from ident.diagnosis.rows.rows import Rows
from ident.diagnosis.telling.findings import Finding, Unexplained
from ident.equations.comparison import Curves
from ident.estimation.fit import FitResult
from ident.signals.filtering import LowPass

WINDOW_S, WINDOWS = 2.0, 4
NEAR = 8  # lowest frequencies of noise alone that speak for those below
PASSED = 0.1  # of the position filter: where it lets less through, nothing can be read
LITTLE = (5.0, 25.0)  # power of the model's torque in that of what is left, where enough is so quiet: a fifth
# of that torque wrong makes a fifth of what is left, or all of it
MOVES = 0.9  # share of the torque's power about its mean that is taken for motion
FUNCTIONS = 6  # of a channel, at most


def noise_floor(
    last: FitResult,
    outcome: Outcome,
    told: Sequence[Finding | Unexplained],
    white: Mapping[str, float],
) -> dict[str, float]:
    """{channel: percent}; told: what is explained in part, or not at all; white: `white_noise` of the last
    fit, which what has no name does not move."""
    error, floor = last.full_rate_error["identify"], {}
    more = {f"{its.channel}{joint}": its for its in told for joint in its.joints}
    for c, name in enumerate(last.columns.channels):
        left = error.get(name, np.nan)
        if not np.isfinite(left):  # of a torque that reads 0 there is no share
            continue
        left *= _of_counted(last, outcome.last.rows, c)
        if (its := more.get(name)) is not None:
            left = min(left * np.sqrt(_left_by_functions(outcome, c, its)), white.get(name, np.inf))
        floor[name] = float(left)
    return floor


def _of_counted(last: FitResult, rows: Rows, c: int) -> float:
    """What a channel's samples that its rows count keep of the fitted runs' rms error: of all samples 1.0."""
    left, own = [], []
    for curve in last.errors.curves:
        if curve.role != "identify":
            continue
        left.append(curve.measured[:, c] - curve.modelled[:, c])
        own.append(counted(rows, curve, c))
    squares, counts = np.concatenate(left) ** 2, np.concatenate(own)
    known = np.isfinite(squares)
    if not (known & counts).any():
        return 1.0
    whole = float(np.mean(squares[known]))
    return float(np.sqrt(np.mean(squares[known & counts]) / whole)) if whole > 0 else 1.0


def _left_by_functions(outcome: Outcome, c: int, told: Finding | Unexplained) -> float:
    """The share of a channel's squares on the fitted rows that functions without a name leave; what was told
    of it where they say nothing (it oscillates, it is of a stretch)."""
    state, whole = outcome.last, outcome.last
    fitted = state.rows.fitted & state.rows.use[c]
    named = tuple(f for f in state.found if f.term is not None or c not in f.columns)
    if len(named) < len(state.found):
        whole = solved(replace(state, found=named))
    for _ in range(FUNCTIONS):
        flex, _ = heard(state, c, outcome.tau)
        if flex is None or flex.prior_evidence < chosen_by_chance(state, outcome.tau):
            break
        found = Found(None, {c: flex.column[:, None]}, np.ones(1), flex.variables)
        state = solved(state.plus(found))
    if state is whole:
        if isinstance(told, Unexplained) and told.depends_on:
            return 1.0 - told.share_of_residual_percent / 100.0
        return 1.0
    return float(np.mean(state.residual[c, fitted] ** 2) / np.mean(whole.residual[c, fitted] ** 2))


def white_noise(fit: FitResult) -> dict[str, float]:
    """{channel: percent}; without those of which it cannot be read."""
    settings = fit.study.filter
    C = len(fit.columns.channels)
    noise, power = np.zeros(C), np.zeros(C)
    known = np.ones(C, bool)
    streams = {stream.label: stream for stream in fit.recordings}
    for curve in fit.errors.curves:
        if curve.role != "identify" or len(curve.t) < 2:
            continue
        filter = LowPass(settings.position_cutoff_hz, streams[curve.label].rate_hz, settings.order)
        for c in range(C):
            density = white_noise_power(curve, c, filter)
            if density is None:
                known[c] = False
                continue
            seconds = np.isfinite(curve.measured[:, c]).sum()
            noise[c] += density * seconds
            power[c] += float(np.nanmean(curve.measured[:, c] ** 2)) * seconds
    names = fit.columns.channels
    return {
        name: float(100 * np.sqrt(noise[c] / power[c]))
        for c, name in enumerate(names)
        if known[c] and power[c] > 0
    }


def white_noise_power(curve: Curves, c: int, filter: LowPass) -> float | None:
    """Mean square of the white noise that the filter lets through; None where it cannot be read."""
    seconds = float(np.nanmedian(np.diff(curve.t)))
    size = int(WINDOW_S / seconds)
    if 1.0 / seconds < 2.2 * filter.cutoff_hz or size < 2 * NEAR:
        return None
    spectra, count = np.zeros((3, size // 2 + 1)), 0
    f = np.fft.rfftfreq(size, seconds)
    whole = np.isfinite(curve.t) & np.isfinite(curve.measured[:, c]) & np.isfinite(curve.modelled[:, c])
    for part in np.split(np.flatnonzero(whole), np.flatnonzero(np.diff(np.flatnonzero(whole)) > 1) + 1):
        if len(part) < size:
            continue
        measured, modelled = curve.measured[part, c], curve.modelled[part, c]
        three = np.stack([measured, modelled, measured - modelled])
        _, P = scipy.signal.welch(three, 1.0 / seconds, "hann", size, axis=1)
        n = 2 * (len(part) // size) - 1
        spectra, count = spectra + n * P, count + n
    if count < WINDOWS:
        return None
    P, M, E = spectra / count
    moving = f <= f[min(int(np.searchsorted(np.cumsum(P) / P.sum(), MOVES)), len(f) - 1)]
    passed = filter.response(f)
    for little in LITTLE:
        alone = np.flatnonzero((little * E > M) & ~moving & (passed > PASSED))
        if len(alone) >= NEAR:
            break
    else:
        return None
    density = float(np.median(E[alone[:NEAR]] / passed[alone[:NEAR]] ** 2))
    noisy = np.zeros(len(f), bool)
    noisy[alone] = True
    there = np.where(noisy | (passed <= PASSED), E, np.minimum(E, density * passed**2))
    return float(there.sum() * (f[1] - f[0]))
