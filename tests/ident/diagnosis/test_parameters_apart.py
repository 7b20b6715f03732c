"""What was found, beside what the model gets wrong from one run to the next."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from ident.diagnosis.evidence.evidence import weigh
from ident.diagnosis.evidence.metric import Metric
from ident.diagnosis.evidence.state import Found
from ident.diagnosis.rows.rows import Rows
from ident.diagnosis.search.parameters_apart import _distances, beside_changes, times_noise
from ident.report.unexplained_words import unexplained_sentence

TAU, M, WAVES = 8.3, 2400, 30


@dataclass(frozen=True)
class Others:
    """The state without what was found, as far as it is asked."""

    rows: Rows
    made: Callable[[Rows], Metric]

    @property
    def problem(self):
        return SimpleNamespace(asked=2000)  # effects at places

    @property
    def metric(self):
        return self.made(self.rows)


def waves(rng, count):
    """(M, count) smooth columns of unit size, by chance."""
    t = np.arange(M) / M * 40 * np.pi
    parts = np.column_stack([f(k * t / WAVES) for k in range(1, WAVES + 1) for f in (np.sin, np.cos)])
    mixed = parts @ rng.normal(size=(parts.shape[1], count))
    return mixed / mixed.std(axis=0)


def made(tiny, seed, wrong, size):
    """Twelve smooth columns; what the model lacks: of each side another (wrong), and a column (size)."""
    rng = np.random.default_rng(seed)
    X, z = waves(rng, 12), waves(rng, 1)
    missing = np.where(np.arange(M) < M // 2, *waves(rng, 2).T)
    y = X @ rng.normal(size=12) + wrong * missing + size * z[:, 0] + rng.normal(size=M)
    others = Others(tiny["rows"](X, y), tiny["metric"])
    return others, Found(None, {0: z}, weigh(others.metric, {0: z}).sizes)


def test_noise_alone_takes_nothing_away(tiny):
    for seed in range(10):
        others, f = made(tiny, seed, 0.0, 0.4)
        told, beside = weigh(others.metric, f.columns), beside_changes(others, f, TAU)
        assert told.log_e > 2 * TAU and beside.kappa < 3.0
        assert beside.log_e > TAU


def test_a_smooth_torque_that_nobody_named_is_no_effect(tiny):
    """Of forty that are not there the split likelihood takes many for effects; beside the changes that
    the same torque makes of the model's own parameters next to none is left."""
    overrated = passed = 0
    for seed in range(40):
        others, f = made(tiny, 100 + seed, 1.5, 0.0)
        beside = beside_changes(others, f, TAU)
        overrated += beside is not None
        passed += beside is not None and beside.log_e > TAU
    assert overrated >= 5 and passed <= 1


def test_what_is_there_brings_the_sides_together(tiny):
    kept = 0
    for seed in range(20):
        others, f = made(tiny, 300 + seed, 0.3, 1.2)
        (without, with_it), parameters = _distances(others.metric, 0, f.columns[0] @ f.sizes)
        assert with_it < without and 10 <= parameters <= 12
        kept += beside_changes(others, f, TAU).log_e > TAU
    assert kept >= 18


def test_what_no_rows_show_is_not_asked(tiny):
    others, f = made(tiny, 7, 0.0, 0.0)
    assert beside_changes(others, f, TAU) is None


def test_halves_of_the_fitted_rows_stand_in_for_judged_ones_that_hold_too_little(tiny):
    """Judged rows without the column in them: the fitted halves show it, and their parameters agree."""
    rng = np.random.default_rng(11)
    X, z = waves(rng, 12), waves(rng, 1)
    rows = tiny["rows"](X, X @ rng.normal(size=12) + 0.8 * z[:, 0] + rng.normal(size=M))
    z[rows.judged] = 0.0
    others = Others(rows, tiny["metric"])
    beside = beside_changes(others, Found(None, {0: z}, np.array([0.8])), TAU)
    assert beside is not None and beside.log_e > TAU and beside.kappa < 3.0


def test_judged_rows_as_few_as_the_parameters_have_no_noise_of_their_own(tiny):
    rng = np.random.default_rng(12)
    X, z = waves(rng, 12), waves(rng, 1)
    rows = tiny["rows"](X, X @ rng.normal(size=12) + rng.normal(size=M))
    few = replace(rows, judged=rows.judged & (np.cumsum(rows.judged) <= 10))
    (without, with_it), parameters = _distances(tiny["metric"](few), 0, 0.0 * z[:, 0])
    assert without == with_it and without < 10 * parameters


@pytest.mark.filterwarnings("error")
def test_a_torque_without_rows_that_judge_tells_of_no_change(tiny):
    """Of a Franka whose first joint was dead in the run that judges its noise was none, and all products of
    its fitted rows without end."""
    others, f = made(tiny, 3, 0.0, 0.4)
    rows = others.rows
    unseen = replace(rows, Y=1e5 * rows.Y, use=rows.use & rows.fitted)
    assert times_noise(tiny["metric"](unseen), f.columns, f.sizes) == 1.0


@pytest.mark.parametrize("signals", [("dq1",), ()])
def test_the_sentence_says_what_keeps_the_name_away(signals):
    item = {
        "joints": [1], "channel": "tau_m", "depends_on": list(signals), "share_of_residual_percent": 26.1,
        "log_e": 20.1, "nearest": {"effect": "quadratic_friction", "joints": [1], "log_e": 20.1},
        "carries_over": True, "parameters_change_times_noise": 4.7,
    }  # fmt: skip
    text = unexplained_sentence(item)
    assert "quadratic friction on joint 1" in text and "log E 20.1" in text and "4.7 times" in text
    assert ("depends on dq1" in text) == bool(signals)
