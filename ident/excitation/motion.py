"""Periodic Fourier motions that begin and end each period at rest, linear in their coefficients.

q_j(t) = x_j0 + sum_k x_jk B_k(t). The B_k span the trigonometric polynomials of degree H without a constant
for which B(0) = B'(0) = B''(0) = 0 (Swevers et al., IEEE T-RA 13(5), 1997, with rest by elimination), so x_j0
is where joint j starts and every choice of coefficients starts and ends at rest.

A trigonometric polynomial of degree H that is at most m in size at M equally spaced instants of its period is
at most m / cos(pi H / M) at every instant (Ehlich and Zeller, Math. Z. 86, 1964): limits that are so much
tighter on a grid hold always.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from ident.twin.trajectories import Motion

Array = np.ndarray
LONGEST_PERIOD = 20.0  # s; a longer motion repeats its period
TOP_HZ = 0.7  # of the harmonics, unless asked otherwise
FINE_HZ = 1000.0  # at which limits are looked at
GRID = 10  # instants per harmonic at which limits are held


@dataclass(frozen=True)
class Basis:
    """B_k of one period [s] up to harmonic H; K = 2 H - 1 with the constant."""

    period: float
    harmonics: int

    @property
    def size(self) -> int:
        return 2 * self.harmonics - 1

    @cached_property
    def fine(self) -> Array:
        """(4, N, K) at FINE_HZ over one period."""
        return self.at(np.arange(0.0, self.period, 1 / FINE_HZ))

    @cached_property
    def _free(self) -> Array:
        """(2H + 1, K) coefficients of 1, cos, sin in each B_k, scaled to unit size of their rates."""
        h = np.arange(1, self.harmonics + 1)
        zero = np.zeros(self.harmonics)
        at_rest = np.array([[1.0, *np.ones(len(h)), *zero], [0.0, *zero, *h], [0.0, *h**2, *zero]])
        weight = np.concatenate(([1.0], h, h))  # by their rates, so that high ones count as much
        _, _, V = np.linalg.svd(at_rest / weight)
        return np.column_stack((np.eye(len(weight))[:, 0], V[3:].T / weight[:, None]))

    def at(self, t: Array) -> Array:
        """(4, N, K): B, B', B'', B''' at instants t (N,)."""
        w = 2 * np.pi / self.period * np.arange(1, self.harmonics + 1)
        angle = np.asarray(t, dtype=float)[:, None] * w
        c, s, one = np.cos(angle), np.sin(angle), np.ones((len(angle), 1))
        parts = [(one, c, s), (0 * one, -s * w, c * w), (0 * one, -c * w**2, -s * w**2)]
        parts.append((0 * one, s * w**3, -c * w**3))
        return np.stack([np.hstack(part) @ self._free for part in parts])

    @property
    def grid(self) -> Array:
        """Instants at which limits are held."""
        return self.finer(1)

    def finer(self, times: int) -> Array:
        """Instants of a grid so many times as fine."""
        M = times * GRID * self.harmonics
        return np.arange(M) * self.period / M

    def tighter(self, times: int = 1) -> float:
        """Factor of limits on such a grid that makes them hold at every instant."""
        return float(np.cos(np.pi / (times * GRID)))


@dataclass(frozen=True)
class FourierMotion:
    """Coefficients x (n, K) over a basis, repeated to `duration` [s]."""

    basis: Basis
    x: Array
    duration: float

    @property
    def period(self) -> float:
        return self.basis.period

    def states(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """q, dq, ddq, jerk, each (N, n)."""
        q, dq, ddq, jerk = (B @ self.x.T for B in self.basis.at(t))
        return q, dq, ddq, jerk

    @property
    def fine(self) -> tuple[Array, Array, Array, Array]:
        """States of one period at FINE_HZ."""
        q, dq, ddq, jerk = (B @ self.x.T for B in self.basis.fine)
        return q, dq, ddq, jerk

    @property
    def motion(self) -> Motion:
        """As the twin takes it."""
        return Motion("fourier", self.duration, lambda t: self.states(t)[:3])


class Planned(Protocol):
    """A motion that can be held against limits: a Fourier series, or point to point."""

    @property
    def duration(self) -> float: ...

    @property
    def period(self) -> float: ...

    @property
    def fine(self) -> tuple[Array, Array, Array, Array]: ...

    def states(self, t: Array) -> tuple[Array, Array, Array, Array]: ...


def basis_for(duration: float, harmonics: int | None = None) -> Basis:
    """A basis whose period divides the duration [s]."""
    period = duration / np.ceil(duration / LONGEST_PERIOD)
    return Basis(float(period), harmonics or int(np.clip(round(TOP_HZ * period), 4, 14)))
