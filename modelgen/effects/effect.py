"""One physical effect as a value: what it adds to a torque, with which parameters, and who described it.

The generator, the simulator and the diagnosis all read this one definition. A term is a SymPy expression over
the signals of a joint (:class:`Signals`) and the effect's nonlinear parameters; the torque it adds is

    sum over linear parameters p of  p * term_p(signals; nonlinear parameters)      [N m | N]

Expressions use only + - * / exp sin cos tanh sign abs sqrt pow, so that CasADi can turn them into C.
`sign_dq` is a signal of its own: whoever evaluates a column passes the same (smoothed) sign as to the model.

Kinds of effect, and what their terms mean:
    column       the term is added to a torque
    motion       the term is the change of the link's position, q_link = q + sum p term_p  [rad], but
                 for `torque_terms`, which are torques as of a column
    measurement  the term is added to what is recorded; `tau` is the undisturbed channel, `dtau` its rate
    load         the term is a dimensionless gate; :mod:`modelgen.effects.loads` makes torques of it
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Literal

import numpy as np
import sympy as sp

from modelgen.errors import ModelgenError

Array = np.ndarray
Kind = Literal["column", "motion", "measurement", "load"]
Channel = Literal["motor", "link", "sensor", "any"]
SignRule = Literal["positive", "any"]


class EffectError(ModelgenError):
    """An effect was asked for, or evaluated, with something it does not have."""


class Signals:
    """Symbols that a term may use. All of joint j, joint side, SI units, unless a name says `source`."""

    t = sp.Symbol("t", real=True)  # s since the first sample of the recording
    q = sp.Symbol("q", real=True)
    dq = sp.Symbol("dq", real=True)
    ddq = sp.Symbol("ddq", real=True)
    sign_dq = sp.Symbol("sign_dq", real=True)  # sign(dq), or its smoothed form
    tau_link = sp.Symbol("tau_link", real=True)  # torque the gear passes to the link
    tau = sp.Symbol("tau", real=True)  # the channel the effect disturbs, undisturbed
    dtau = sp.Symbol("dtau", real=True)  # its time derivative
    dq_source = sp.Symbol("dq_source", real=True)  # of the other joint of a pair
    ddq_source = sp.Symbol("ddq_source", real=True)
    sign_sum = sp.Symbol("sign_sum", real=True)  # sign(dq + dq_source)
    tau_source = sp.Symbol("tau_source", real=True)
    gate = sp.Symbol("gate", real=True)  # 1 inside the window of a load, 0 outside
    z = sp.Symbol("z", real=True)  # the effect's own state
    step = sp.Symbol("step", real=True)  # change of q since the previous sample


SIGNALS = Signals


@dataclass(frozen=True)
class LinearParameter:
    """A parameter that multiplies a term. `low`, `high`: plausible size; `sign`: what physics allows."""

    name: str
    unit: str
    low: float
    high: float
    sign: SignRule = "any"
    optional: bool = False  # a candidate may leave this term out

    @property
    def symbol(self) -> sp.Symbol:
        return sp.Symbol(self.name, real=True)


@dataclass(frozen=True)
class NonlinearParameter:
    """A parameter inside a term, searched on `grid` and refined inside [low, high]."""

    name: str
    unit: str
    low: float
    high: float
    grid: tuple[float, ...]

    @property
    def symbol(self) -> sp.Symbol:
        return sp.Symbol(self.name, real=True)


@dataclass(frozen=True)
class Quantity:
    """A number the user is told: an expression in the linear, nonlinear and context parameters."""

    name: str
    unit: str
    expression: sp.Expr


@dataclass(frozen=True)
class State:
    """A state that remembers the motion: z[k+1] = update(z[k], step, nonlinear parameters).

    `update` is the definition (and what becomes C); `integrate(q, theta, initial) -> z (N,)` is the same
    evaluated over a whole record, without a loop over the samples.
    """

    update: sp.Expr
    integrate: Callable[[Array, Mapping[str, float], float], Array]
    low: float
    high: float
    initial: float = 0.0


@dataclass(frozen=True, eq=False)
class Effect:
    """One physical effect. See the module's docstring for the meaning of `terms` by kind."""

    name: str
    summary: str  # what it is, in one sentence
    signature: str  # what it looks like in a residual
    source: str  # who described it
    terms: Mapping[str, sp.Expr]  # linear parameter -> expression
    linear: tuple[LinearParameter, ...]
    nonlinear: tuple[NonlinearParameter, ...] = ()
    reported: tuple[Quantity, ...] = ()  # empty: linear and nonlinear parameters as they are
    inverse: Mapping[str, sp.Expr] = field(default_factory=dict)  # linear/nonlinear from the reported names
    context: tuple[str, ...] = ()  # of the joint's own model, "Fv" or "Fc", for `reported`
    kind: Kind = "column"
    channel: Channel = "motor"
    joints: Literal["joint", "pair", "robot"] = "joint"
    windowed: bool = False  # acts from (and to) a moment of one recording
    state: State | None = None
    sizes: tuple[str, ...] = ()  # reported parameters that say how large it is; see `size_names`
    typical: Mapping[str, float] = field(default_factory=dict)  # reported values of a usual robot
    shared: bool = False  # all joints may have it with one value (joints [])
    torque_terms: tuple[str, ...] = ()  # of a motion effect: terms that are torques, not displacements
    common: bool = True  # False: rarer than its rivals, to be preferred only when it fits clearly better

    @property
    def linear_names(self) -> tuple[str, ...]:
        return tuple(p.name for p in self.linear)

    @property
    def nonlinear_names(self) -> tuple[str, ...]:
        return tuple(p.name for p in self.nonlinear)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What is reported; by default every parameter under its own name."""
        if self.reported:
            return self.reported
        parameters: tuple[LinearParameter | NonlinearParameter, ...] = (*self.linear, *self.nonlinear)
        return tuple(Quantity(p.name, p.unit, p.symbol) for p in parameters)

    @property
    def size_names(self) -> tuple[str, ...]:
        """Reported parameters that make the effect larger or smaller; the others give it its shape."""
        names = tuple(quantity.name for quantity in self.quantities)
        return self.sizes or tuple(name for name in names if name in self.linear_names) or names[:1]

    @cached_property
    def needs(self) -> frozenset[str]:
        """Names of the signals that the terms use."""
        parameters = set(self.nonlinear_names)
        symbols: set[str] = set()
        for term in self.terms.values():
            symbols |= {s.name for s in term.free_symbols}
        return frozenset(symbols - parameters)

    def term(
        self, signals: Mapping[str, sp.Expr] | None = None, theta: Mapping[str, sp.Expr] | None = None
    ) -> dict[str, sp.Expr]:
        """The terms with signals and nonlinear parameters replaced: {linear: expression}."""
        chosen = {sp.Symbol(k, real=True): v for k, v in {**(signals or {}), **(theta or {})}.items()}
        return {name: expression.subs(chosen, simultaneous=True) for name, expression in self.terms.items()}

    def numpy_columns(self, signals: Mapping[str, Array], theta: Mapping[str, float] | None = None) -> Array:
        """(N, n_linear) columns; `theta` holds the nonlinear parameters, absent ones at mid-grid.

        Derived signals that are absent are computed: sign_dq, sign_sum and the state z (from q,
        relaxed at the first sample). Raises EffectError when a needed signal is absent.
        """
        theta = self.complete(theta)
        values, rows = self._signal_values(signals, theta)
        columns = _compiled(self)(values, theta)
        return np.stack([np.broadcast_to(column, rows) for column in columns], axis=1)

    def numpy_derivatives(
        self, signals: Mapping[str, Array], theta: Mapping[str, float] | None = None
    ) -> Array:
        """(n_nonlinear, N, n_linear) derivatives of the columns, for variable projection.

        Symbolic, but central differences where a state depends on the parameter.
        """
        theta = self.complete(theta)
        values, rows = self._signal_values(signals, theta)
        if self.state is not None:
            return np.stack([self._difference(signals, theta, p) for p in self.nonlinear])
        parts = [np.broadcast_to(d, rows) for d in _compiled_derivatives(self)(values, theta)]
        shape = (len(self.nonlinear), len(self.linear), rows)
        return np.asarray(parts, dtype=float).reshape(shape).transpose(0, 2, 1)

    def _difference(
        self, signals: Mapping[str, Array], theta: Mapping[str, float], p: NonlinearParameter
    ) -> Array:
        given = {k: v for k, v in signals.items() if k != "z"}
        h = 1e-4 * max(abs(theta[p.name]), 1e-3 * (p.high - p.low))
        up = self.numpy_columns(given, {**theta, p.name: theta[p.name] + h})
        down = self.numpy_columns(given, {**theta, p.name: theta[p.name] - h})
        return (up - down) / (2 * h)

    def complete(self, theta: Mapping[str, float] | None) -> dict[str, float]:
        """All nonlinear parameters: the given ones, the middle of the grid for the others."""
        theta = dict(theta or {})
        unknown = set(theta) - set(self.nonlinear_names)
        if unknown:
            raise EffectError(
                f"{self.name} has no parameter {', '.join(sorted(unknown))} inside its term; "
                f"it has {', '.join(self.nonlinear_names) or 'none'}."
            )
        for p in self.nonlinear:
            theta.setdefault(p.name, p.grid[len(p.grid) // 2])
        return theta

    def _signal_values(
        self, signals: Mapping[str, Array], theta: Mapping[str, float]
    ) -> tuple[dict[str, Array], int]:
        values = {name: np.asarray(value, dtype=float) for name, value in signals.items()}
        needs = self.needs
        if "sign_dq" in needs and "sign_dq" not in values and "dq" in values:
            values["sign_dq"] = np.sign(values["dq"])
        if "sign_sum" in needs and "sign_sum" not in values and {"dq", "dq_source"} <= set(values):
            values["sign_sum"] = np.sign(values["dq"] + values["dq_source"])
        if self.state is not None and "z" in needs and "z" not in values and "q" in values:
            values["z"] = self.state.integrate(values["q"], theta, self.state.initial)
        missing = sorted(needs - set(values))
        if missing:
            raise EffectError(f"{self.name} needs the signal {', '.join(missing)}, which was not given.")
        rows = max((v.shape[0] for v in values.values() if v.ndim), default=1)
        return values, rows

    def values_from_reported(
        self, reported: Mapping[str, float], context: Mapping[str, float] | None = None
    ) -> tuple[dict[str, float], dict[str, float]]:
        """(linear, nonlinear) parameters that belong to reported values, e.g. A, phi -> As, Ac."""
        known = {q.name for q in self.quantities}
        unknown = sorted(set(reported) - known)
        if unknown:
            raise EffectError(
                f"{self.name} has no parameter {', '.join(unknown)}; it has {', '.join(sorted(known))}."
            )
        given = {sp.Symbol(k, real=True): v for k, v in {**reported, **(context or {})}.items()}

        def value(name: str) -> float:
            expression = self.inverse.get(name, sp.Symbol(name, real=True)).subs(given)
            if expression.free_symbols:
                absent = ", ".join(sorted(s.name for s in expression.free_symbols))
                raise EffectError(f"{self.name} needs a value for {absent}.")
            if not (expression.is_real and expression.is_finite):
                told = ", ".join(f"{key}={number:g}" for key, number in reported.items())
                raise EffectError(f"{self.name} cannot have {told}; give values other than zero.")
            return float(expression)

        return {n: value(n) for n in self.linear_names}, {n: value(n) for n in self.nonlinear_names}

    def report(
        self,
        linear: Mapping[str, float],
        nonlinear: Mapping[str, float] | None = None,
        covariance: Array | None = None,
        context: Mapping[str, float] | None = None,
    ) -> dict[str, dict[str, float | str]]:
        """{name: {value, std, unit}} by the delta method: var f = f' C f'^T.

        `covariance` is of (linear, nonlinear, context) in the order of the definition; shorter when the last
        ones were held fixed; None gives std 0. Optional parameters that are
        absent are absent from the covariance too, and what depends on them is not reported.
        """
        nonlinear = dict(nonlinear or {})
        names = (*self.linear_names, *self.nonlinear_names, *self.context)
        missing = sorted(set(self.context) - set(context or {}))
        if missing:
            raise EffectError(f"{self.name} is reported relative to {', '.join(missing)} of its joint.")
        told = {**nonlinear, **linear, **(context or {})}
        values = np.array([told.get(n, 0.0) for n in names], dtype=float)
        absent = {p.name for p in self.linear if p.optional and p.name not in linear}
        estimated = [i for i, name in enumerate(names) if name not in absent]
        full = np.zeros((len(names), len(names)))
        if covariance is not None:
            k = np.shape(covariance)[0]
            full[np.ix_(estimated[:k], estimated[:k])] = covariance
        function, jacobian = _compiled_report(self)
        with np.errstate(divide="ignore", invalid="ignore"):
            numbers = np.asarray(function(*values), dtype=float).ravel()
            J = np.asarray(jacobian(*values), dtype=float).reshape(len(numbers), len(names))
            std = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", J, full, J), 0.0))
        return {
            quantity.name: {"value": float(v), "std": float(s), "unit": quantity.unit}
            for quantity, v, s in zip(self.quantities, numbers, std)
            if not absent & {symbol.name for symbol in quantity.expression.free_symbols}
        }


def _lambdify(effect: Effect, expressions: list[sp.Expr]) -> Callable:
    names = sorted(effect.needs) + list(effect.nonlinear_names)
    function = sp.lambdify([sp.Symbol(n, real=True) for n in names], expressions, modules="numpy", cse=True)

    def evaluate(values: Mapping[str, Array], theta: Mapping[str, float]) -> list[Array]:
        return function(*(values[n] if n in values else theta[n] for n in names))

    return evaluate


@cache
def _compiled(effect: Effect) -> Callable:
    return _lambdify(effect, [effect.terms[name] for name in effect.linear_names])


@cache
def _compiled_derivatives(effect: Effect) -> Callable:
    return _lambdify(
        effect, [effect.terms[name].diff(p.symbol) for p in effect.nonlinear for name in effect.linear_names]
    )


@cache
def _compiled_report(effect: Effect) -> tuple[Callable, Callable]:
    names = (*effect.linear_names, *effect.nonlinear_names, *effect.context)
    inputs = [sp.Symbol(n, real=True) for n in names]
    quantities = sp.Matrix([q.expression for q in effect.quantities])
    return (
        sp.lambdify(inputs, quantities, modules="numpy"),
        sp.lambdify(inputs, quantities.jacobian(inputs), modules="numpy"),
    )
