"""What places the effects of a study."""

from types import SimpleNamespace

import numpy as np
import pytest

from ident.equations.prepared import travel_seen


def recorded(role, lowest, highest):
    survey = SimpleNamespace(lowest=np.array(lowest), highest=np.array(highest))
    return SimpleNamespace(role=role, survey=survey, need=SimpleNamespace(joints=(1, 2)))


def test_test_runs_set_no_range():
    """From the lowest position in any of the others to the highest in any."""
    runs = [
        recorded("identify", [0.0, -1.0, 9.0], [1.0, 1.0, 9.0]),
        recorded("validate", [0.5, 0.0], [2.0, 3.0]),
    ]
    far = recorded("test", [-9.0, -9.0], [9.0, 9.0])
    assert travel_seen([*runs, far]) == pytest.approx((2.0, 4.0))
    assert travel_seen([far]) == pytest.approx((18.0, 18.0))
