"""On a joint that slides an effect has N and m: in its units, its bounds and where its search begins."""

from dataclasses import replace

import numpy as np
import pytest
from effect_model import SLIDE, arm_model, layout, motion

from modelgen.effects import Layout, catalogue, effect

MODEL = arm_model(("motor", "sensor"), SLIDE)
TRAVEL = Layout(MODEL.robot, MODEL.channels, ("run1",), (4.8, 0.48))  # the slide: 0.1 m a radian


def slide_of(e):
    return next((p for p in e.places(layout(MODEL)) if p.joint == 1), None)


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_no_parameter_of_a_slide_is_in_radians(name):
    e = effect(name)
    place = slide_of(e)
    if place is None:  # it cannot stand there
        return
    for q in e.quantities:
        unit = e.unit(q, place)
        if not q.angle and place.source is None:
            assert "rad" not in unit and "N m" not in unit, (q.name, unit)


@pytest.mark.parametrize(
    "name, parameter, unit",
    [
        ("stribeck_friction", "vs", "m/s"), ("stribeck_friction", "Fs", "N"),
        ("viscous_friction", "Fv", "N s/m"),
        ("rotor_inertia", "Ia", "kg"), ("hysteresis", "sigma", "N/m"), ("joint_elasticity", "k", "N/m"),
        ("torque_ripple", "wavenumber", "1/m"), ("torque_ripple", "phi", "rad"), ("backlash", "gap", "m"),
        ("quadratic_friction", "Fv2", "N s^2/m^2"), ("offset_drift", "slope", "N/s"), ("spring", "q0", "m"),
    ],
)  # fmt: skip
def test_units_of_a_slide(name, parameter, unit):
    e = effect(name)
    (quantity,) = (q for q in e.quantities if q.name == parameter)
    assert e.unit(quantity, slide_of(e)) == unit


def test_shapes_are_searched_on_the_scale_of_the_travel():
    stribeck = effect("stribeck_friction")
    turning, place = (next(p for p in stribeck.places(TRAVEL) if p.joint == j) for j in (0, 1))
    assert stribeck.bounds(turning)["vs"] == (0.005, 0.6)
    assert stribeck.bounds(place)["vs"] == pytest.approx((0.0005, 0.075))  # a usual slide's goes further
    m = motion(MODEL, 4.0)
    for its, scale in ((place, 0.1), (replace(place, travel=None), np.ptp(m.q[:, 1]) / 4.8)):
        starts = [s["vs"] for s in stribeck.starts(its, [m], [np.zeros(len(m.t))])]
        assert starts == pytest.approx([x * scale for x in stribeck.nonlinear[0].grid])


def test_a_ball_screws_ripple_is_found():
    """Lead 10 mm: 628 waves a metre, far beyond a revolute joint's range."""
    ripple, wave = effect("torque_ripple"), 2 * np.pi / 0.010
    m = motion(MODEL, 30.0, rate=200.0)
    residual = np.sin(wave * m.q[:, 1]) + 0.5 * np.random.default_rng(0).normal(size=len(m.t))
    found = [s["wavenumber"] for s in ripple.starts(slide_of(ripple), [m], [residual])]
    assert min(abs(w - wave) for w in found) < 2 * np.pi / np.ptp(m.q[:, 1])
    assert ripple.bounds(slide_of(ripple))["wavenumber"][1] == pytest.approx(np.pi * 1000)


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_a_slide_that_rests_has_bounds_all_the_same(name):
    """Bounds of waves a metre were divided by the travel, which is zero there."""
    place = slide_of(effect(name))
    if place is not None:
        resting = replace(place, travel=0.0, source_travel=0.0)
        assert all(0 <= abs(low) <= abs(high) < np.inf for low, high in effect(name).bounds(resting).values())
