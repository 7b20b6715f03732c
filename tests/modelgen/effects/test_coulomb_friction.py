"""coulomb_friction: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestCoulombFriction(PlainEffect):
    name = "coulomb_friction"
    measured = ("motor",)
    sides = ("motor", "sensor")
    impossible = {"Fc": -1.0}

    def expected(self, m, model, v):
        dq = m.dq[:, J]
        return v["Fc"] * np.sign(dq)
