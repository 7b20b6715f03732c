"""viscous_friction: columns, simulation, places and spread against its formula."""

from plain_effect import J, PlainEffect


class TestViscousFriction(PlainEffect):
    name = "viscous_friction"
    measured = ("motor",)
    sides = ("motor", "sensor")
    impossible = {"Fv": -1.0}

    def expected(self, m, model, v):
        dq = m.dq[:, J]
        return v["Fv"] * dq
