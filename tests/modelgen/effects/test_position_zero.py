"""position_zero: torques at the true position against the model at the recorded one, in one recording."""

import numpy as np
import pytest
from effect_model import (
    SLIDE,
    arm_model,
    as_recorded_by,
    check_report,
    contribution,
    layout,
    motion,
    simulated,
    values_of,
)

from modelgen.effects import effect

E = effect("position_zero")


@pytest.mark.parametrize("zero", [5e-3, 0.05, -0.8])
@pytest.mark.parametrize("text", ["", SLIDE])
def test_columns_are_what_another_zero_leaves_however_large_it_is(zero, text):
    model = arm_model(("motor", "sensor"), dry=False, **({"text": text} if text else {}))
    m, v = motion(model, 2.0, rate=2000.0), values_of(E, zero=zero)
    place = next(p for p in E.places(layout(model)) if p.joint == 1)
    seen, left = as_recorded_by(E, model, m, place, v)
    assert (seen.q - m.q)[:, 1] == pytest.approx(zero, abs=1e-12)
    inner = slice(20, -20)
    made = contribution(E, place, v, seen, model)
    assert made[inner] == pytest.approx(left[inner], abs=2e-3 * np.abs(left[inner]).max())


def test_another_recording_counts_from_the_usual_zero():
    model = arm_model()
    m = motion(model, 0.5)
    places = list(E.places(layout(model, ("run1", "run2"))))
    assert len(places) == 8 and all(p.start is None and p.stop is None for p in places)
    other = next(p for p in places if p.recording == "run2" and p.joint == 2)
    assert not any(c.any() for c in E.columns(other, {}, None, m, model).values())
    assert np.array_equal(simulated(model, m, E, other, values_of(E)).encoder, m.q)


def test_a_slides_zero_is_in_metres():
    model = arm_model(text=SLIDE)
    slide = next(p for p in E.places(layout(model)) if p.joint == 1)
    assert E.unit(E.linear[0], slide) == "m"
    check_report("position_zero")
