"""SymPy terms of an effect as NumPy functions: its columns, what it reports and how sure.

Compiled once per effect. Nothing here knows of joints, places or models.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Protocol

import numpy as np
import sympy as sp

from modelgen.effects.parameters import LinearParameter, NonlinearParameter, Quantity

Array = np.ndarray


class Terms(Protocol):
    """What is evaluated: an effect, by its parameters and terms."""

    terms: Mapping[str, sp.Expr]
    linear: tuple[LinearParameter, ...]
    nonlinear: tuple[NonlinearParameter, ...]
    context: tuple[str, ...]

    def __hash__(self) -> int: ...

    @property
    def linear_names(self) -> tuple[str, ...]: ...

    @property
    def nonlinear_names(self) -> tuple[str, ...]: ...

    @property
    def quantities(self) -> tuple[Quantity, ...]: ...

    @property
    def needs(self) -> frozenset[str]: ...


def columns(effect: Terms, values: Mapping[str, Array], theta: Mapping[str, float], rows: int) -> Array:
    """(N, n_linear) of the terms."""
    parts = _compiled(effect)(values, theta)
    return np.stack([np.broadcast_to(part, rows) for part in parts], axis=1).astype(float, copy=False)


def told(effect: Terms, values: Mapping[str, float], covariance: Array) -> tuple[Array, Array]:
    """Values and standard deviations of the reported quantities: var f = f' C f'^T, C over `told_names`."""
    if not effect.quantities:
        return np.zeros(0), np.zeros(0)
    inputs = [np.float64(values.get(n, 0.0)) for n in told_names(effect)]  # a division by zero is nan
    function, jacobian = _compiled_report(effect)
    with np.errstate(divide="ignore", invalid="ignore"):
        numbers = np.asarray(function(*inputs), dtype=float).ravel()
        J = np.asarray(jacobian(*inputs), dtype=float).reshape(len(numbers), len(inputs))
        variance = np.einsum("ij,jk,ik->i", J, covariance, J)
        return numbers, np.sqrt(np.maximum(variance, 0.0))


def told_names(effect: Terms) -> tuple[str, ...]:
    """What reported quantities are made of, in the order of their covariance."""
    return (*effect.linear_names, *effect.nonlinear_names, *effect.context)


def _lambdify(effect: Terms, expressions: list[sp.Expr]) -> Callable[..., list[Array]]:
    names = sorted(effect.needs) + list(effect.nonlinear_names)
    function = sp.lambdify([sp.Symbol(n, real=True) for n in names], expressions, modules="numpy", cse=True)

    def evaluate(values: Mapping[str, Array], theta: Mapping[str, float]) -> list[Array]:
        return function(*(values[n] if n in values else theta[n] for n in names))

    return evaluate


@cache
def _compiled(effect: Terms) -> Callable[..., list[Array]]:
    return _lambdify(effect, [effect.terms[name] for name in effect.linear_names])


@cache
def _compiled_report(effect: Terms) -> tuple[Callable, Callable]:
    inputs = [sp.Symbol(n, real=True) for n in told_names(effect)]
    quantities = sp.Matrix([q.expression for q in effect.quantities])
    return (
        sp.lambdify(inputs, quantities, modules="numpy"),
        sp.lambdify(inputs, quantities.jacobian(inputs), modules="numpy"),
    )
