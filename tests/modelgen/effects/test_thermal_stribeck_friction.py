"""thermal_stribeck_friction: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestThermalStribeckFriction(PlainEffect):
    name = "thermal_stribeck_friction"
    impossible = {"Fs": -1.0}

    def expected(self, m, model, v):
        t, dq = m.t, m.dq[:, J]
        return v["Fs"] * np.exp(-t / v["T"]) * np.exp(-((dq / v["vs"]) ** 2)) * np.sign(dq)
