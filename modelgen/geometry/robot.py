"""A robot as a value: rows of Khalil's modified Denavit-Hartenberg (MDH) table, gravity, named constants.

Row j places frame j in the frame of its antecedent a(j) (Khalil and Kleinfinger 1986):

    T(a(j), j) = Rot_z(gamma) Trans_z(b) Rot_x(alpha) Trans_x(d) Rot_z(theta) Trans_z(r)

with theta = q + constant on a revolute joint (sigma 0), r = q + constant on a prismatic one (sigma 1), and
both constant on a fixed one (sigma 2). Angles rad, lengths m, gravity m/s^2 in the base frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import sympy as sp

from modelgen.geometry import plausible

ZERO: sp.Expr = sp.Integer(0)
BESIDE = 1e-3  # rad
SIGMA = {"revolute": 0, "prismatic": 1, "fixed": 2}


@dataclass(frozen=True, slots=True)
class Limits:
    """What a joint can do: position (lo, hi), speed, acceleration, torque; SI units, None if not stated."""

    q: tuple[float, float] | None = None
    dq: float | None = None
    ddq: float | None = None
    tau: float | None = None


@dataclass(frozen=True, slots=True)
class Link:
    """Row j of the MDH table; `theta` and `r` are the constant parts, without the joint variable."""

    name: str
    joint: str  # "revolute" | "prismatic" | "fixed"
    antecedent: int  # a(j); 0 is the base
    gamma: sp.Expr = ZERO
    b: sp.Expr = ZERO
    alpha: sp.Expr = ZERO
    d: sp.Expr = ZERO
    theta: sp.Expr = ZERO
    r: sp.Expr = ZERO
    variable: str | None = None  # "q3", as the file writes it
    limits: Limits | None = None

    @property
    def sigma(self) -> int:
        """0 revolute, 1 prismatic, 2 fixed."""
        return SIGMA[self.joint]


@dataclass(frozen=True)
class Robot:
    """An MDH table with its gravity; links are counted from 1, row 0 being the base."""

    name: str
    gravity: tuple[sp.Expr, sp.Expr, sp.Expr]
    links: tuple[Link, ...]
    constants: Mapping[str, sp.Expr] = field(default_factory=dict)
    payloads: Mapping[str, int] = field(default_factory=dict)
    source_sha256: str = ""
    standard_values: Mapping[str, float] = field(default_factory=dict)  # {"XX1": ...}, if the file has them
    notes: tuple[str, ...] = ()  # what reading the file changed

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Row numbers of the moving joints, in the order of q."""
        return tuple(j for j, link in enumerate(self.links, 1) if link.sigma != 2)

    @property
    def n(self) -> int:
        """Number of moving joints."""
        return len(self.moving)

    @cached_property
    def variables(self) -> tuple[str, ...]:
        """Joint variables ("q1", ...) in the order of the moving rows."""
        return tuple(str(self.links[j - 1].variable) for j in self.moving)

    @cached_property
    def joint_labels(self) -> tuple[str, ...]:
        """The k of q_k, tau_k, Iam_k ... for each moving joint."""
        return tuple(variable[1:] for variable in self.variables)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """The moving joints' own names where the file gives them, else their variables."""
        rows = ((j, self.links[j - 1]) for j in self.moving)
        return tuple(str(link.variable) if link.name == f"link{j}" else link.name for j, link in rows)

    def link(self, j: int) -> Link:
        """Row j, counted from 1."""
        return self.links[j - 1]

    def ancestors(self, j: int) -> tuple[int, ...]:
        """Rows on the way from link j to the base: j itself first, row 0 excluded."""
        way = []
        while j:
            way.append(j)
            j = self.links[j - 1].antecedent
        return tuple(way)

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """Legal but seldom meant: not Earth's gravity, an angle beside a right angle (a decimal)."""
        found = list(self.notes)
        if odd := plausible.odd_gravity([float(self.value(g)) for g in self.gravity]):
            found.append(odd)
        for j, link in enumerate(self.links, 1):
            for key in ("gamma", "alpha", "theta"):
                angle = self.value(getattr(link, key))
                quarters = round(float(angle) / (math.pi / 2))
                beside = angle - quarters * sp.pi / 2
                if beside != 0 and abs(float(beside)) < BESIDE and (key != "theta" or link.sigma != 0):
                    near = sp.sstr(quarters * sp.pi / 2)
                    found.append(
                        f"link {j}, {key} is not exactly {near}, and the model has more parameters for it; "
                        f"write {near} if that is meant"
                    )
        return tuple(found)

    def with_gravity(self, gravity: Sequence[float]) -> Robot:
        """The same robot under another gravity: three numbers, m/s^2 in the base frame, as they print."""
        x, y, z = (sp.Rational(repr(float(value))) for value in gravity)
        return replace(self, gravity=(x, y, z))

    def payload_link(self, label: str) -> int:
        """Row that carries payload `label`: the declared one, else the last link."""
        return self.payloads.get(label, len(self.links))

    def value(self, expression: sp.Expr) -> sp.Expr:
        """`expression` with the named constants replaced by their values, still exact."""
        return expression.xreplace({sp.Symbol(k, real=True): v for k, v in self.constants.items()})
