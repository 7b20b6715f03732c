"""base_tilt: turned gravity by any angle is exact, is found from any angle, and is told with its vector."""

from dataclasses import replace

import numpy as np
import pytest
from effect_model import added, arm_model, check_report, layout, motion, recorded, simulated, values_of

from modelgen.effects import effect
from modelgen.effects.gravity_search import newly_visible, standard_columns, with_gravity
from modelgen.effects.loads import tilt_of, tilted
from modelgen.geometry.robot_file import load_robot

E = effect("base_tilt")
DOWN = np.array([0.0, 0.0, -9.81])
CONTEXT = dict(zip(E.context, DOWN))
ANGLES = [(0.03, -0.04), (np.pi / 2, 0.0), (0.0, np.pi / 2), (np.pi, 0.0), (-1.2, 0.7), (2.8, -0.2)]


def place_of(model):
    (place,) = E.places(layout(model))
    return place


@pytest.mark.parametrize("roll, pitch", ANGLES)
def test_the_changed_regressor_is_that_of_turned_gravity(roll, pitch):
    model = arm_model(("motor", "sensor"))
    m, v = motion(model, 1.0), {"roll": roll, "pitch": pitch}
    change = E.regressor_change(place_of(model), v, m, model)
    chi = list(model.standard.values())
    seen = sum(part * chi[number] for number, part in change.items())
    turned = replace(model, robot=with_gravity(model.robot, tilted(DOWN, roll, pitch)))
    assert seen == pytest.approx(turned.torque(m) - model.torque(m), abs=1e-10)
    assert added(model, m, E, place_of(model), v) == pytest.approx(seen, abs=1e-10)
    assert E.torque_change(place_of(model), v, m, model, np.array(chi)) == pytest.approx(seen, abs=1e-10)


@pytest.mark.parametrize("roll, pitch", ANGLES)
def test_any_direction_is_found_in_the_measured_torque(roll, pitch):
    """With 1 % noise; the study believes gravity is down."""
    model = arm_model(("motor",))
    m = motion(model, 20.0, rate=50.0)
    tau = recorded(model, simulated(model, m, E, place_of(model), {"roll": roll, "pitch": pitch}))
    noise = 0.01 * tau.std(axis=0) * np.random.default_rng(0).normal(size=tau.shape)
    starts = E.starts(place_of(model), [replace(m, measured=tau + noise)], [], model)
    found = tilted(DOWN, **starts[0])
    assert found == pytest.approx(tilted(DOWN, roll, pitch), abs=0.1)  # m/s^2: 0.6 degrees


def test_a_base_that_is_nearly_level_is_asked_for_near_level():
    """Noise led the search over all directions 19 mrad away from a tilt of 2.7, and of it a hysteresis was
    told."""
    model = arm_model(("motor",))
    m, tilt = motion(model, 20.0, rate=50.0), np.array([-0.0014, -0.0023])
    tau = recorded(model, simulated(model, m, E, place_of(model), dict(zip(("roll", "pitch"), tilt))))
    noise = 0.05 * tau.std(axis=0) * np.random.default_rng(0).normal(size=tau.shape)
    starts = E.starts(place_of(model), [replace(m, measured=tau + noise)], [], model)
    angles = np.array([[v["roll"], v["pitch"]] for v in starts])
    near = angles[np.linalg.norm(angles, axis=1) < 2 * np.linalg.norm(tilt)]
    along = np.abs(near @ tilt) / (np.linalg.norm(near, axis=1) * np.linalg.norm(tilt))
    assert along.max(initial=0.0) > np.cos(np.pi / 8)  # a size, of either sign, does the rest


@pytest.mark.parametrize("file", [DOWN, -DOWN, DOWN[[2, 0, 1]], DOWN[[0, 2, 1]], np.array([3.0, -2.0, -9.0])])
def test_every_direction_can_be_reached_from_the_files(file):
    rng = np.random.default_rng(3)
    for wanted in [*rng.normal(size=(20, 3)), file, -file]:
        wanted = wanted / np.linalg.norm(wanted) * np.linalg.norm(file)
        assert tilted(file, *tilt_of(file, wanted)) == pytest.approx(wanted, abs=1e-6)
    assert np.linalg.norm(tilted(file, 1e-3, 0) - file) > 5e-3 < np.linalg.norm(tilted(file, 0, 1e-3) - file)


@pytest.mark.parametrize("name", ["ur10e", "kuka_lwr4p", "staubli_tx40"])
def test_a_turned_arm_shows_two_moments_of_link_1_and_no_more(name):
    robot = load_robot(name)
    names = newly_visible(robot)
    assert names == ("MX1", "MY1")
    rng = np.random.default_rng(5)
    q, dq, ddq = rng.uniform(-2, 2, (300, robot.n)), *rng.normal(size=(2, 300, robot.n))
    ranks = [
        np.linalg.matrix_rank(W.reshape(-1, W.shape[2]), rtol=1e-9)
        for W in (standard_columns(r, q, dq, ddq) for r in (robot, with_gravity(robot, (3, -4, -7))))
    ]
    assert ranks[1] - ranks[0] == len(names)


def test_it_tells_the_gravity_to_paste():
    told = E.report(values_of(E, CONTEXT, roll=0.0, pitch=np.pi / 2), None, CONTEXT)
    assert [told[f"g{axis}"]["value"] for axis in "xyz"] == pytest.approx([9.81, 0, 0], abs=1e-12)
    check_report("base_tilt", CONTEXT)
    wall = dict(zip(E.context, (9.81, 0.0, 0.0)))
    told = E.report({"roll": 0.1, "pitch": -0.2}, 1e-4 * np.eye(2), wall)
    assert [told[f"g{axis}"]["value"] for axis in "xyz"] == pytest.approx(tilted((9.81, 0, 0), 0.1, -0.2))


def test_it_tells_how_well_the_gravity_is_known():
    """As a fit gives it: the file's gravity, which is exact, behind the angles."""
    spread = np.zeros((5, 5))
    spread[:2, :2] = np.diag([1e-4, 4e-4])
    told = E.report({"roll": 0.0, "pitch": 0.0}, spread, CONTEXT)
    assert [told[name]["std"] for name in ("roll", "pitch")] == pytest.approx([0.01, 0.02])
    assert [told[f"g{axis}"]["std"] for axis in "xyz"] == pytest.approx([0.1962, 0.0981, 0.0], abs=1e-9)


def test_what_to_do_holds_the_line_to_paste():
    told = E.remedy_with({"roll": 0.1, "pitch": 0.0, "gx": 3.51345, "gy": 2.4971, "gz": -8.80982})
    assert "`gravity: [3.513, 2.497, -8.81]`" in told
    assert "[gx, gy, gz]" in E.remedy and effect("spring").remedy_with({}) == effect("spring").remedy


def test_without_gravity_there_is_none_to_turn():
    """A warning of a division by its size was printed."""
    model = arm_model()
    weightless = replace(model, robot=with_gravity(model.robot, np.zeros(3)))
    assert not list(E.places(layout(weightless)))


def test_a_difference_of_torques_does_not_show_it():
    assert not list(E.places(layout(arm_model(("drive",)))))
    model = arm_model()
    assert E.context_of(place_of(model), model) == CONTEXT
