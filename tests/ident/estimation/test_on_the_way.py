"""What remembers its way does so from where a recording begins, not from the first sample that is used."""

from dataclasses import replace

import numpy as np
import pytest
from effect_model import arm_model, layout, motion

import ident
from modelgen.effects import effect
from modelgen.effects.states import integrate_dahl

pytestmark = pytest.mark.unexamined

PENDULUM = """\
name: one
convention: mdh
gravity: [0, 0, -9.81]
links:
  - {joint: revolute, antecedent: 0, alpha: pi/2, d: 0, theta: q1, r: 0}
"""
RATE, WIDTH, FC = 250.0, 0.08, 3.0


@pytest.mark.parametrize("name", ["hysteresis", "maxwell_slip", "backlash"])
def test_a_state_goes_on_from_the_way_to_its_first_sample(name):
    its, q = effect(name), 0.3 * np.sin(np.linspace(0.0, 9.0, 900))
    theta = its.complete({})
    whole = its.states({"q": q, "t": np.arange(900.0)}, theta)
    part = its.states({"q": q[200:], "t": np.arange(700.0), "before": q[:200]}, theta)
    assert all(np.allclose(part[z], whole[z][200:]) for z in whole)


@pytest.mark.parametrize("name", ["hysteresis", "maxwell_slip", "backlash"])
def test_its_columns_go_on_as_well(name):
    """Those of a play made their own way, without what came before."""
    its, model = effect(name), arm_model()
    whole = motion(model, 4.0)
    place = next(place for place in its.places(layout(model)) if place.joint == 1)
    part = replace(whole.only(slice(700, None)), before=whole.q[:700])
    one, other = (its.columns(place, its.complete({}), None, m, model, {}) for m in (whole, part))
    assert all(np.allclose(other[c], one[c][700:]) for c in one)


def test_a_fit_knows_it_at_its_first_row(tmp_path):
    """A travel that takes longer than the transients which no row uses: at the first row friction has
    neither begun nor slid in."""
    (tmp_path / "robot.yaml").write_text(PENDULUM)
    runs = []
    for number, use in enumerate(("identify", "validate")):
        t = np.arange(20 * RATE) / RATE
        w = 2 * np.pi * np.array([0.13, 0.31])
        q = (np.sin(np.outer(t, w)) @ np.array([0.35, 0.15])) * (1 - 2 * number)
        dq, ddq = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
        tau = 0.4 * ddq + 2.0 * np.cos(q) + 1.5 * dq + FC * integrate_dahl(q, {"width": WIDTH})
        tau += 0.01 * np.random.default_rng(number).normal(size=len(t))
        runs.append(ident.Recording({"t": t, "q1": q, "tau_m1": tau}, use=use))
    fit = ident.fit(
        ident.Study(robot=tmp_path / "robot.yaml", model="A", recordings=runs, effects=["hysteresis:1"])
    )
    found = dict(zip(fit.result.columns.parameters, fit.result.estimate.chi))
    assert found["hysteresis:1.Fc"] == pytest.approx(FC, rel=0.01)
    for system in fit.result.systems:
        left = system.segments[0].Y[0].copy()
        for column, values in zip(system.column, system.segments[0].values):
            left -= found[fit.result.columns.parameters[column]] * values
        assert np.abs(left[0]) < 0.1
