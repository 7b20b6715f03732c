"""Whether a motion shows a robot's base parameters: condition of W, and the columns that stand apart least.

W is that of the fit, row for row (position filter, decimation), with every column scaled to unit length, so
that units do not matter. A column's inflation is how much wider its parameter's interval is than it would be
if no other column resembled it: the root of the diagonal of (W' W)^-1, the variance inflation factor's root
(Belsley, Kuh, Welsch 1980). Torques are not used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ident.equations.build import HIGHEST, build
from ident.equations.observation import stack
from ident.equations.prepared import Prepared
from modelgen.geometry.names import ParameterName

CUTOFF_HZ = 2.0
SHOWN = 6
UNSEEN = 1e-3  # of the largest singular value: below it torque known to one part in a thousand says nothing
HARD = 30.0  # condition number from which single columns are named (the book's 30 for strong dependence)


@dataclass(frozen=True, slots=True)
class Weak:
    """A parameter that the motion hardly shows apart from others; inflation is infinite where not at all."""

    parameter: str
    inflation: float
    remedy: str


@dataclass(frozen=True, slots=True)
class Excitation:
    """Of the recordings with use: identify, all channels together."""

    parameters: int
    rank: int
    condition: float
    weakest: tuple[Weak, ...]

    @property
    def sentence(self) -> str:
        if self.rank < self.parameters:
            unseen = self.parameters - self.rank
            return (
                f"The motion does not show {unseen} of {self.parameters} base parameters "
                f"(first of them {self.weakest[0].parameter}): {self.weakest[0].remedy}."
            )
        text = (
            f"The motion shows all {self.parameters} base parameters, condition number {self.condition:.3g}"
        )
        if self.condition < HARD:
            return f"{text}."
        weak = self.weakest[0]
        return f"{text}; least {weak.parameter} (interval {weak.inflation:.0f} times wider): {weak.remedy}."


def excitation(prepared: Prepared) -> Excitation:
    """Of a study whose recordings are open. Raises IdentError where nothing of a recording is left."""
    slowest = min(stream.rate_hz for stream in prepared.streams)
    systems = build(prepared, min(CUTOFF_HZ, HIGHEST * slowest), roles=("identify",))
    names = prepared.columns.parameters
    rows = []
    for factor in stack(systems):
        R = np.zeros((len(factor.R), len(names)))
        R[:, factor.columns] = factor.R[:, :-1]
        rows.append(R)
    return of_matrix(np.vstack(rows), names)


def of_matrix(W: np.ndarray, names: Sequence[str]) -> Excitation:
    """W (rows, b), or any matrix with the same W' W."""
    length = np.linalg.norm(W, axis=0)
    seen = length > 1e-9 * length.max(initial=0.0)
    scaled = W[:, seen] / length[seen]
    _, s, V = np.linalg.svd(scaled, full_matrices=False)
    clear = s > UNSEEN * s.max(initial=0.0)
    inflation = np.full(len(names), np.inf)
    inside = np.sqrt(((V[clear] / s[clear, None]) ** 2).sum(axis=0))
    lost = (V[~clear] ** 2).sum(axis=0) > 1e-6  # has a part in a direction that is not seen
    inflation[seen] = np.where(lost, np.inf, inside)
    order = np.argsort(-inflation, kind="stable")[:SHOWN]
    weakest = tuple(Weak(names[k], float(inflation[k]), _remedy(names[k])) for k in order)
    rank = int(clear.sum())
    condition = float(s.max(initial=0.0) / s[clear].min()) if rank else np.inf
    return Excitation(len(names), rank, condition if rank == len(names) else np.inf, weakest)


def _remedy(name: str) -> str:
    """What motion shows this parameter better."""
    parameter = ParameterName.of(name)
    if parameter is None:
        return "vary the motion more"
    kind, label = parameter.kind, parameter.label
    if kind.startswith("Fv"):
        return f"move joint {label} at several speeds, slow to fast"
    if kind.startswith(("Fc", "Off")):
        return f"move joint {label} to and fro, also slowly"
    if kind.startswith("Ia"):
        return f"accelerate joint {label} harder, with the joints behind it in several poses"
    if kind.startswith("M"):
        return f"hold and move link {label} in more poses against gravity"
    return f"turn the joints up to link {label} fast and together, in several poses"
