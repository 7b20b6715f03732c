"""A linear spring between two links: a hose, a cable bundle, a balancing spring."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, Quantity
from modelgen.effects.place import Layout, PlaceSide

k, q0, c = sp.symbols("k q0 c", real=True)


class Spring(Effect):
    """A linear spring between two links: a hose, a cable bundle, a balancing spring."""

    name = "spring"
    summary = "a torque proportional to the position, as of a cable bundle or a balancing spring"
    signature = "a straight line against the position that gravity, periodic in it, does not explain"
    source = "Khalil and Dombre, Modeling, identification and control of robots, 2002 (balancing springs)"
    remedy = "add its term to the model; check cables and hoses that pull on the joint"
    terms = {"k": SIGNALS.q, "c": sp.Integer(1)}
    linear = (
        LinearParameter("k", "N m/rad", 0.0, 500.0, "positive"),
        LinearParameter("c", "N m", -500.0, 500.0, optional=True),  # an offset in the model absorbs it
    )
    reported = (Quantity("k", "N m/rad", k), Quantity("q0", "rad", -c / k))
    inverse = {"c": -k * q0}
    channel = "link"
    typical = {"k": 8.0, "q0": 0.2}

    def sides(self, layout: Layout) -> tuple[PlaceSide, ...]:
        """Before the gear as well where both torques are measured: a hose that pulls on the drive's side is
        no part of what the sensor sees."""
        both = {"motor", "sensor"} <= layout.sides
        return ("link", "motor") if both else super().sides(layout)


EFFECT = Spring()
