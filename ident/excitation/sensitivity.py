"""How large an effect must be to be seen: the smallest size that a motion and a noise show.

Of an effect of torque F(size), the part that the base model cannot absorb has the noncentrality

    lambda(size) = seconds * rows a second * mean over time of |(F - W d) / sigma|^2,   smallest over d

and a likelihood-ratio test of level alpha with p parameters finds it with probability `power` from the lambda
on that `needed` gives: P(chi2_p(lambda) > chi2_p quantile of 1 - alpha) = power. Rows are low-passed as an
identification does it; shape parameters are those of a usual robot, and said.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import scipy.optimize
import scipy.stats

from ident.equations.terms import Term
from ident.errors import IdentError
from ident.excitation.known import ROWS_HZ, Known, usual_term
from ident.excitation.limits import Bounds
from ident.excitation.separate import Projector
from ident.progress import Progress, silent
from ident.twin.requests import parse_effect
from ident.twin.twin import placed
from modelgen.effects import catalogue
from modelgen.effects.place import Motion

BAND_HZ = 10.0
FINE_HZ = 250.0  # at which motions are looked at here; one row in TEN is kept
TEN = 10
RANGE = 1e6  # of a usual size, up and down


@dataclass(frozen=True)
class Visible:
    """Smallest visible size of an effect at a place: reported values, units; None where no size is seen.

    share: of the joint's rms torque that an effect of this size makes."""

    effect: str
    joints: tuple[str, ...]
    values: dict[str, float] | None
    units: dict[str, str]
    sizes: tuple[str, ...]
    share: float

    @property
    def told(self) -> str:
        """'Fs = 0.3 N m at vs = 0.1 rad/s': the size, and the shape that it was asked for."""
        values = self.values or {}
        parts = {
            name: f"{name} = {value:.3g} {self.units[name]}".rstrip(" -") for name, value in values.items()
        }
        shape = ", ".join(part for name, part in parts.items() if name not in self.sizes)
        size = ", ".join(parts[name] for name in self.sizes if name in parts)
        return f"{size} at {shape}" if size and shape else size or shape

    @property
    def sentence(self) -> str:
        where = f" in joint {', '.join(self.joints)}" if self.joints else ""
        if self.values is None:
            return f"{self.effect}{where} is not expected to show in this motion."
        return f"{self.effect}{where} as large as {self.told} would have been seen."


@cache
def needed(parameters: int, alpha: float = 0.01, power: float = 0.95) -> float:
    """The noncentrality of a chi-square test of that many parameters with this level and power."""
    limit = scipy.stats.chi2.isf(alpha, parameters)
    return float(
        scipy.optimize.brentq(lambda nc: scipy.stats.ncx2.sf(limit, parameters, nc) - power, 1e-6, 1e4)
    )


def projector(known: Known, motion: Motion, sigma: np.ndarray) -> Projector:
    """Of a motion sampled at FINE_HZ."""
    return Projector(known, motion, sigma, BAND_HZ, TEN)


def smallest_visible(
    project: Projector, term: Term, seconds: float, noncentrality: float | None = None
) -> Visible:
    """The smallest size of a term whose shape is given. `noncentrality`: by default that of `needed`."""
    aim = noncentrality or needed(len(term.linear) + len(term.free))
    rms = project.rms
    total = seconds * ROWS_HZ / project.instants

    def scaled(factor: float) -> Term:
        if not term.size:  # an effect of shape parameters alone, as a tilt
            return replace(term, theta={name: factor * value for name, value in term.theta.items()})
        return replace(term, size=tuple(factor * value for value in term.size))

    def shown(torque: np.ndarray) -> float:
        return total * float(np.sum(project.off(torque) ** 2))

    def shown_at(decade: float) -> float:
        return shown(project.torque(scaled(10**decade)))

    torque = project.torque(term)
    whole, here = total * float(np.sum(torque**2)), shown(torque)
    factor = np.sqrt(aim / max(here, 1e-300))
    if not term.effect.proportional:  # not a square law: searched between decades
        decades = np.arange(-4.5, 3.5, 0.5)
        first = next((d for d in decades if shown_at(d) >= aim), np.inf)
        if decades[0] < first < np.inf:
            first = scipy.optimize.brentq(lambda d: shown_at(d) - aim, first - 0.5, first, xtol=1e-4)
        factor = 10**first
    hidden = here <= 1e-9 * whole
    joints = tuple(term.label.split(":")[1:])
    if hidden or not factor < RANGE:
        return Visible(term.effect.name, joints, None, {}, term.effect.size_names, float("inf"))
    at = scaled(float(factor))
    values = {**dict.fromkeys(term.effect.linear_names, 0.0), **dict(zip(at.linear, at.size)), **at.theta}
    context = project.known.context(term.effect, term.place)
    report = term.effect.report(values, None, context, term.place)
    told = {name: float(entry["value"]) for name, entry in report.items()}
    its = factor * torque if term.effect.proportional and term.size else project.torque(at)
    per_channel = its.reshape(-1, len(rms))
    share = float(np.max(np.sqrt(np.mean(per_channel**2, axis=0)) / np.maximum(rms, 1e-12)))
    units = {name: str(entry["unit"]) for name, entry in report.items()}
    return Visible(term.effect.name, joints, told, units, term.effect.size_names, share)


def usual_terms(known: Known, bounds: Bounds, motion: Motion) -> Iterator[Term]:
    """Every effect beyond the model's own at every joint that may have it, at usual values."""
    for effect in catalogue().values():
        if effect.replaces or effect.all_along or not (effect.linear or effect.nonlinear):
            continue  # what is there all along is part of the robot
        for label in ("",) if effect.joints == "robot" else known.robot.joint_labels:
            try:
                request = parse_effect(f"{effect.name}:{label}", known.robot)
                place = placed(request, known.robot, known.model.model)
            except IdentError:
                continue  # this model's torques do not show it, or the robot has no second joint
            if effect.windowed:
                start, stop = effect.window or (0.5, None)
                last = float(motion.t[-1])
                place = replace(place, start=start * last, stop=None if stop is None else stop * last)
            yield usual_term(known, effect, place, bounds, motion)


def table(
    known: Known,
    bounds: Bounds,
    motion: Motion,
    sigma: np.ndarray,
    seconds: float,
    progress: Progress = silent,
    stop: Callable[[], bool] = lambda: False,
) -> tuple[Visible, ...]:
    """The smallest visible size of every effect and joint, until told to stop; `motion` at FINE_HZ stands for
    `seconds` of it."""
    project, terms = projector(known, motion, sigma), list(usual_terms(known, bounds, motion))
    out: list[Visible] = []
    for k, term in enumerate(terms):
        if stop():
            break
        progress(f"sensitivity to {term.effect.name}", k / len(terms))
        out.append(smallest_visible(project, term, seconds))
    return tuple(out)
