"""external_force: J^T of a force at a point of a link, inside its window only."""

import numpy as np
import pytest
from effect_model import added, arm_model, check_report, contribution, layout, motion, values_of

from modelgen.effects import effect
from modelgen.effects.effect import Place
from modelgen.effects.frames import frames

E = effect("external_force")


@pytest.mark.parametrize("link", [2, 4])
def test_columns_do_the_work_of_the_force(link):
    """F . dp/dq_k by differences of the point's position, for force components one after the other."""
    model = arm_model(("motor", "sensor"))
    m, v = motion(model, 1.0, rate=50.0), values_of(E, px=0.05, py=-0.02, pz=0.1)
    place = Place(side="link", link=link, recording="run1", start=0.2, stop=0.6)
    point, F = np.array([0.05, -0.02, 0.1]), np.array([v["FX"], v["FY"], v["FZ"]])

    def position(q):
        arm = frames(model.robot, q)
        return arm.p[:, link - 1] + arm.R[:, link - 1] @ point

    h, inside = 1e-6, (m.t >= 0.2) & (m.t < 0.6)
    seen = contribution(E, place, v, m, model)
    for k in range(4):
        step = h * np.eye(4)[k]
        expected = inside * ((position(m.q + step) - position(m.q - step)) / (2 * h) @ F)
        assert seen[:, k] == pytest.approx(expected, abs=1e-7)
        assert seen[:, k + 4] == pytest.approx(expected, abs=1e-7)
    assert added(model, m, E, place, v) == pytest.approx(seen, abs=1e-9)


def test_it_is_searched_in_each_recording():
    places = list(E.places(layout(arm_model(), ("run1", "run2"))))
    assert [p.recording for p in places] == ["run1", "run2"] and all(p.joint is None for p in places)
    assert not list(E.places(layout(arm_model(("drive",)))))
    assert E.starts(places[0], [], []) == [{"px": 0.0, "py": 0.0, "pz": 0.0}]


def test_force_alone_has_the_usual_direction():
    usual = E.usual({"force": 10.0}, {})
    assert np.hypot(np.hypot(usual["fx"], usual["fy"]), usual["fz"]) == pytest.approx(10.0)


def test_reported_spread_is_that_of_draws():
    check_report("external_force")
    assert E.physical(values_of(E)) is None


def test_parts_that_cancel_each_other_are_no_contact():
    """Of a UR10e whose positions came late 3 and -3 kN were told beside half a metre from its last link."""
    assert E.physical(values_of(E, fy=-3100.0, fz=3240.0, py=-0.5, pz=0.5)) is not None
