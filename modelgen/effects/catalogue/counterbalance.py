"""A gas or coil spring between two points of neighbouring links: torque with a geometry in it."""

from collections.abc import Iterable

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, NonlinearParameter
from modelgen.effects.place import Layout, Place

q0, rho = sp.symbols("q0 rho", real=True)
x = SIGNALS.q - q0


# Ends at a and b from the axis: length^2 = a^2 + b^2 - 2 a b cos x ~ 1 - rho cos x.
# A spring of rate K and free length l0 gives K a b sin x (1 - l0/length); a gas spring the second part.
class Counterbalance(Effect):
    """A gas or coil spring between two points of neighbouring links: torque with a geometry in it."""

    name = "counterbalance"
    summary = "a balancing spring or gas cylinder between two links"
    signature = (
        "smooth in the position and repeatable, with harmonics of the joint angle that gravity has not"
    )
    source = (
        "Weigand, Goetz, Ulmen, Ruskowski, Dataset and baseline for an industrial robot identification "
        "benchmark, 2023 (hydraulic counterbalance of a KR300); Khalil and Dombre 2002"
    )
    remedy = "add its term to the model, with the spring's geometry from its data sheet where known"
    terms = {"Kab": sp.sin(x), "Kl": sp.sin(x) / sp.sqrt(1 - rho * sp.cos(x))}
    linear = (
        LinearParameter(
            "Kab", "N m", -1e4, 1e4, optional=True
        ),  # gravity in the model absorbs it, where it acts
        LinearParameter("Kl", "N m", -1e4, 1e4),
    )
    nonlinear = (
        NonlinearParameter("q0", "rad", -3.2, 3.2, tuple(-3.0 + 0.5 * i for i in range(13))),
        NonlinearParameter("rho", "-", 0.2, 0.98, (0.4, 0.65, 0.85, 0.95)),
    )
    channel = "link"
    typical = {"Kab": 5.0, "Kl": -10.0, "q0": 0.3, "rho": 0.85}
    common = False

    def variants(self) -> tuple[tuple[str, ...], ...]:
        """A gas spring, or a coil spring where gravity does not act like its first part."""
        return (("Kl",), ("Kab", "Kl"))

    def places(self, layout: Layout) -> Iterable[Place]:
        """Joints that turn."""
        return [place for place in super().places(layout) if not place.prismatic]


EFFECT = Counterbalance()
