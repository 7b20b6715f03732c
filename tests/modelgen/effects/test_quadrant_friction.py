"""quadrant_friction: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestQuadrantFriction(PlainEffect):
    name = "quadrant_friction"
    drives = False
    impossible = {"mu_brake": -0.1}

    def expected(self, m, model, v):
        dq, load = m.dq[:, J], model.link_torque(m)[:, J]
        return np.where(load * dq > 0, v["mu_drive"], v["mu_brake"]) * np.abs(load) * np.sign(dq)
