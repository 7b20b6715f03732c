"""One physical effect as a class: what it adds to a torque, where it may stand, how it is found and told.

Generator, simulator, fit and diagnosis read this one definition; no module outside this folder knows an
effect by name. A term is a SymPy expression over the signals of a joint (:class:`Signals`) and the effect's
nonlinear (shape) parameters; the torque it adds is

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

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, Literal

import numpy as np
import sympy as sp

from modelgen.effects import evaluation
from modelgen.effects.memory import Memory, carried
from modelgen.effects.parameters import (
    SIGNALS,
    STATES,
    LinearParameter,
    NonlinearParameter,
    Quantity,
    Signals,
    State,
)
from modelgen.effects.place import REVOLUTE_TRAVEL, Layout, Model, Motion, Place, PlaceSide
from modelgen.effects.truth import Stage, Truth
from modelgen.errors import ModelgenError
from modelgen.geometry.names import joint_unit

__all__ = [
    "SIGNALS",
    "Effect",
    "EffectError",
    "Layout",
    "LinearParameter",
    "Model",
    "Motion",
    "NonlinearParameter",
    "Place",
    "Quantity",
    "Signals",
    "State",
    "Truth",
]

Array = np.ndarray
Kind = Literal["column", "motion", "measurement", "load"]
ChannelKind = Literal["motor", "link", "sensor", "any"]
Columns = dict[int, Array]  # channel number -> (N, p)
Report = dict[str, dict[str, float | str]]


class EffectError(ModelgenError):
    """An effect was asked for, or evaluated, with something it does not have."""


class Effect:
    """One physical effect. A subclass states the attributes and overrides the methods that differ.

    `Effect(name=..., terms=...)` makes one without a class, for a plain term.
    """

    name: str
    summary: str  # what it is, in one sentence
    signature: str  # what it looks like in a residual
    source: str  # who described it
    remedy: str = "add its term to the model, or find and mend its cause"  # what a person does about it
    equation: str = ""  # for a reader, where `terms` do not say it
    terms: Mapping[str, sp.Expr] = {}  # linear parameter -> expression
    linear: tuple[LinearParameter, ...] = ()
    nonlinear: tuple[NonlinearParameter, ...] = ()  # shape parameters
    reported: tuple[Quantity, ...] = ()  # empty: linear and nonlinear parameters as they are
    inverse: Mapping[str, sp.Expr] = {}  # linear/nonlinear from the reported names
    context: tuple[str, ...] = ()  # numbers of the model that `reported` uses, see `context_of`
    kind: Kind = "column"
    channel: ChannelKind = "motor"
    joints: Literal["joint", "pair", "robot"] = "joint"
    proportional: bool = True  # its torque grows with its linear parameters; a simulator scales those
    windowed: bool = False  # acts from (and to) a moment of one recording
    transient: bool = False  # ... and not all along a recording
    on_link: bool = False  # may be said to be on a certain link
    state: State | None = None
    sizes: tuple[str, ...] = ()  # reported parameters that say how large it is; see `size_names`
    size_aliases: tuple[str, ...] = ()  # reported ones that follow from these, and fix them in a request
    typical: Mapping[str, float] = {}  # reported values of a usual robot
    shared: bool = False  # all joints may have it with one value (joints [])
    torque_terms: tuple[str, ...] = ()  # of a motion effect: terms that are torques, not displacements
    common: bool = True  # False: rarer than its rivals, to be preferred only when it fits clearly better
    told_by: tuple[str, ...] = ()  # checks of a recording that are this effect
    replaces: tuple[str, ...] = ()  # kinds of the model's own parameters that it is, ("Fcm", "Fcl")
    changes_model: bool = False  # the model's own columns change with it, see `regressor_change`
    margin_s: float = 0.0  # s of motion either side of a block that `columns` needs and a caller cuts off
    share: float = 0.05  # rise of the joint's error, of its torque, that a simulator aims at
    window: tuple[float, float | None] | None = None  # of a recording, where a simulator puts it

    def __init__(self, **attributes: Any) -> None:
        for key, value in attributes.items():
            if not hasattr(Effect, key) and key not in Effect.__annotations__:
                raise EffectError(f"an effect has no attribute {key}.")
            setattr(self, key, value)

    # ---- its parameters

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
        return (
            *(Quantity(p.name, p.unit, p.symbol) for p in self.linear),
            *(Quantity(p.name, p.unit, p.symbol, p.angle) for p in self.nonlinear),
        )

    @property
    def size_names(self) -> tuple[str, ...]:
        """Reported parameters that make the effect larger or smaller; the others give it its shape."""
        names = tuple(quantity.name for quantity in self.quantities)
        return self.sizes or tuple(name for name in names if name in self.linear_names) or names[:1]

    @cached_property
    def needs(self) -> frozenset[str]:
        """Names of the signals that the terms use."""
        symbols: set[str] = set()
        for term in self.terms.values():
            symbols |= {s.name for s in term.free_symbols}
        return frozenset(symbols - set(self.nonlinear_names))

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

    def unit(self, quantity: Quantity | LinearParameter | NonlinearParameter, place: Place | None) -> str:
        """Unit of a parameter where it stands: N and m on a joint that slides."""
        if place is None or place.joint is None or getattr(quantity, "angle", False):
            return quantity.unit
        return joint_unit(quantity.unit, place.prismatic, place.source_prismatic)

    def bounds(self, place: Place, layout: Layout | None = None) -> dict[str, tuple[float, float]]:
        """{shape parameter: (low, high)} there. On a slide a rad counts as a share of the joint's travel."""
        scale = metres_per_radian(place, layout)
        out = {}
        for p in self.nonlinear:
            power = 0 if p.angle else radian_power(p.unit)
            out[p.name] = (p.low * scale**power, p.high * scale**power)
        return out

    # ---- its terms

    def term(
        self, signals: Mapping[str, sp.Expr] | None = None, theta: Mapping[str, sp.Expr] | None = None
    ) -> dict[str, sp.Expr]:
        """The terms with signals and nonlinear parameters replaced: {linear: expression}."""
        chosen = {sp.Symbol(k, real=True): v for k, v in {**(signals or {}), **(theta or {})}.items()}
        return {name: expression.subs(chosen, simultaneous=True) for name, expression in self.terms.items()}

    def numpy_columns(self, signals: Mapping[str, Array], theta: Mapping[str, float] | None = None) -> Array:
        """(N, n_linear) columns of the terms; `theta` holds the nonlinear parameters, absent ones at
        mid-grid.

        Derived signals that are absent are computed: sign_dq, sign_sum and the states (from q, relaxed at the
        first sample). Raises EffectError when a needed signal is absent.
        """
        theta = self.complete(theta)
        values, rows = self._signal_values(signals, theta)
        return evaluation.columns(self, values, theta, rows)

    def numpy_derivatives(
        self, signals: Mapping[str, Array], theta: Mapping[str, float] | None = None
    ) -> Array:
        """(n_nonlinear, N, n_linear) derivatives of the columns: symbolic, or differences through a state."""
        theta = self.complete(theta)
        values, rows = self._signal_values(signals, theta)
        if not self.needs & set(STATES):
            return evaluation.derivatives(self, values, theta, rows)
        given = {k: v for k, v in signals.items() if k not in STATES}
        parts = []
        for p in self.nonlinear:
            h = 1e-4 * max(abs(theta[p.name]), 1e-3 * (p.high - p.low))
            up = self.numpy_columns(given, {**theta, p.name: theta[p.name] + h})
            down = self.numpy_columns(given, {**theta, p.name: theta[p.name] - h})
            parts.append((up - down) / (2 * h))
        return np.stack(parts)

    def states(
        self,
        signals: Mapping[str, Array],
        theta: Mapping[str, float],
        recording: str = "",
        memory: Memory | None = None,
        key: object = None,
    ) -> dict[str, Array]:
        """{"z": (N,)} of the states along q, going on from `memory`."""
        if self.state is None or "q" not in signals:
            return {}
        state = self.state
        t = signals.get("t", np.arange(len(signals["q"])))
        return {
            "z": carried(
                memory,
                (self.name, key),
                recording,
                t,
                signals["q"],
                lambda q, first: state.integrate(q, theta, first),
                state.initial,
            )
        }

    def _signal_values(
        self, signals: Mapping[str, Array], theta: Mapping[str, float]
    ) -> tuple[dict[str, Array], int]:
        values = {name: np.asarray(value, dtype=float) for name, value in signals.items()}
        needs = self.needs
        if "sign_dq" in needs and "sign_dq" not in values and "dq" in values:
            values["sign_dq"] = np.sign(values["dq"])
        if "sign_sum" in needs and "sign_sum" not in values and {"dq", "dq_source"} <= set(values):
            values["sign_sum"] = np.sign(values["dq"] + values["dq_source"])
        if needs & set(STATES) - set(values):
            values |= {k: v for k, v in self.states(values, theta).items() if k not in values}
        missing = sorted(needs - set(values))
        if missing:
            raise EffectError(f"{self.name} needs the signal {', '.join(missing)}, which was not given.")
        rows = max((v.shape[0] for v in values.values() if v.ndim), default=1)
        return values, rows

    # ---- where it stands, and its columns there

    def places(self, layout: Layout) -> Iterable[Place]:
        """Every place where it may stand: each joint (and source), each side of the gear that is measured."""
        for side in self.sides(layout):
            for joint in range(layout.n):
                sources = [s for s in range(layout.n) if s != joint] if self.joints == "pair" else [None]
                for source in sources:
                    for parts in self.variants():
                        place = layout.place(joint, source, side=side, parts=parts)
                        if place.rows(layout.channels):
                            yield place

    def sides(self, layout: Layout) -> tuple[PlaceSide, ...]:
        """Sides of the gear where it may act and that the channels can tell apart."""
        measured = layout.sides
        if "tau_link" in self.needs and not measured & {"motor", "sensor"}:
            return ()  # the torque behind the gear is nowhere seen
        if self.channel == "sensor":
            return ("sensor",) if "sensor" in measured else ()
        if self.channel == "link":
            return ("link",) if measured & {"motor", "sensor"} else ()
        if "motor" in measured and "sensor" in measured:
            return ("motor", "sensor") if self.channel == "any" else ("motor", "link")
        return ("motor",) if measured & {"motor", "drive"} else ("link",)

    def variants(self) -> tuple[tuple[str, ...], ...]:
        """Sets of linear parameters that may stand alone; () is all that are not optional."""
        return ((),)

    def parameters_of(self, place: Place) -> tuple[str, ...]:
        """Linear parameters in use at a place, in the order of the columns."""
        return place.parts or tuple(p.name for p in self.linear if not p.optional)

    def starts(
        self,
        place: Place,
        motions: Sequence[Motion],
        residuals: Sequence[Array],
        model: Model | None = None,
    ) -> Sequence[dict[str, float]]:
        """Starting shape parameters, the product of the grids; residuals: one (N,) a motion, of the place's
        first channel, NaN where it does not count."""
        scale = metres_per_radian(place, None, motions)
        points: list[dict[str, float]] = [{}]
        for p in self.nonlinear:
            factor = 1.0 if p.angle else scale ** radian_power(p.unit)
            points = [{**point, p.name: value * factor} for point in points for value in p.grid]
        return points

    def signals(
        self, place: Place, motion: Motion, model: Model, theta: Mapping[str, float], memory: Memory | None
    ) -> dict[str, Array]:
        """(N,) signals that the terms use at a place."""
        j, source, needs = place.joint, place.source, self.needs
        out = {"t": motion.t}
        if j is not None:
            out |= {"q": motion.q[:, j], "dq": motion.dq[:, j], "ddq": motion.ddq[:, j]}
            out["sign_dq"] = motion.sign_dq[:, j]
            if "tau_link" in needs:
                out["tau_link"] = model.link_torque(motion)[:, j]
        if source is not None and j is not None:
            out |= {"q_source": motion.q[:, source], "dq_source": motion.dq[:, source]}
            out["ddq_source"] = motion.ddq[:, source]
            if "sign_sum" in needs:
                out["sign_sum"] = sign_of_sum(motion, j, source)
        return out | self.states(out, theta, motion.recording, memory, place)

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """{channel number: (N, p)} unfiltered columns of `parameters_of(place)`.

        `size`: last linear coefficients (p,), None or 0 for the tangent at nothing; only effects that are not
        linear in their size use it: their columns are secants, columns @ size is the effect. `memory`: one
        dict a pass, for effects that go on from block to block.
        """
        theta = self.complete(theta)
        values = self.numpy_columns(self.signals(place, motion, model, theta, memory), theta)
        use = [self.linear_names.index(name) for name in self.parameters_of(place)]
        gated = values[:, use] * place.gate(motion.recording, motion.t)[:, None]
        return {c: sign * gated for c, sign in place.rows(model.channels).items()}

    def regressor_change(
        self, place: Place, theta: Mapping[str, float], motion: Motion, model: Model
    ) -> dict[int, Array]:
        """{parameter number of the model: (N, C)} change of the model's own columns; for `changes_model`.

        The equations are then (W + change) chi + columns @ a: exact for any size, linear in chi.
        """
        return {}

    # ---- what it does to a simulated truth

    def stages(self, place: Place) -> tuple[Stage, ...]:
        """When a simulator lets it act."""
        return ("link_torque",) if place.side == "link" else ("torque",)

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        """The truth with the effect; `values`: linear and nonlinear parameters. By default its columns are
        added to the torque on its side of the gear."""
        return truth.with_torque(place, self._torque(truth, place, values))

    def _torque(
        self, truth: Truth, place: Place, values: Mapping[str, float], only: tuple[str, ...] | None = None
    ) -> Array:
        """(N,) torque of its terms (of some of them) in the joint of a truth."""
        j, s = place.joint, place.source
        assert j is not None
        q, dq, ddq = truth.state(place)
        signals = {"t": truth.t - truth.t[0], "q": q[:, j], "dq": dq[:, j], "ddq": ddq[:, j]}
        signals["tau_link"] = truth.tau_link[:, j]
        if s is not None:
            signals |= {"q_source": q[:, s], "dq_source": dq[:, s], "ddq_source": ddq[:, s]}
        columns = self.numpy_columns(signals, {n: values[n] for n in self.nonlinear_names})
        size = [values.get(n, 0.0) * (only is None or n in only) for n in self.linear_names]
        return columns @ np.array(size) * place.gate(truth.recording, truth.t - truth.t[0])

    def usual(self, given: Mapping[str, float], own: Mapping[str, float]) -> dict[str, float]:
        """Reported values of a usual robot beside those that are given; sizes that are left out are not
        there.

        `own`: the joint's "Fc" and "Fv", where the robot's are known.
        """
        values = dict(self.typical)
        if set(given) & set(self.size_names):
            values |= dict.fromkeys(self.size_names, 0.0)
        return {**values, **given}

    # ---- what may be, and what is told

    def physical(self, values: Mapping[str, float], model: Model | None = None) -> str | None:
        """Why these linear and nonlinear parameters cannot be, in one clause; None when they can."""
        for p in self.linear:
            if p.sign == "positive" and values.get(p.name, 0.0) < 0:
                return f"{p.name} would be negative"
        for q in self.nonlinear:
            if q.low > 0 and values.get(q.name, q.low) <= 0:
                return f"{q.name} would be negative or zero"
        return None

    def context_of(self, place: Place, model: Model) -> dict[str, float]:
        """Numbers of the model that `report` is relative to: of "Fv" the joint's Fvm, or else Fvl."""
        out = {}
        for name in self.context:
            sides = ("l", "m") if place.side in ("sensor", "link") else ("m", "l")
            found = [
                value
                for side in sides
                if (value := model.number(f"{name}{side}", place.joint or 0)) is not None
            ]
            if found:
                out[name] = found[0]
        return out

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
            expression = sp.sympify(self.inverse.get(name, sp.Symbol(name, real=True))).subs(given)
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
        values: Mapping[str, float],
        covariance: Array | None = None,
        context: Mapping[str, float] | None = None,
        place: Place | None = None,
    ) -> Report:
        """{name: {value, std, unit}} by the delta method: var f = f' C f'^T.

        `values`: linear and nonlinear parameters. `covariance` is of (linear, nonlinear, context) in the
        order of the definition, without the linear ones that `values` lacks; shorter when the last ones
        were held fixed; None gives std 0. What depends on an absent one is not reported.
        """
        missing = sorted(set(self.context) - set(context or {}))
        if missing:
            raise EffectError(f"{self.name} is reported relative to {', '.join(missing)} of its joint.")
        names = evaluation.told_names(self)
        absent = {name for name in self.linear_names if name not in values}
        estimated = [i for i, name in enumerate(names) if name not in absent]
        full = np.zeros((len(names), len(names)))
        if covariance is not None:
            k = np.shape(covariance)[0]
            full[np.ix_(estimated[:k], estimated[:k])] = covariance
        numbers, std = evaluation.told(self, {**values, **(context or {})}, full)
        return {
            quantity.name: {"value": float(v), "std": float(s), "unit": self.unit(quantity, place)}
            for quantity, v, s in zip(self.quantities, numbers, std)
            if not absent & {symbol.name for symbol in quantity.expression.free_symbols}
        }


