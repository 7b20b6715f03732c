"""What an effect states of itself: its attributes, its parameters with their units and bounds."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal

import sympy as sp

from modelgen.effects.parameters import LinearParameter, NonlinearParameter, Quantity, State
from modelgen.effects.place import Place
from modelgen.effects.scaling import metres_per_radian, radian_power
from modelgen.errors import ModelgenError
from modelgen.geometry.names import joint_unit

Kind = Literal["column", "motion", "measurement", "load"]
ChannelKind = Literal["motor", "link", "sensor", "any"]


class EffectError(ModelgenError):
    """An effect was asked for, or evaluated, with something it does not have."""


class Definition:
    """The attributes of an effect; a subclass states those that differ."""

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
    agreement: str = "its values have to go together"  # in what, where `beyond` asks it
    contains: tuple[str, ...] = ()  # simpler effects that it is, or nearly, at special values
    one_quantity: Mapping[str, str] = {}  # a linear parameter and the shape that measures the same
    context: tuple[str, ...] = ()  # numbers of the model that `reported` uses, see `context_of`
    kind: Kind = "column"
    channel: ChannelKind = "motor"
    joints: Literal["joint", "pair", "robot"] = "joint"
    proportional: bool = True  # its torque grows with its linear parameters; a simulator scales those
    windowed: bool = False  # acts from (and to) a moment of one recording
    transient: bool = False  # ... and not all along a recording
    all_along: bool = False  # ... and only all along a recording
    on_link: bool = False  # may be said to be on a certain link
    state: State | None = None
    sizes: tuple[str, ...] = ()  # reported parameters that say how large it is; see `size_names`
    size_aliases: tuple[str, ...] = ()  # reported ones that follow from these, and fix them in a request
    typical: Mapping[str, float] = {}  # reported values of a usual robot
    shared: bool = False  # all joints may have it with one value (joints [])
    common: bool = True  # False: rarer than its rivals, to be preferred only when it fits clearly better
    told_by: tuple[str, ...] = ()  # checks of a recording that are this effect
    replaces: tuple[str, ...] = ()  # kinds of the model's own parameters that it is, ("Fcm", "Fcl")
    changes_model: bool = False  # the model's own columns change with it, see `regressor_change`
    tried: tuple[float, ...] = ()  # sizes that a search tries beside what a tangent leads to
    margin_s: float = 0.0  # s of motion either side of a block that `columns` needs and a caller cuts off
    share: float = 0.05  # rise of the joint's error, of its torque, that a simulator aims at
    window: tuple[float, float | None] | None = None  # of a recording, where a simulator puts it

    def __init__(self, **attributes: Any) -> None:
        for key, value in attributes.items():
            if not hasattr(Definition, key) and key not in Definition.__annotations__:
                raise EffectError(f"an effect has no attribute {key}.")
            setattr(self, key, value)

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

    @property
    def shifts_time(self) -> bool:
        """Whether its columns are the torque's own derivative: it says that the torque is recorded late."""
        return "dtau" in self.needs

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

    @property
    def updates(self) -> Mapping[str, sp.Expr]:
        """{state: its next value, of itself, the `step` of q and the shape parameters}: what becomes C."""
        return {} if self.state is None else {"z": self.state.update}

    def unit(self, quantity: Quantity | LinearParameter | NonlinearParameter, place: Place | None) -> str:
        """Unit of a parameter where it stands: N and m on a joint that slides."""
        if place is None or place.joint is None or getattr(quantity, "angle", False):
            return quantity.unit
        return joint_unit(quantity.unit, place.prismatic, place.source_prismatic)

    def bounds(self, place: Place) -> dict[str, tuple[float, float]]:
        """{shape parameter: (low, high)} of those that are searched there. On a slide a rad counts as a share
        of the travel, of the joint's own and of a usual one: its friction does not follow from how far it
        went. (Of a slide that went 0.3 m a Stribeck rate of 0.045 m/s was no longer in what is searched.)"""
        scales = (
            metres_per_radian(place),
            metres_per_radian(replace(place, travel=None, source_travel=None)),
        )
        out = {}
        for p in self.nonlinear:
            if p.beside in place.drive:
                continue
            power = 0 if p.angle else radian_power(p.unit)
            out[p.name] = (
                p.low * min(scale**power for scale in scales),
                p.high * max(scale**power for scale in scales),
            )
        return out
