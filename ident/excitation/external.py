"""NumPy functions as CasADi functions with their own Jacobians, and IPOPT's voice after each iteration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

EXHAUSTED, LATELY = 0.02, 10  # a search ends that gained so little (nats a parameter) in so many iterations
HELD = 1e-4  # by which a limit on the grid may be exceeded: it is a few per cent tighter than the limit


class _Function(ca.Callback):
    """shapes of the arguments, shape of the result, f(arguments)."""

    def __init__(self, name: str, given: list[tuple[int, int]], shape: tuple[int, int], f: Callable) -> None:
        ca.Callback.__init__(self)
        self.given, self.shape, self.f, self.called = given, shape, f, name
        self.slope: _Function | None = None

    def made(self) -> _Function:
        self.construct(self.called, {})
        return self

    def get_n_in(self) -> int:
        return len(self.given)

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, i: int) -> Any:
        return ca.Sparsity.dense(*self.given[i])

    def get_sparsity_out(self, i: int) -> Any:
        return ca.Sparsity.dense(*self.shape)

    def eval(self, given: Any) -> Any:
        return [ca.DM(np.asarray(self.f(*given), dtype=float).reshape(self.shape))]

    def has_jacobian(self) -> bool:
        return self.slope is not None

    def get_jacobian(self, *_: Any) -> Any:
        return self.slope


def external(name: str, size: int, count: int, values: Callable, slopes: Callable) -> _Function:
    """(size,) -> (count,) with the Jacobian (count, size). Must live as long as what uses it."""
    made = _Function(name, [(size, 1)], (count, 1), values)
    shape = [(size, 1), (count, 1)]
    made.slope = _Function(f"jac_{name}", shape, (count, size), lambda z, _: slopes(z)).made()
    return made.made()


class Steps:
    """After each iteration of IPOPT: the best point inside the limits so far; whether to stop, as one is told
    to or as nothing is gained any more."""

    def __init__(self, size: int, count: int, stop: Callable[[], bool]) -> None:
        self.stop = stop
        self.begin(lambda share: None, 1, -np.inf, np.inf)
        rows = {"x": size, "lam_x": size, "f": 1, "g": count, "lam_g": count}
        given = [(rows.get(ca.nlpsol_out(i), 0), 1) for i in range(ca.nlpsol_n_out())]
        self.function = _Function("steps", given, (1, 1), self.step).made()

    def begin(self, progress: Callable[[float], None], iterations: int, low: Any, high: Any) -> None:
        """low, high (count,): what the constraints may be."""
        self.progress, self.iterations, self.low, self.high = progress, iterations, low, high
        self.best: Any = None
        self.values: list[float] = []  # the best one's, iteration by iteration

    def step(self, x: Any, f: Any, g: Any, *_: Any) -> int:
        inside = np.array(g).ravel()
        holds = bool(np.all((self.low - HELD <= inside) & (inside <= self.high + HELD)))
        before = self.values[-1] if self.values else np.inf
        if holds and float(f) < before:
            self.best = np.array(x).ravel()
        self.values.append(min(before, float(f)) if holds else before)
        self.progress(min(len(self.values) / self.iterations, 1.0))
        gained = self.values[-LATELY - 1] - self.values[-1] if len(self.values) > LATELY else np.inf
        return int(self.stop() or gained < EXHAUSTED)
