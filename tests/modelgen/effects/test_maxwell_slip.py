"""maxwell_slip: three elements that slip one after the other, step by step."""

import numpy as np
import pytest
from effect_model import (
    added,
    arm_model,
    check_report,
    contribution,
    first_place,
    layout,
    motion,
    split_agrees,
    values_of,
)

from modelgen.effects import effect

E = effect("maxwell_slip")


def elements(q, W, width):
    """Each element k: F += W/width dq, held at +-W. The loop of its authors."""
    out = np.zeros(len(q))
    for force, w in zip(W, (width, 3 * width, 9 * width)):
        F = 0.0
        for k in range(1, len(q)):
            F = np.clip(F + force / w * (q[k] - q[k - 1]), -force, force)
            out[k] += F
    return out


def test_columns_are_the_elements_less_the_sign():
    model = arm_model(("motor", "sensor"), dry=False)
    m, place = motion(model, 2.0), first_place(E, model)
    v = values_of(E, Wa=1.0, Wb=2.0, Wc=3.0, width=0.02)
    expected = elements(m.q[:, 1], (1.0, 2.0, 3.0), 0.02) - 6.0 * np.sign(m.dq[:, 1])
    seen = contribution(E, place, v, m, model)
    assert seen[:, 1] == pytest.approx(expected, abs=1e-9)
    assert not np.delete(seen, 1, axis=1).any()
    assert added(model, m, E, place, v) == pytest.approx(seen, abs=1e-9)


def test_blocks_places_signs_and_spread():
    model = arm_model(dry=False)
    assert split_agrees(E, first_place(E, model), values_of(E), motion(model, 2.0), model) < 1e-9
    assert [p.side for p in E.places(layout(arm_model()))] == ["motor"] * 4
    assert "Wb would be negative" in E.physical({**values_of(E), "Wb": -1.0})
    assert "hysteresis" in E.physical({**values_of(E), "Wa": 0.0, "Wc": 0.0})
    assert E.physical({**values_of(E), "Wb": 0.0}) is None
    told = E.report(values_of(E, Wa=1.0, Wb=3.0, Wc=9.0, width=0.01), None)
    assert told["sigma"]["value"] == pytest.approx(300.0)
    check = {"Wa", "Wb", "Wc", "width"}
    assert check <= set(told)
    check_report("maxwell_slip")
