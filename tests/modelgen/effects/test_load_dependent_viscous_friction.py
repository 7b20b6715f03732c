"""load_dependent_viscous_friction: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestLoadDependentViscousFriction(PlainEffect):
    name = "load_dependent_viscous_friction"
    drives = False
    impossible = {"muv": -0.1}

    def expected(self, m, model, v):
        dq, load = m.dq[:, J], model.link_torque(m)[:, J]
        return v["muv"] * np.abs(load) * dq
