"""load_dependent_friction: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestLoadDependentFriction(PlainEffect):
    name = "load_dependent_friction"
    drives = False
    impossible = {"mu": -0.1}

    def expected(self, m, model, v):
        dq, load = m.dq[:, J], model.link_torque(m)[:, J]
        return v["mu"] * np.abs(load) * np.sign(dq)
