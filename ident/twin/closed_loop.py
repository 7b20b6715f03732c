"""A robot under its controller, simulated: forward dynamics of the compiled model, SciPy's LSODA.

    M(q) ddq = u - h(q, dq),   u = kp (q_r - q) + kd (dq_r - dq) + ki integral(q_r - q)

M and h come from the inverse dynamics of base parameters alone: h is the torque at no acceleration, column i
of M what a unit acceleration of joint i adds to it, so one call of n + 1 rows gives both (Walker and Orin,
ASME J. Dyn. Syst. Meas. Control 104, 1982). Gains are told in N m/rad, or by the bandwidth that the loop
shall keep: kp = J w^2, kd = 2 z w J with J the simulated robot's own inertia, the rule by which IDIM-IV and
DIDIM keep the simulated loop's bandwidth while parameters change (Gautier, Janot and Vandanjon, IEEE Trans.
Control Syst. Technol. 21, 2013). A computed torque whose model is the plant follows its reference exactly,
so nothing is integrated for it. Units: rad, s, N m (m and N on slides).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ident.errors import IdentError

Array = np.ndarray
Torque = Callable[[Array, Array, Array, Array], Array]  # q, dq, ddq, sign (N, n) -> (N, n)
STEEPNESS = 2.5  # of friction's turn-over: tanh(2.5 dq / width), as in the filtered sign
POSTURES = 200  # at which the mass matrix is looked at
CHUNK = 4096  # states whose accelerations are computed together
FAR = 10.0  # times the reference's range: a loop that goes there is not followed further


class LoopError(IdentError):
    """A loop that cannot be simulated; one sentence."""


@dataclass(frozen=True, slots=True)
class Plant:
    """Inverse dynamics of one parameter vector; width (n,): speed within which friction turns over."""

    torque: Torque
    width: Array

    def sign(self, dq: Array) -> Array:
        return np.tanh(STEEPNESS * dq / self.width)

    def mass_and_rest(self, q: Array, dq: Array) -> tuple[Array, Array]:
        """M (n, n) and h (n,) at q, dq (n,)."""
        M, h = self.masses_and_rests(q[None], dq[None])
        return M[0], h[0]

    def masses_and_rests(self, q: Array, dq: Array) -> tuple[Array, Array]:
        """M (N, n, n) and h (N, n) at q, dq (N, n)."""
        N, n = q.shape
        ddq = np.zeros((N, n + 1, n))
        ddq[:, np.arange(1, n + 1), np.arange(n)] = 1.0
        rows = [np.repeat(x, n + 1, axis=0) for x in (q, dq, self.sign(dq))]
        tau = self.torque(rows[0], rows[1], ddq.reshape(-1, n), rows[2]).reshape(N, n + 1, n)
        return (tau[:, 1:] - tau[:, :1]).transpose(0, 2, 1), tau[:, 0]

    def acceleration(self, q: Array, dq: Array, tau: Array) -> Array:
        """(N, n) of states q, dq (N, n) under motor torques tau (N, n)."""
        M, h = self.masses_and_rests(q, dq)
        return np.linalg.solve(M, (tau - h)[:, :, None])[:, :, 0]

    def inertia(self, q: Array) -> Array:
        """(n,) mean diagonal of M over postures q (N, n). Raises LoopError where M is not positive."""
        some = q[:: max(len(q) // POSTURES, 1)]
        masses, _ = self.masses_and_rests(some, np.zeros_like(some))
        least = np.linalg.eigvalsh((masses + masses.transpose(0, 2, 1)) / 2)[:, 0]
        if not least.min() > 0:
            raise LoopError(
                "these parameters give the robot a mass that is not positive, so its loop cannot be "
                "simulated; lower filter.position_cutoff_hz, fit runs that move every joint faster, or write "
                "estimator: wls"
            )
        return np.asarray(np.diagonal(masses, axis1=1, axis2=2).mean(axis=0))


@dataclass(frozen=True, slots=True)
class Gains:
    """kp, kd, ki (n,) in N m/rad, N m s/rad, N m/(rad s)."""

    kp: Array
    kd: Array
    ki: Array

    @classmethod
    def of_bandwidth(cls, inertia: Array, hz: Array, damping: float, integral_hz: float = 0.0) -> Gains:
        """Gains that give each joint, with this inertia alone, the bandwidth [Hz] and damping [-]."""
        w = 2 * np.pi * hz
        kp = inertia * w**2
        return cls(kp, 2 * damping * w * inertia, 2 * np.pi * integral_hz * kp)


@dataclass(frozen=True, slots=True)
class Motion:
    """Uniform samples of a motion: t (N,), q, dq, ddq (N, n); between them cubic in q and dq."""

    t: Array
    q: Array
    dq: Array
    ddq: Array

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """q, dq, ddq (N', n) at instants inside it (its ends beyond them)."""
        step = (self.t[-1] - self.t[0]) / (len(self.t) - 1)
        place = np.clip((t - self.t[0]) / step, 0.0, len(self.t) - 1.0)
        k = np.minimum(place.astype(int), len(self.t) - 2)
        s = (place - k)[:, None]
        ddq = self.ddq[k] + s * (self.ddq[k + 1] - self.ddq[k])
        return _hermite(self.q, self.dq, k, s, step), _hermite(self.dq, self.ddq, k, s, step), ddq


def _hermite(x: Array, dx: Array, k: Array | int, s: Array | float, step: float) -> Array:
    ahead = x[k + 1] - x[k]
    bent = (1 - s) * (step * dx[k] - ahead) + s * (ahead - step * dx[k + 1])
    return np.asarray(x[k] + s * ahead + s * (1 - s) * bent)


def follow(plant: Plant, gains: Gains, reference: Motion, rtol: float = 1e-6) -> tuple[Motion, Array]:
    """The motion (at the reference's instants) of a plant that begins at rest on its reference, and u (N, n).

    Raises LoopError where the loop is unstable or the integrator gives up.
    """
    from scipy.integrate import solve_ivp

    t, n = reference.t, reference.q.shape[1]
    step = (t[-1] - t[0]) / (len(t) - 1)
    bound = FAR * np.maximum(np.ptp(reference.q, axis=0), 0.1)

    def wanted(now: float) -> tuple[Array, Array]:
        place = min(max((now - t[0]) / step, 0.0), len(t) - 1.0)
        k = min(int(place), len(t) - 2)
        s = place - k
        return (
            _hermite(reference.q, reference.dq, k, s, step),
            _hermite(reference.dq, reference.ddq, k, s, step),
        )

    def many(now: float, X: Array) -> Array:
        """Rates (N, 3 n) of states (N, 3 n) at one instant."""
        q, dq, z = X[:, :n], X[:, n : 2 * n], X[:, 2 * n :]
        q_r, dq_r = wanted(now)
        error = q_r - q
        u = gains.kp * error + gains.kd * (dq_r - dq) + gains.ki * z
        return np.hstack([dq, plant.acceleration(q, dq, u), error])

    def rates(now: float, x: Array) -> Array:
        return many(now, x[None])[0]

    def jacobian(now: float, x: Array) -> Array:
        """By differences, all columns in one call of the model; the integral's are known."""
        rise = 1e-6 * np.maximum(np.abs(x[: 2 * n]), 0.1)
        found = many(now, np.vstack([x, x + np.eye(2 * n, 3 * n) * rise[:, None]]))
        out = np.zeros((3 * n, 3 * n))
        out[:, : 2 * n] = ((found[1:] - found[0]) / rise[:, None]).T
        if gains.ki.any():
            out[n : 2 * n, 2 * n :] = np.linalg.inv(plant.mass_and_rest(x[:n], x[n : 2 * n])[0]) * gains.ki
        return out

    def escaped(now: float, x: Array) -> float:
        return float(np.min(bound - np.abs(x[:n] - wanted(now)[0])))

    escaped.terminal = True  # type: ignore[attr-defined]
    q0, dq0 = wanted(t[0])
    held = plant.mass_and_rest(q0, dq0)[1]  # the integrator of a loop at rest carries gravity
    z0 = np.where(gains.ki > 0, held / np.where(gains.ki > 0, gains.ki, 1.0), 0.0)
    try:
        done = solve_ivp(
            rates,
            (t[0], t[-1]),
            np.concatenate([q0, dq0, z0]),
            method="LSODA",
            jac=jacobian,
            t_eval=t,
            rtol=rtol,
            atol=rtol * 1e-2,
            events=escaped,
        )
    except (ValueError, np.linalg.LinAlgError):
        done = None
    if done is None or done.status != 0 or not np.isfinite(done.y).all():
        raise LoopError(
            "the simulated loop does not follow its reference; write the controller's own gains or a lower "
            "bandwidth_hz, or write estimator: wls"
        )
    q, dq, z = done.y[:n].T, done.y[n : 2 * n].T, done.y[2 * n :].T
    u = gains.kp * (reference.q - q) + gains.kd * (reference.dq - dq) + gains.ki * z
    ddq = np.vstack([plant.acceleration(q[k : k + CHUNK], dq[k : k + CHUNK], u[k : k + CHUNK])
                     for k in range(0, len(q), CHUNK)])  # fmt: skip
    return Motion(t, q, dq, ddq), u
