"""counterbalance: columns, simulation, places and spread against its formula."""

import numpy as np
from plain_effect import J, PlainEffect


class TestCounterbalance(PlainEffect):
    name = "counterbalance"
    behind = True
    sides = ("link",)
    drives = False
    absent = ("Kab",)
    impossible = {"rho": -0.5}

    def expected(self, m, model, v):
        q = m.q[:, J]
        return (v["Kab"] + v["Kl"] / np.sqrt(1 - v["rho"] * np.cos(q - v["q0"]))) * np.sin(q - v["q0"])
