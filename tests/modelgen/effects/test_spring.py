"""spring: columns, simulation, places and spread against its formula."""

from plain_effect import J, PlainEffect


class TestSpring(PlainEffect):
    name = "spring"
    behind = True
    sides = ("link", "motor")
    drives = False
    absent = ("c",)
    impossible = {"k": -1.0}

    def expected(self, m, model, v):
        q = m.q[:, J]
        return v["k"] * q
