"""gear_ripple: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestGearRipple(PlainEffect):
    name = "gear_ripple"
    impossible = {"wavenumber": -1.0}

    def expected(self, m, model, v):
        q = m.q[:, J]
        return 1.5 * np.sin(9.0 * q + 0.4) + 1.2 * np.sin(18.0 * q - 0.9)
