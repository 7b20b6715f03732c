"""quadratic_friction: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestQuadraticFriction(PlainEffect):
    name = "quadratic_friction"

    def expected(self, m, model, v):
        dq = m.dq[:, J]
        return v["Fv2"] * np.where(dq > 0, dq**2, -(dq**2))
