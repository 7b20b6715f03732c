"""thermal_coulomb_friction: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestThermalCoulombFriction(PlainEffect):
    name = "thermal_coulomb_friction"
    context = {"Fc": 7.0}
    impossible = {"T": -1.0}

    def expected(self, m, model, v):
        t, dq = m.t, m.dq[:, J]
        return v["aFc"] * np.exp(-t / v["T"]) * np.sign(dq)
