"""Rates of false alarms as stated, and a wearing joint named among robots that only follow the seasons."""

import sys
from pathlib import Path

import numpy as np
import pytest

from ident.fleet.charts import charts, delay, threshold
from ident.fleet.trends import trends

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
from fleet import JOINTS, PARAMETERS, fleet


def first_alarms(run_length, change=0.0, K=300, B=1500, q=3):
    rng = np.random.default_rng(0)
    x = np.ones((K, B, q))
    x[:, :, 1:] = rng.normal(size=(K, B, q - 1))
    y = 7 + 3 * x[:, :, 1] + 0.4 * rng.normal(size=(K, B))
    y[100:] += change * 0.4
    return charts(y, x, np.ones((K, B))), threshold(run_length)


def test_scores_are_standard_normal_and_alarms_as_rare_as_asked():
    found, h = first_alarms(1000.0)
    z = found.score[np.isfinite(found.score)]
    assert abs(z.mean()) < 0.01 and abs(z.std() - 1) < 0.01
    share = (found.level > h).any(axis=0).mean()
    observed = np.isfinite(found.score).sum(axis=0)[0]
    assert share == pytest.approx(1 - np.exp(-2 * observed / 1000.0), abs=0.05)


def test_a_step_is_found_soon_and_dated():
    found, h = first_alarms(1e6, change=3.0)
    assert (found.level > h).any(axis=0).mean() > 0.99
    first = np.argmax(found.level > h, axis=0)
    late = first[first >= 100]
    assert np.median(late) - 100 < 12
    since = found.since[first, np.arange(len(first))]
    assert abs(np.median(since) - 100) <= 2


def test_the_stated_delay_is_the_published_one_and_the_charts_own():
    # Montgomery, Introduction to Statistical Quality Control, table of mean run lengths for k = 1/2
    published = {(4, 1.0): 8.38, (4, 2.0): 3.34, (5, 1.0): 10.4, (5, 2.0): 4.01}
    for (h, shift), mean in published.items():
        assert delay(h, shift) == pytest.approx(mean, rel=0.05)
    rng = np.random.default_rng(2)
    K, B = 900, 600
    y = rng.normal(size=(K, B))
    y[800:] += 1.0
    level = charts(y, np.ones((K, B, 1)), np.ones((K, B))).level
    quiet = level[780:800].max(axis=0) < 8
    late = 1 + np.argmax(level[800:, quiet] > 8, axis=0)
    assert late.mean() == pytest.approx(delay(8, 1.0), rel=0.15)


def test_a_missing_day_changes_nothing():
    rng = np.random.default_rng(1)
    y, x = rng.normal(size=(60, 3)), np.ones((60, 3, 1))
    holes = np.insert(y, 30, np.nan, axis=0)
    whole = charts(y, x, np.ones_like(y))
    found = charts(holes, np.ones((61, 3, 1)), np.ones_like(holes))
    assert np.array_equal(found.level[-1], whole.level[-1])


def test_the_wearing_joint_is_named_and_nobody_else():
    points, truth = fleet(robots=12, days=90, wearing=2, seed=4)
    found = trends(points, PARAMETERS, JOINTS)
    named = {(c.robot, c.joint): c for c in found.changes if c.level == "alarm"}
    assert set(named) == {(robot, joint) for robot, (joint, _, _) in truth.items()}
    for robot, (joint, first, doubled) in truth.items():
        change = named[robot, joint]
        assert first < int(change.day) < doubled
        assert change.percent > 0 and f"joint {joint}: friction at its usual speed rose" in change.sentence()
