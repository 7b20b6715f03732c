"""Whether a series changed, at a stated rate of false alarms: recursive residuals in a two-sided CUSUM.

    y_k = x_k' beta + e_k,  var e_k = s^2 v_k        each y_k predicted from those before it alone
    w_k = (y_k - x_k' b_{k-1}) / sqrt(v_k + x_k' P_{k-1} x_k)     independent while nothing changes
                                                     (Brown, Durbin and Evans, J. R. Stat. Soc. B 37, 1975)
    z_k = normal score of Student's t of w_k over the spread of those before   (Hawkins, Technometrics 1987)
    C_k = max(0, C_{k-1} +- z_k - 1/2),  alarm at C_k > h

Prediction from the past alone makes z_k standard normal however short the past, so a run's length without a
change is Siegmund's (Ann. Stat. 13, 1985), and h follows from the rate. |z| counts for at most 4: one bad
day is no change. Charts go on learning while they rise: pausing then made many times the false alarms that
were asked for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

SLACK = 0.5  # half the shift, in standard deviations, that is found soonest
MOST = 4.0  # of one score
LEAST = 8  # observations beyond the regressors before the first score
WEAK = 1e4  # variance of what is not known yet, over that of one observation


def threshold(run_length: float) -> float:
    """h of a one-sided CUSUM of standard normals with this mean run length L without a change.

    2 k^2 L = e^u - u - 1, u = 2 k (h + 1.166), k the slack.
    """
    most = 2 * SLACK**2 * max(run_length, 2.0)
    u = 0.0
    for _ in range(60):  # a contraction: its slope is 1 / (u + 1 + most), at most a half
        u = math.log(u + 1 + most)
    return max(u / (2 * SLACK) - 1.166, 0.0)


def delay(limit: float, shift: float) -> float:
    """Observations until a one-sided CUSUM with this threshold sees a step of `shift` standard deviations,
    in the mean and after a long past (Siegmund, as above): a short one goes on learning from the step.

    (e^(-2 m b) + 2 m b - 1) / (2 m^2), m = shift - k, b = h + 1.166.
    """
    b, m = limit + 1.166, shift - SLACK
    return b**2 if m == 0 else (math.exp(-2 * m * b) + 2 * m * b - 1) / (2 * m**2)


@dataclass(frozen=True, slots=True)
class Charts:
    """B charts over K instants: level (K, B) of the larger side, sign (K, B) of that side, since (K, B) the
    instant after which it has not been zero, score (K, B) z, NaN where there is none."""

    level: np.ndarray
    sign: np.ndarray
    since: np.ndarray
    score: np.ndarray


def _scores(t: np.ndarray, free: np.ndarray) -> np.ndarray:
    """(B,) normal scores of Student's t with `free` degrees of freedom."""
    import scipy.special  # from the first day that is judged on

    tail = scipy.special.stdtr(np.maximum(free, 1), -np.abs(t))
    return np.clip(-np.sign(t) * scipy.special.ndtri(np.maximum(tail, 1e-300)), -MOST, MOST)


def charts(y: np.ndarray, x: np.ndarray, v: np.ndarray) -> Charts:
    """y (K, B), NaN where there is no observation; x (K, B, q) regressors, v (K, B) relative variances."""
    K, B, q = x.shape
    beta, P = np.zeros((B, q)), np.tile(np.eye(q) * WEAK, (B, 1, 1))
    squares, seen, learned = np.zeros(B), np.zeros(B, int), np.zeros(B, int)
    up, down = np.zeros(B), np.zeros(B)
    up_from, down_from = np.zeros(B, int), np.zeros(B, int)
    out = Charts(np.zeros((K, B)), np.zeros((K, B)), np.zeros((K, B), int), np.full((K, B), np.nan))
    for k in range(K):
        there = np.isfinite(y[k]) & np.isfinite(v[k]) & (v[k] > 0) & np.isfinite(x[k]).all(axis=1)
        row = np.where(there[:, None], x[k], 0.0)
        variance = np.where(there, v[k], 1.0)
        Px = np.einsum("bij,bj->bi", P, row)
        spread = variance + np.einsum("bi,bi->b", row, Px)
        error = np.where(there, y[k], 0.0) - np.einsum("bi,bi->b", row, beta)
        w = error / np.sqrt(spread)
        s = np.sqrt(np.maximum(squares, 1e-300) / np.maximum(learned, 1))
        scored = there & (learned >= LEAST)
        z = np.where(scored, _scores(w / s, learned), 0.0) if scored.any() else np.zeros(B)
        up, down = np.maximum(up + z - SLACK * scored, 0), np.maximum(down - z - SLACK * scored, 0)
        up_from, down_from = np.where(up == 0, k, up_from), np.where(down == 0, k, down_from)
        out.level[k], out.sign[k] = np.maximum(up, down), np.where(up >= down, 1, -1)
        out.since[k] = np.where(up >= down, up_from, down_from) + 1
        out.score[k] = np.where(scored, z, np.nan)
        gain = np.where(there[:, None], Px / spread[:, None], 0.0)
        beta = beta + gain * error[:, None]
        P = P - gain[:, :, None] * Px[:, None, :]
        counted = there & (seen >= q)
        squares += np.where(counted, np.where(scored, np.minimum(w**2, (MOST * s) ** 2), w**2), 0.0)
        learned, seen = learned + counted, seen + there
    return out
