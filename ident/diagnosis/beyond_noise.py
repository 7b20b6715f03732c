"""What is left of a channel of which nothing was said, and is no noise all the same: an error far beyond
what noise and parameters make on the rows that judge, or one that oscillates of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg
import scipy.special

from ident.diagnosis.evidence import TOLERANCE
from ident.diagnosis.findings import Finding, Unexplained
from ident.diagnosis.oscillating import blocks, oscillation_says
from ident.diagnosis.pictures import picture
from ident.diagnosis.state import State
from ident.diagnosis.sufficiency import FORETOLD
from ident.diagnosis.unknown_turns import unknown_turns
from ident.estimation.fit import FitResult
from ident.signals.dry_friction import TurnOver
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
        own = noise * fitted.sum() / free
        expected = own + np.mean(_parameter_variance(last, state, c, judged))
        found = np.mean((state.residual[c] - _lasting(state, c, judged))[judged] ** 2)
        new, news = state.whiteners[c].sigma ** 2, state.whiteners[c].news
        by_chance = scipy.special.fdtri(news * judged.sum(), max(news * free, 1.0), 1 - BY_CHANCE)
        kind = last.columns.channels[c].rstrip("0123456789")
        most = FAR_OFF**2 * by_chance
        if found > most * expected and found > most * (own + np.mean(_beside_turns(state, c, judged))):
            share = 100.0 * float(1.0 - expected / found)
            out.append(Unexplained((joint,), kind, (), share, 0.0, None, False))
        elif noise * FORETOLD > new and _oscillates(last, state, c, fitted, judged) > tau:
            nats = 0.5 * float(fitted.sum()) * float(np.log(noise / new))
            share = 100.0 * float(1.0 - new / noise)
            shown = picture(state, None, c, ("t",))
            out.append(Unexplained((joint,), kind, ("t",), share, nats, None, False, shown))
    return tuple(out)


def _lasting(state: State, c: int, judged: np.ndarray) -> np.ndarray:
    """(M,) what a channel's residual has in common all through a run of judged rows: the slowest of all
    noise; of stretches of fitted runs none, whose own offset it is in."""
    out, run = np.zeros(len(judged)), state.rows.recording
    if state.rows.held_apart:
        for r in np.unique(run[judged]):
            out[run == r] = state.residual[c, judged & (run == r)].mean()
    return out


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


def _beside_turns(state: State, c: int, where: np.ndarray) -> np.ndarray:
    """(rows,) variance of a channel's model torque as the fitted rows determine it beside what is not known
    of turns, starts and stops; of what they do not determine as much as you like. (A joint that went one way
    there tells its dry friction from an offset by these alone, and was far off where it went the other.)"""
    m, joint = state.metric, state.model.channels[c].joint
    turns = unknown_turns(state.segments, joint, state.turns.get(joint, TurnOver()))
    turns = m.whiteners[c] @ (turns * state.rows.scale[c][:, None])
    gram, every = np.zeros((m.B, m.B)), np.zeros(m.B)
    for k, (places, values) in enumerate(m.X):
        on = m.fitted.mask & state.rows.use[k]
        X = values[on]
        every[places] += np.sum(values[state.rows.usable & state.rows.use[k]] ** 2, axis=0)
        if k == c:
            T = scipy.linalg.orth(turns[on])
            X = X - T @ (T.T @ X)
        gram[np.ix_(places, places)] += X.T @ X
    d = np.sqrt(np.maximum(every, 1e-300))
    s, V = np.linalg.eigh(gram / np.outer(d, d))
    places, values = state.rows.base[c]
    own = values[where] @ (V / np.sqrt(np.maximum(s, TOLERANCE * s[-1])) / d[:, None])[places]
    return np.asarray(np.sum(own**2, axis=1))


def _uncertain(last: FitResult, state: State, c: int) -> tuple[np.ndarray, np.ndarray]:
    """A channel's columns (M, k) of W and the covariance (k, k) of their parameters, for coloured noise."""
    places, values = state.rows.base[c]
    mine = places < len(last.full_covariance)
    return values[:, mine], last.full_covariance[np.ix_(places[mine], places[mine])]
