"""NumPy functions as CasADi functions with their own Jacobians, and IPOPT's voice after each iteration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np


class _Function(ca.Callback):
    """shapes of the arguments, shape of the result, f(first argument)."""

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
        return [ca.DM(np.asarray(self.f(given[0]), dtype=float).reshape(self.shape))]

    def has_jacobian(self) -> bool:
        return self.slope is not None

    def get_jacobian(self, *_: Any) -> Any:
        return self.slope


def external(name: str, size: int, count: int, values: Callable, slopes: Callable) -> _Function:
    """(size,) -> (count,) with the Jacobian (count, size). Must live as long as what uses it."""
    made = _Function(name, [(size, 1)], (count, 1), values)
    made.slope = _Function(f"jac_{name}", [(size, 1), (count, 1)], (count, size), slopes).made()
    return made.made()


class Steps:
    """After each iteration of IPOPT: how many there were; whether to stop."""

    def __init__(self, size: int, count: int, iterations: int, stop: Callable[[], bool]) -> None:
        self.progress: Callable[[float], None] = lambda share: None
        self.done, self.iterations, self.stop = 0, iterations, stop
        rows = {"x": size, "lam_x": size, "f": 1, "g": count, "lam_g": count}
        given = [(rows.get(ca.nlpsol_out(i), 0), 1) for i in range(ca.nlpsol_n_out())]
        self.function = _Function("steps", given, (1, 1), lambda _: self.step()).made()

    def step(self) -> int:
        self.done += 1
        self.progress(min(self.done / self.iterations, 1.0))
        return int(self.stop())
