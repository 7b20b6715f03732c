"""asymmetric_friction: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestAsymmetricFriction(PlainEffect):
    name = "asymmetric_friction"

    def expected(self, m, model, v):
        dq = m.dq[:, J]
        return v["Fva"] * np.abs(dq)
