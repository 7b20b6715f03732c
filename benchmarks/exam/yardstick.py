"""Weighted least squares of the rigid model with Pinocchio's regressor: sizes the effects, gives the oracle.

Rows are taken at 25 Hz after a 10 Hz zero-phase filter, so that they are nearly independent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy import linalg, signal

from benchmarks.exam import robots

CUTOFF_HZ = 10.0
ROWS_HZ = 25.0


@dataclass(frozen=True, slots=True)
class Layout:
    """Which channels and which of the paper's own columns a study's model has."""

    model: str  # A, B, C, D
    without: tuple[str, ...]


def smooth(x: np.ndarray, rate: float) -> np.ndarray:
    sos = signal.butter(4, CUTOFF_HZ, fs=rate, output="sos")
    return signal.sosfiltfilt(sos, x, axis=0)


def kept_rows(count: int, rate: float) -> np.ndarray:
    """Instants that are compared: every 1/25 s, half a second away from the ends."""
    return np.arange(int(0.5 * rate), count - int(0.5 * rate), max(1, round(rate / ROWS_HZ)))


def measured_torque(layout: Layout, tau_m: np.ndarray, tau_l: np.ndarray) -> np.ndarray:
    """(N, channels) in the order of the study's model."""
    match layout.model:
        case "A":
            return tau_m
        case "B":
            return tau_l
        case "C":
            return np.hstack([tau_m, tau_l])
    return tau_m - tau_l


def motion(q: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Filtered position with central differences."""
    q = smooth(q, rate)
    dq = np.gradient(q, 1 / rate, axis=0)
    return q, dq, np.gradient(dq, 1 / rate, axis=0)


def columns(
    model: pin.Model, layout: Layout, rate: float, motor_q: np.ndarray, link_q: np.ndarray | None = None
) -> np.ndarray:
    """(rows, channels, p) of all standard columns at the kept rows; dependent columns are left in."""
    n = model.nv
    q, dq, ddq = motion(motor_q, rate)
    rows = kept_rows(len(q), rate)
    sign = smooth(np.tanh(dq / 5e-3), rate)[rows]
    ql, dql, ddql = (q, dq, ddq) if link_q is None else motion(link_q, rate)
    inertial = robots.regressor(model, ql[rows], dql[rows], ddql[rows])
    ddq, dq, dql = ddq[rows], dq[rows], dql[rows]

    def diagonal(values: np.ndarray) -> np.ndarray:
        return np.einsum("ij,jk->ijk", values, np.eye(n))

    def friction(speed: np.ndarray) -> list[np.ndarray]:
        kept = []
        if "viscous_friction" not in layout.without:
            kept.append(diagonal(speed))
        if "coulomb_friction" not in layout.without:
            kept.append(diagonal(sign))
        if "offset" not in layout.without:
            kept.append(diagonal(np.ones_like(speed)))
        return kept

    rotor = [] if "rotor_inertia" in layout.without else [diagonal(ddq)]
    drive = np.concatenate([np.zeros((len(rows), n, 0)), *rotor, *friction(dq)], axis=2)
    link = np.concatenate([inertial, *friction(dql)], axis=2)
    match layout.model:
        case "A":
            return np.concatenate([inertial, drive], axis=2)
        case "B":
            return link
        case "C":
            below = np.concatenate([link, np.zeros_like(drive)], axis=2)
            return np.concatenate([np.concatenate([link, drive], axis=2), below], axis=1)
    return drive


def base_columns(W: np.ndarray) -> np.ndarray:
    """Indices of independent columns by pivoted QR of a thinned W."""
    thinned = W[:: max(1, len(W) // 600)]
    flat = thinned.reshape(-1, W.shape[2])
    scale = np.linalg.norm(flat, axis=0)
    scale[scale == 0] = 1.0
    R, pivot = linalg.qr(flat / scale, mode="r", pivoting=True)[:2]
    size = np.abs(np.diag(R))
    return np.sort(pivot[: int(np.sum(size > 1e-7 * size[0]))])


@dataclass(slots=True)
class Yardstick:
    """The rigid model's column space on the identify runs, weighted by channel noise."""

    Q: np.ndarray
    weight: np.ndarray  # (channels,)
    shape: tuple[int, int]

    @classmethod
    def of(cls, W: np.ndarray, weight: np.ndarray) -> Yardstick:
        scaled = (W * weight[None, :, None]).reshape(-1, W.shape[2])
        norms = np.linalg.norm(scaled, axis=0)
        keep = norms > 1e-12 * norms.max()
        return cls(np.linalg.qr(scaled[:, keep] / norms[keep])[0], weight, W.shape[:2])

    def residual(self, Y: np.ndarray) -> np.ndarray:
        """(rows, channels) in the units of Y."""
        y = (Y * self.weight).ravel()
        return (y - self.Q @ (self.Q.T @ y)).reshape(self.shape) / self.weight

    def error_percent(self, Y: np.ndarray) -> np.ndarray:
        return 100 * np.linalg.norm(self.residual(Y), axis=0) / np.linalg.norm(Y, axis=0)


def predict(W: np.ndarray, Y: np.ndarray, weight: np.ndarray, W_new: np.ndarray) -> np.ndarray:
    """Torque on new rows of the weighted fit of Y on W."""
    scaled = (W * weight[None, :, None]).reshape(-1, W.shape[2])
    chi = np.linalg.lstsq(scaled, (Y * weight).ravel(), rcond=1e-10)[0]
    return W_new @ chi
