"""How much a motion tells of the base parameters, as one number and its exact gradient.

Rows A of the observation matrix are divided by the noise of their channel, M = A'A. Criteria, all minimised:

    balanced     d, and a little of condition: what the ellipsoid's volume leaves open makes it rounder
    d            -log det M / b: the volume of the confidence ellipsoid, whatever the parameters' units
    condition    of A with columns of unit length, its extreme singular values by p-norms, which are smooth
    worst        largest std of a parameter relative to its value, by a p-norm
    bodies       condition of the columns of the bodies alone, in SI units as they are and whatever the noise

dV/dA follows in closed form; through W it goes by CasADi's reverse mode over the model's own function. The
sign of the rate is tanh(dq/v) here, since a design needs a slope.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

import generated
from ident.excitation.motion import Basis

Array = np.ndarray
Criterion = Callable[[Array], tuple[float, Array]]
CRITERIA = ("balanced", "d", "condition", "worst", "bodies")
POWER = 12
ROUNDER = 0.2  # of log condition beside log det per parameter: costs less of it than another seed does


class Rows:
    """Weighted rows of a model along a motion, and the way back from dV/dA to the states."""

    def __init__(self, model: generated.Model, sigma: Array, turn_over: Array) -> None:
        """sigma (C,): noise of each channel; turn_over (n,): v of each joint."""
        self.model, self.sigma, self.v = model, sigma, turn_over
        self._many: dict[int, Any] = {}
        self._many_torques: dict[int, Any] = {}

    def __call__(self, q: Array, dq: Array, ddq: Array) -> Array:
        """A (N, C, b)."""
        return self.model.regressor(q, dq, ddq, sign=np.tanh(dq / self.v)) / self.sigma[:, None]

    def back(self, q: Array, dq: Array, ddq: Array, slope: Array) -> tuple[Array, Array, Array]:
        """dV/dq, dV/ddq, dV/dddq, each (N, n), of dV/dA (N, C, b)."""
        N, C, b = slope.shape
        slope = slope / self.sigma[:, None]
        flat = slope.transpose(1, 0, 2).reshape(C, N * b)
        found = self._reverse(N)(q.T, dq.T, ddq.T, flat)
        gq, gdq, gddq = (np.array(part).T for part in found)
        flank = (1 - np.tanh(dq / self.v) ** 2) / self.v
        for joint, entries in enumerate(self._signs):
            gdq[:, joint] += flank[:, joint] * (slope * entries).sum(axis=(1, 2))
        return gq, gdq, gddq

    def back_through_torque(
        self, q: Array, dq: Array, ddq: Array, weight: Array, d: Array
    ) -> tuple[Array, Array, Array]:
        """The same of dV/dA = weight (N, C) times d (b,), which goes back through the torque of d: of W only
        what is asked for."""
        weight = weight / self.sigma
        N = len(weight)
        if N not in self._many_torques:
            self._many_torques[N] = self._one_torque.map(N)
        found = self._many_torques[N](q.T, dq.T, ddq.T, np.repeat(d[:, None], N, axis=1), weight.T)
        gq, gdq, gddq = (np.array(part).T for part in found)
        flank = (1 - np.tanh(dq / self.v) ** 2) / self.v
        return gq, gdq + flank * (weight @ (self._signs @ d).T), gddq

    @cached_property
    def _signs(self) -> Array:
        """(n, C, b): dW / d sign of each joint."""
        n = self.model.n
        state, one = np.full((n, n), 0.3), np.eye(n)
        up, down = (self.model.regressor(state, state, state, sign=s) for s in (one, -one))
        return (up - down) / 2

    @cached_property
    def _one(self) -> Any:
        import casadi as ca

        n, shape = self.model.n, (len(self.model.channels), len(self.model.parameters))
        states = [ca.SX.sym(name, n) for name in ("q", "dq", "ddq")]
        slope = ca.SX.sym("slope", *shape)
        value = ca.sum1(ca.sum2(self.model.casadi("regressor")(*states) * slope))
        return ca.Function("reverse", [*states, slope], [ca.gradient(value, x) for x in states])

    @cached_property
    def _one_torque(self) -> Any:
        import casadi as ca

        n = self.model.n
        states = [ca.SX.sym(name, n) for name in ("q", "dq", "ddq")]
        d, weight = ca.SX.sym("d", len(self.model.parameters)), ca.SX.sym("weight", len(self.model.channels))
        value = ca.dot(self.model.casadi("torque")(*states, d), weight)
        slopes = [ca.gradient(value, x) for x in states]
        return ca.Function("reverse_torque", [*states, d, weight], slopes)

    def _reverse(self, count: int) -> Any:
        return self._many.get(count) or self._many.setdefault(count, self._one.map(count))


def along(
    rows: Rows, basis: Basis, criterion: Criterion
) -> Callable[[Array], tuple[float, Callable[[], Array]]]:
    """x (n, K) -> the criterion of one period of the motion, and its slope, for `optimal.optimise`."""
    N = max(12 * basis.harmonics, 80)
    B = basis.at((np.arange(N) + 0.5) * basis.period / N)[:3]

    def objective(x: Array) -> tuple[float, Callable[[], Array]]:
        q, dq, ddq = (b @ x.T for b in B)
        A = rows(q, dq, ddq)
        value, slope = criterion(A.reshape(-1, A.shape[2]))

        def back() -> Array:
            through = rows.back(q, dq, ddq, slope.reshape(A.shape))
            return sum((g.T @ b for g, b in zip(through, B)), np.zeros_like(x))

        return value, back

    return objective


def d_optimal(A: Array) -> tuple[float, Array]:
    """-log det(A'A) / b and its gradient; A (rows, b)."""
    d = np.linalg.norm(A, axis=0)
    d[d == 0] = 1.0
    S = A / d
    M = S.T @ S + 1e-12 * np.eye(len(d))
    _, logdet = np.linalg.slogdet(M)
    b = len(d)
    return -(logdet + 2 * np.log(d).sum()) / b, -2 / b * np.linalg.solve(M, S.T).T / d


def condition(A: Array) -> tuple[float, Array]:
    """log of the condition of A with columns of unit length, by p-norms of its singular values."""
    m = np.maximum((A**2).sum(axis=0), 1e-300)
    d = np.sqrt(m)
    N = (A / d).T @ (A / d)
    values, V = np.linalg.eigh(N)
    values = np.maximum(values, 1e-12)
    up, down = (values / values[-1]) ** POWER, (values[0] / values) ** POWER
    value = (np.log(values[-1] / values[0]) + (np.log(up.sum()) + np.log(down.sum())) / POWER) / 2
    slope = 0.5 * (up / up.sum() - down / down.sum()) / values
    G = (V * slope) @ V.T
    return float(value), 2 * A @ (G / np.outer(d, d) - np.diag((G * N).sum(axis=0) / m))


def balanced(A: Array) -> tuple[float, Array]:
    """d + ROUNDER condition."""
    (volume, first), (shape, second) = d_optimal(A), condition(A)
    return volume + ROUNDER * shape, first + ROUNDER * second


def worst(chi: Array) -> Criterion:
    """Largest standard deviation relative to chi (b,), of those that are not next to nothing."""
    size = np.maximum(np.abs(chi), 0.1 * np.median(np.abs(chi)) + 1e-9)

    def criterion(A: Array) -> tuple[float, Array]:
        S = A * size
        inverse = np.linalg.inv(S.T @ S + 1e-12 * np.eye(len(size)))
        variance = np.maximum(np.diag(inverse), 1e-300)
        share = (variance / variance.max()) ** POWER
        value = 0.5 * (np.log(variance.max()) + np.log(share.sum()) / POWER)
        G = -0.5 * (inverse * (share / share.sum() / variance)) @ inverse
        return float(value), 2 * S @ G * size

    return criterion


def bodies(which: Array) -> Criterion:
    """log of the condition of the columns `which` (b,), by p-norms of their singular values."""

    def criterion(A: Array) -> tuple[float, Array]:
        U, s, V = np.linalg.svd(A[:, which], full_matrices=False)
        s = np.maximum(s, 1e-12 * s[0])
        up, down = (s / s[0]) ** (2 * POWER), (s[-1] / s) ** (2 * POWER)
        slope = np.zeros_like(A)
        slope[:, which] = (U * ((up / up.sum() - down / down.sum()) / s)) @ V
        ends = (np.log(up.sum()) + np.log(down.sum())) / (2 * POWER)
        return float(np.log(s[0] / s[-1]) + ends), slope

    return criterion


def criteria(chi: Array, of_bodies: Array) -> dict[str, Criterion]:
    """By name; chi (b,) is what `worst` is relative to, of_bodies (b,) the parameters of `bodies`."""
    return dict(zip(CRITERIA, (balanced, d_optimal, condition, worst(chi), bodies(of_bodies))))


def scaled_condition(A: Array) -> float:
    """Condition of A (rows, b) with columns of unit length; inf where a column is not shown."""
    length = np.linalg.norm(A, axis=0)
    if not np.all(length > 1e-9 * length.max(initial=0.0)):
        return float("inf")
    return float(np.linalg.cond(A / length))
