"""offset_drift: columns, simulation, places and spread against its formula."""

from plain_effect import PlainEffect


class TestOffsetDrift(PlainEffect):
    name = "offset_drift"
    measured = ("motor",)
    sides = ("motor", "sensor")

    def expected(self, m, model, v):
        t = m.t
        return v["slope"] * t
