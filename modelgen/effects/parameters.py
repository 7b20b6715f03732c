"""What an effect is made of, as values: the signals of its terms, its parameters, what it reports, its
state."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import sympy as sp

Array = np.ndarray
SignRule = Literal["positive", "any"]


class Signals:
    """Symbols that a term may use. All of joint j, joint side, SI units, unless a name says `source`."""

    t = sp.Symbol("t", real=True)  # s since the first sample of the recording
    q = sp.Symbol("q", real=True)
    dq = sp.Symbol("dq", real=True)
    ddq = sp.Symbol("ddq", real=True)
    sign_dq = sp.Symbol("sign_dq", real=True)  # sign(dq), or its smoothed form
    tau_link = sp.Symbol("tau_link", real=True)  # torque the gear passes to the link
    friction = sp.Symbol("friction", real=True)  # Fv dq + Fc sign(dq) of the joint; not in tau_link then
    offset = sp.Symbol("offset", real=True)  # constant torque of the joint; not in tau_link either
    tau = sp.Symbol("tau", real=True)  # the channel the effect disturbs, undisturbed
    dtau = sp.Symbol("dtau", real=True)  # its time derivative
    q_source = sp.Symbol("q_source", real=True)  # of the other joint of a pair
    dq_source = sp.Symbol("dq_source", real=True)
    ddq_source = sp.Symbol("ddq_source", real=True)
    sign_sum = sp.Symbol("sign_sum", real=True)  # sign(dq + dq_source)
    tau_source = sp.Symbol("tau_source", real=True)
    gate = sp.Symbol("gate", real=True)  # 1 inside the window of a load, 0 outside
    z = sp.Symbol("z", real=True)  # the effect's own state
    za = sp.Symbol("za", real=True)  # states of an effect that has three
    zb = sp.Symbol("zb", real=True)
    zc = sp.Symbol("zc", real=True)
    step = sp.Symbol("step", real=True)  # change of q since the previous sample


SIGNALS = Signals
STATES = ("z", "za", "zb", "zc")


@dataclass(frozen=True)
class LinearParameter:
    """A parameter that multiplies a column. `low`, `high`: plausible size; `sign`: what physics allows.
    `share`: a part of what another signal is, so that more than the whole of it cannot be. `simpler`: with
    this one alone it would be a simpler effect of the catalogue.

    Units are those of a revolute joint; :func:`modelgen.geometry.names.joint_unit` gives a prismatic one's.
    """

    name: str
    unit: str
    low: float
    high: float
    sign: SignRule = "any"
    optional: bool = False  # a candidate may leave this term out
    share: bool = False
    simpler: bool = False

    @property
    def own(self) -> bool:
        """Whether the effect would be another one without it."""
        return not (self.optional or self.simpler)

    @property
    def symbol(self) -> sp.Symbol:
        return sp.Symbol(self.name, real=True)


@dataclass(frozen=True)
class NonlinearParameter:
    """A shape parameter, inside a term: searched on `grid` and refined inside [low, high].

    `angle`: its rad is an angle also where the joint slides (a phase, a roll of the base). `beside`: kind of
    drive parameter ("Iam") whose hidden part it is: where the model has that parameter at the joint it stays
    at the middle of its grid and is no parameter.
    """

    name: str
    unit: str
    low: float
    high: float
    grid: tuple[float, ...]
    angle: bool = False
    beside: str = ""

    @property
    def symbol(self) -> sp.Symbol:
        return sp.Symbol(self.name, real=True)


@dataclass(frozen=True)
class Quantity:
    """A number the user is told: an expression in the linear, nonlinear and context parameters."""

    name: str
    unit: str
    expression: sp.Expr
    angle: bool = False  # rad stays rad where the joint slides


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
