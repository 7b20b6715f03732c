"""What is left of a channel of which nothing was said, and is no noise all the same: an error far beyond
what noise and parameters make on the rows that judge, or one that oscillates of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.special

from ident.diagnosis.findings import Finding, Unexplained
from ident.diagnosis.oscillating import blocks, oscillation_says
from ident.diagnosis.pictures import picture
from ident.diagnosis.state import State
from ident.diagnosis.sufficiency import FORETOLD
from ident.estimation.fit import FitResult
from ident.signals.filtering import prepare

BY_CHANCE = 1e-3  # that so few fitted rows show so little noise; of many it is none
FAR_OFF = 3.0  # times what noise and parameters explain: an error of judged rows that is no noise


def beyond_noise(
    last: FitResult, state: State, findings: Sequence[Finding], told: Sequence[Unexplained], tau: float
) -> tuple[Unexplained, ...]:
    """Channels of which nothing was said, and whose residual is no noise all the same: its error on the rows
    that judge is far beyond what noise and the parameters' uncertainty make there, or it oscillates of its
    own, foretold by its past (a vibration, a slosh). What only wanders is what slow noise does."""
    known = {joint for f in findings for joint in f.joints} | {joint for u in told for joint in u.joints}
    everywhere = any(not f.joints for f in findings)
    rows, out = state.rows, []
    for c, channel in enumerate(last.columns.need.channels):
        joint = last.columns.need.joints[channel.joint]
        fitted, judged = (side & rows.use[c] for side in (rows.fitted, rows.judged))
        if joint in known or everywhere or not fitted.any() or not judged.any():
            continue
        noise, free = np.mean(state.residual[c, fitted] ** 2), float(state.metric.fitted.free[c])
        expected = noise * fitted.sum() / free + np.mean(_parameter_variance(last, state, c, judged))
        found = np.mean(state.residual[c, judged] ** 2)
        new, news = state.whiteners[c].sigma ** 2, state.whiteners[c].news
        by_chance = scipy.special.fdtri(news * judged.sum(), max(news * free, 1.0), 1 - BY_CHANCE)
        kind = last.columns.channels[c].rstrip("0123456789")
        if found > FAR_OFF**2 * by_chance * expected:
            share = 100.0 * float(1.0 - expected / found)
            out.append(Unexplained((joint,), kind, (), share, 0.0, None, False))
        elif noise * FORETOLD > new and _oscillates(last, state, c, fitted, judged) > tau:
            nats = 0.5 * float(fitted.sum()) * float(np.log(noise / new))
            share = 100.0 * float(1.0 - new / noise)
            shown = picture(state, None, c, ("t",))
            out.append(Unexplained((joint,), kind, ("t",), share, nats, None, False, shown))
    return tuple(out)


def _oscillates(last: FitResult, state: State, c: int, fitted: np.ndarray, judged: np.ndarray) -> float:
    """log E of an oscillation of a channel's residual."""
    values, rows = state.design[0][c][1], state.rows
    learned, asked = (blocks(rows, state.residual[c], side, values) for side in (fitted, judged))
    banks = [bank for stream in last.recordings if (bank := prepare(stream, last.study.filter)).lowest]
    of_joints = zip(*([position for position, _ in bank.filters] for bank in banks))
    lowest = [min(its, key=lambda filter: filter.cutoff_hz) for its in of_joints]
    in_steps = [its for its in lowest if its.cutoff_hz < last.study.filter.position_cutoff_hz]
    return oscillation_says(rows.hop, learned, asked, in_steps)


def _parameter_variance(last: FitResult, state: State, c: int, where: np.ndarray) -> np.ndarray:
    """(rows,) variance of a channel's model torque: from the fit's covariance for coloured noise, or of the
    parameters as the fitted rows alone determine them, where that is more. (Of an arm slower than 20 mrad/s
    26 rows were left.)"""
    X, C = _uncertain(last, state, c)
    places, values = state.rows.base[c]
    own = values[where] @ state.metric.fitted.basis[places]  # whitened rows have unit variance
    return np.asarray(np.maximum(np.einsum("ij,jk,ik->i", X[where], C, X[where]), np.sum(own**2, axis=1)))


def _uncertain(last: FitResult, state: State, c: int) -> tuple[np.ndarray, np.ndarray]:
    """A channel's columns (M, k) of W and the covariance (k, k) of their parameters, for coloured noise."""
    places, values = state.rows.base[c]
    mine = places < len(last.full_covariance)
    return values[:, mine], last.full_covariance[np.ix_(places[mine], places[mine])]
