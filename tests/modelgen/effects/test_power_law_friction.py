"""power_law_friction: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestPowerLawFriction(PlainEffect):
    name = "power_law_friction"
    impossible = {"Fp": -1.0}

    def expected(self, m, model, v):
        dq = m.dq[:, J]
        return v["Fp"] * (dq**2 + 1e-8) ** (v["p"] / 2) * np.sign(dq)
