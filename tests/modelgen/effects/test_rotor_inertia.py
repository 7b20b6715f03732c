"""rotor_inertia: columns, simulation, places and spread against its formula."""

from plain_effect import J, PlainEffect


class TestRotorInertia(PlainEffect):
    name = "rotor_inertia"
    impossible = {"Ia": -1.0}

    def expected(self, m, model, v):
        ddq = m.ddq[:, J]
        return v["Ia"] * ddq
