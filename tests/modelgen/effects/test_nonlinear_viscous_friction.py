"""nonlinear_viscous_friction: columns, simulation, places and spread against its formula."""

from plain_effect import J, PlainEffect


class TestNonlinearViscousFriction(PlainEffect):
    name = "nonlinear_viscous_friction"

    def expected(self, m, model, v):
        dq = m.dq[:, J]
        return v["Fv3"] * dq**3
