"""What an effect reports of itself: whether its values can be, and values and deviations as a person reads
them."""

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np
import sympy as sp

from modelgen.effects import evaluation
from modelgen.effects.definition import Definition, EffectError
from modelgen.effects.place import Model, Place
from modelgen.geometry.robot import Robot

Array = np.ndarray
Report = dict[str, dict[str, float | str]]
Told = TypeVar("Told")


class Telling(Definition):
    """From linear and nonlinear parameters to reported ones, and back."""

    def physical(self, values: Mapping[str, float], model: Model | None = None) -> str | None:
        """Why these linear and nonlinear parameters cannot be, in one clause; None when they can."""
        for p in self.linear:
            if p.sign == "positive" and values.get(p.name, 0.0) < 0:
                return f"{p.name} would be negative"
            if p.share and abs(values.get(p.name, 0.0)) > 1:
                return f"{p.name} would be more than the whole"
        for q in self.nonlinear:
            if q.low > 0 and values.get(q.name, q.low) <= 0:
                return f"{q.name} would be negative or zero"
        return None

    def beyond(self, values: Mapping[str, float], covariance: Array, place: Place, robot: Robot) -> float:
        """How many standard deviations these values are from the nearest that can be, where several of them
        have to agree; 0: not at all. covariance: of the linear parameters in use at the place; of those
        that are held at zero there is no value."""
        return 0.0

    def against(self, values: Mapping[str, float], covariance: Array, place: Place, model: Model) -> float:
        """Nats that the nearest values that physics allows are behind these; infinite where none are near."""
        if self.physical(values, model) is not None:
            return np.inf
        return 0.5 * self.beyond(values, covariance, place, model.robot) ** 2

    def context_of(self, place: Place, model: Model) -> dict[str, float]:
        """Numbers of the model that `report` is relative to: of "Fv" the joint's Fvm, or else Fvl."""
        return self.of_context(place, model.number)

    def of_context(self, place: Place, told: Callable[[str, int], Told | None]) -> dict[str, Told]:
        """What is told, by kind and joint, of the drive parameters that `report` is relative to."""
        out = {}
        for name in self.context:
            sides = ("l", "m") if place.side in ("sensor", "link") else ("m", "l")
            found = [its for side in sides if (its := told(f"{name}{side}", place.joint or 0)) is not None]
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

        hidden = {p.name for p in self.nonlinear if p.beside} - set(reported)
        usual = self.complete(None)
        shapes = {n: usual[n] if n in hidden else value(n) for n in self.nonlinear_names}
        return {n: value(n) for n in self.linear_names}, shapes

    def _measured_twice(
        self, names: Sequence[str], values: Mapping[str, float], covariance: Array
    ) -> tuple[Mapping[str, float], Array]:
        """Sizes that a shape measures too, as both say together: weights that leave least variance, and as
        many times the deviation as the two are further apart than theirs allow (R. T. Birge, Phys. Rev. 40,
        1932): what the columns are wrong by, either measures in its own way. (Beside the impacts of 14 mrad
        of a gear's play the two were 18 and 6, and their mean 7.4 +- 0.5.)"""
        for size, shape in self.one_quantity.items():
            i, j = names.index(size), names.index(shape)
            own, other, both = covariance[i, i], covariance[j, j], covariance[i, j]
            if size not in values or not other > 0:
                continue
            apart = own + other - 2 * both
            w, distance = 0.0, 0.0
            if own > 0 and apart > 0:
                w = float(np.clip((other - both) / apart, 0.0, 1.0))
                distance = (values[size] - values[shape]) / np.sqrt(apart)
            change = np.eye(len(covariance))
            change[i, i], change[i, j] = w, 1.0 - w
            change[i] *= max(1.0, abs(distance))
            covariance = change @ covariance @ change.T
            values = {**values, size: w * values[size] + (1.0 - w) * values[shape]}
        return values, covariance

    def remedy_with(self, values: Mapping[str, float]) -> str:
        """What a person does about it, with the reported values where these are what has to be written."""
        return self.remedy

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
        were held fixed; None gives std 0. What depends on an absent one is not reported. A quantity that a
        size and a shape measure (`one_quantity`) is their mean as they are known.
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
        values, full = self._measured_twice(names, values, full)
        numbers, std = evaluation.told(self, {**values, **(context or {})}, full)
        return {
            quantity.name: {"value": float(v), "std": float(s), "unit": self.unit(quantity, place)}
            for quantity, v, s in zip(self.quantities, numbers, std)
            if not absent & {symbol.name for symbol in quantity.expression.free_symbols}
        }
