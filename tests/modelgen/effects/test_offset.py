"""offset: columns, simulation, places and spread against its formula."""

from plain_effect import J, PlainEffect


class TestOffset(PlainEffect):
    name = "offset"
    measured = ("motor",)
    sides = ("motor", "sensor")

    def expected(self, m, model, v):
        q = m.q[:, J]
        return v["off"] + 0 * q
