"""How base parameters are made of standard ones, and which of them no physical robot has below zero."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ident.errors import IdentError
from ident.export.bodies import body
from ident.export.saved import SavedFit
from modelgen.dynamics.newton_euler import INERTIAL
from modelgen.geometry.robot import Robot


class ExportError(IdentError):
    """A fit that cannot be written in the wanted form, or a missing extra: the reason and the remedy."""


@dataclass(frozen=True, slots=True)
class Combination:
    """G (b, p): base parameters of a fit from standard ones `names` (p,), the first 10 per link bodies."""

    names: tuple[str, ...]
    G: np.ndarray
    links: int
    not_negative: np.ndarray  # (p,) bool
    rotors: np.ndarray  # (p,) bool: seen only together with links, so they need a prior
    solid: np.ndarray  # (links,) bool: rows with a body; a URDF's rows between two axes have none


def combination(fit: SavedFit, robot: Robot) -> Combination:
    """Lay out a fit's base parameters on the standard parameters of its robot. Payloads stay themselves."""
    model, base = fit.columns.model, fit.columns.parameters
    rules: dict[str, dict[str, float]] = model._description["regroup"]
    links = len(robot.links)
    names = [f"{kind}{j}" for j in range(1, links + 1) for kind in INERTIAL]
    bodies = set(names)
    rows = []
    for name in base:
        rule = rules.get(name, {name: 1.0})
        if not any(part in bodies or part.startswith("Iam") for part in rule):
            rule = {name: 1.0}  # friction of both sides, a payload's parameter: one number
        rows.append(rule)
        names += [part for part in rule if part not in names]
    place = {name: k for k, name in enumerate(names)}
    G = np.zeros((len(base), len(names)))
    for k, rule in enumerate(rows):
        for part, coefficient in rule.items():
            G[k, place[part]] = coefficient
    drive = np.array([name not in bodies for name in names])
    alone = np.array([all(len(rule) == 1 for rule in rows if name in rule) for name in names])
    sign = np.array([name.startswith(("Iam", "Fv", "Fc", "Iac", "Ial")) for name in names]) & drive
    rotor = np.array([name.startswith("Iam") for name in names]) & ~alone
    given = robot.standard_values
    solid = np.array([not given or f"M{j}" in given for j in range(1, links + 1)])
    return Combination(tuple(names), G, links, sign, rotor, solid)


def functional(k: int) -> np.ndarray:
    """(4, 4) symmetric m with phi_k = tr(m P)."""
    m = np.zeros((4, 4))
    for i in range(4):
        for l in range(4):
            unit = np.zeros((4, 4))
            unit[i, l] = 1.0
            m[i, l] = body((unit + unit.T) / 2)[k]
    return m


def never_negative(c: Combination, k: int) -> bool:
    """Whether base parameter k is >= 0 for every physical robot: its functional is positive on every body."""
    row = c.G[k]
    drives = row[10 * c.links :]
    if np.any(drives < 0) or np.any((drives > 0) & ~c.not_negative[10 * c.links :]):
        return False
    maps = np.array([functional(i) for i in range(10)])
    bodies = row[: 10 * c.links].reshape(-1, 10)
    return all(np.linalg.eigvalsh(np.tensordot(g, maps, 1))[0] >= -1e-9 for g in bodies)
