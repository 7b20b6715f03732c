"""load_dependent_viscous_friction: columns, simulation, places and spread against its formula."""

import numpy as np
import pytest
from effect_model import added, arm_model, check_report, contribution, first_place, layout, motion, values_of

from modelgen.effects import effect

E = effect("load_dependent_viscous_friction")
J = 1
CONTEXT = None


def expected(m, model, v):
    dq, load = m.dq[:, J], model.link_torque(m)[:, J]
    return v["muv"] * np.abs(load) * dq


def test_columns_are_the_formula_and_the_simulator_shows_them():
    model = arm_model(("motor", "sensor"), dry=False)
    m, v, place = motion(model, 3.0), values_of(E, CONTEXT), first_place(E, model)
    seen = contribution(E, place, v, m, model)
    rows = [J]
    for c in rows:
        assert seen[:, c] == pytest.approx(expected(m, model, v), rel=1e-9, abs=1e-9)
    assert not np.delete(seen, rows, axis=1).any()
    assert added(model, m, E, place, v) == pytest.approx(seen, abs=1e-8)


def test_it_stands_on_each_joint_where_the_channels_show_it():
    one, both = (list(E.places(layout(arm_model(s)))) for s in (("motor",), ("motor", "sensor")))
    assert [(p.joint, p.side) for p in one] == [(j, s) for s in ("motor",) for j in range(4)]
    assert [(p.joint, p.side) for p in both] == [(j, s) for s in ("motor", "link") for j in range(4)]
    assert not list(E.places(layout(arm_model(("drive",)))))  # which holds no torque behind the gear


def test_what_physics_forbids_is_refused():
    v = values_of(E, CONTEXT)
    assert E.physical(v) is None
    assert "muv would be negative" in E.physical({**v, "muv": -0.1})


def test_reported_spread_is_that_of_draws():
    check_report("load_dependent_viscous_friction", CONTEXT)
