"""What is asked of every effect that adds a formula to the torque of its own joint."""

import numpy as np
import pytest
from effect_model import added, arm_model, check_report, contribution, first_place, layout, motion, values_of

from modelgen.effects import effect

J = 1  # the joint that it is put on


class PlainEffect:
    """Tests for one effect. A subclass states its name, its formula and what of the rest differs."""

    name: str
    context: dict[str, float] | None = None
    measured: tuple[str, ...] = ("motor", "sensor")
    behind: bool = False  # acts behind the gear: motor and sensor both show it
    sides: tuple[str, ...] = ("motor", "link")  # where it may stand beside a sensor
    drives: bool = True  # whether tau_m - tau_l shows it
    absent: tuple[str, ...] = ()  # parameters left at zero: the model absorbs them
    impossible: dict[str, float] = {}  # a value that physics forbids

    def expected(self, m, model, v):
        """(N,) torque in joint J of a motion, by a formula written here."""
        raise NotImplementedError

    def test_columns_are_the_formula_and_the_simulator_shows_them(self):
        e, model = effect(self.name), arm_model(self.measured, dry=False)
        m, place = motion(model, 3.0), first_place(e, model)
        v = values_of(e, self.context) | dict.fromkeys(self.absent, 0.0)
        seen, rows = contribution(e, place, v, m, model), [J, J + 4] if self.behind else [J]
        for c in rows:
            assert seen[:, c] == pytest.approx(self.expected(m, model, v), rel=1e-9, abs=1e-9)
        assert not np.delete(seen, rows, axis=1).any()
        assert added(model, m, e, place, v) == pytest.approx(seen, abs=1e-8)

    def test_it_stands_on_each_joint_where_the_channels_show_it(self):
        places = {
            sides: list(
                dict.fromkeys((p.joint, p.side) for p in effect(self.name).places(layout(arm_model(sides))))
            )
            for sides in (("motor",), ("motor", "sensor"), ("drive",))
        }
        assert places[("motor",)] == [(j, "link" if self.behind else "motor") for j in range(4)]
        assert places[("motor", "sensor")] == [(j, side) for side in self.sides for j in range(4)]
        assert bool(places[("drive",)]) == self.drives

    def test_what_physics_forbids_is_refused(self):
        e = effect(self.name)
        v = values_of(e, self.context)
        assert e.physical(v) is None
        for name, value in self.impossible.items():
            assert f"{name} would be negative" in e.physical({**v, name: value})

    def test_reported_spread_is_that_of_draws(self):
        check_report(self.name, self.context)
