"""position_dependent_friction: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestPositionDependentFriction(PlainEffect):
    name = "position_dependent_friction"
    impossible = {"wavenumber": -1.0}

    def expected(self, m, model, v):
        q, dq = m.q[:, J], m.dq[:, J]
        return np.hypot(v["Fqs"], v["Fqc"]) * np.sin(2.0 * q + 0.5) * np.sign(dq)
