"""thermal_friction: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestThermalFriction(PlainEffect):
    name = "thermal_friction"
    context = {"Fv": 7.0}
    impossible = {"aFv": -1.0}

    def expected(self, m, model, v):
        t, dq = m.t, m.dq[:, J]
        return v["aFv"] * np.exp(-t / v["T"]) * dq
