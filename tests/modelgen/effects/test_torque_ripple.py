"""torque_ripple: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestTorqueRipple(PlainEffect):
    name = "torque_ripple"
    impossible = {"wavenumber": -1.0}

    def expected(self, m, model, v):
        q = m.q[:, J]
        return 2.0 * np.sin(12.0 * q + 0.7)
