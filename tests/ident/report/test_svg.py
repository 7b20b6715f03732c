"""Charts as SVG: well-formed, every point where it belongs, gaps not bridged, the axes' words escaped."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from ident.report.svg import FINE, Axes, figure, ticks


def test_points_stand_where_their_values_say():
    ax = Axes()
    ax.margins(x=0)
    x, y = np.array([0.0, 1.0, 2.0, 3.0, 4.0]), np.array([-1.0, 1.0, np.nan, 0.0, 1.0])
    ax.plot(x, y, "r", label="a & b")
    ax.set_ylabel("<torque>")
    ax.legend(title="run")
    root = ElementTree.fromstring(figure([[ax]], 400, 110))
    paths = [e.get("d") for e in root.iter("{http://www.w3.org/2000/svg}path")]
    found = np.array([[float(v) for v in pair] for pair in re.findall(r"(-?\d+) (-?\d+)", paths[0])]) / FINE
    assert paths[0].count("M") == 2  # the gap is not bridged
    known = np.isfinite(y)
    assert found[:, 0] == pytest.approx(100 * x[known])
    assert found[:, 1] == pytest.approx((1.1 - y[known]) * 50, abs=0.05)  # 5 % of the range above and below
    assert {"a & b", "<torque>"} <= {t.strip("\u2014 ") for t in root.itertext()}


@pytest.mark.parametrize("low, high", [(0.0, 90.0), (-3.2e-5, 7e-5), (-55.0, 61.0), (1e6, 1e6 + 1)])
def test_ticks_are_round_inside_and_few(low, high):
    found = np.array(list(ticks(low, high, 5)))
    assert 2 <= len(found) <= 6 and found.min() >= low and found.max() <= high
    step = np.diff(found)
    assert np.allclose(step, step[0]) and f"{step[0]:.0e}"[0] in "125"