def radian_power(unit: str) -> int:
    """Power of the joint's position in a unit: rad/s 1, 1/rad -1, N m/rad 0 (its N m scales as well)."""
    if "N m" in unit:
        return 0
    return {"rad": 1, "rad/s": 1, "1/rad": -1}.get(unit, 0)


def metres_per_radian(place: Place, layout: Layout | None, motions: Sequence[Motion] = ()) -> float:
    """1 of a joint that turns; of one that slides, its travel [m] over that of a usual revolute joint."""
    j = place.source if place.source is not None else place.joint
    slides = place.prismatic if place.source is None else bool(place.source_prismatic)
    if j is None or not slides:
        return 1.0
    if layout is not None and layout.travel:
        return layout.travel[j] / REVOLUTE_TRAVEL
    span = [(m.q[:, j].min(), m.q[:, j].max()) for m in motions if len(m.t)]
    travel = max(h for _, h in span) - min(low for low, _ in span) if span else 0.6
    return max(travel, 1e-3) / REVOLUTE_TRAVEL


def sign_of_sum(motion: Motion, j: int, source: int) -> Array:
    """(N,) sign(dq_j + dq_source), as smooth as the signs of the two joints are: tanh of the same width."""
    width = 0.0
    for k in (j, source):
        sign, dq = motion.sign_dq[:, k], motion.dq[:, k]
        inside = (np.abs(sign) > 0.05) & (np.abs(sign) < 0.95)
        if inside.any():
            width = max(width, float(np.median(dq[inside] / np.arctanh(sign[inside]))))
    total = motion.dq[:, j] + motion.dq[:, source]
    return np.tanh(total / width) if width > 0 else np.sign(total)
