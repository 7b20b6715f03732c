"""stribeck_friction: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestStribeckFriction(PlainEffect):
    name = "stribeck_friction"
    impossible = {"vs": -0.1}

    def expected(self, m, model, v):
        dq = m.dq[:, J]
        return v["Fs"] * np.exp(-((dq / v["vs"]) ** 2)) * np.sign(dq)
