"""Gains against statsmodels, and the promise that the model is partialled out of every candidate."""

import numpy as np
import pytest
import statsmodels.api as sm

from ident.diagnosis.scoring import effective_share, make_bank, make_folds, make_system

N = 600


@pytest.fixture
def one_channel():
    rng = np.random.default_rng(1)
    X = rng.normal(size=(N, 4))
    z = rng.normal(size=N) + X[:, 0]
    y = X @ [1.0, -2.0, 0.5, 3.0] + 0.4 * z + rng.normal(0, 0.3, N)
    run = (np.arange(N) >= 400).astype(int)
    folds = make_folds(run, np.arange(N) * 0.04, ("identify", "validate"))
    bank = make_bank(X[None], np.ones((1, N), dtype=bool), folds)
    return X, z, y, make_system(bank, np.zeros((1, N, 0)), y[None])


def test_identify_gain_is_the_likelihood_ratio_of_ordinary_least_squares(one_channel):
    X, z, y, system = one_channel
    score = system.score({0: z[:, None]}, share=np.ones(1))
    small = sm.OLS(y[:400], X[:400]).fit()
    large = sm.OLS(y[:400], np.column_stack([X, z])[:400]).fit()
    assert score.identify == pytest.approx(large.llf - small.llf, rel=1e-6)
    assert score.coefficients[0] == pytest.approx(large.params[-1], rel=1e-6)
    rest = large.predict(np.column_stack([X, z])[400:]) - y[400:]
    assert score.rss_held[0] == pytest.approx(rest @ rest, rel=1e-6)  # frozen, on the other run


def test_a_column_of_the_model_gains_nothing(one_channel):
    X, _, _, system = one_channel
    assert system.score({0: X[:, [1]]}).identify < 1e-3


def test_without_validate_runs_alternating_blocks_are_held_out():
    t = np.tile(np.arange(0, 60, 0.04), 2)
    run = np.repeat([0, 1], len(t) // 2)
    folds = make_folds(run, t, ("identify", "identify"))
    assert not folds.by_validation
    for train, test in folds.held_out:
        assert not set(train) & set(test)
    assert {s for _, test in folds.held_out for s in test} == set(folds.identify)


def test_recordings_predict_each_other_unless_a_payload_is_in_one_alone():
    t = np.tile(np.arange(0, 60, 0.04), 2)
    run = np.repeat([0, 1], len(t) // 2)
    folds = make_folds(run, t, ("identify", "identify"), (None, None))
    assert folds.sets.tolist() == run.tolist() and folds.held_out == (((1,), (0,)), ((0,), (1,)))
    alternating = make_folds(run, t, ("identify", "identify"), (None, "L"))
    assert set(alternating.sets[run == 0]) == {0, 1, 2, 3}


def test_test_runs_are_in_no_set():
    folds = make_folds(np.array([0, 1, 2]), np.zeros(3), ("identify", "validate", "test"))
    assert folds.sets.tolist() == [0, 1, -1]


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.9])
def test_effective_samples_of_a_first_order_series(rho):
    rng = np.random.default_rng(2)
    e = rng.normal(size=20_000)
    x = np.zeros_like(e)
    for k in range(1, len(e)):
        x[k] = rho * x[k - 1] + e[k]
    folds = make_folds(np.zeros(len(x), dtype=int), np.arange(len(x)) * 0.04, ("identify",))
    share = effective_share(x, folds, np.ones(len(x), dtype=bool))
    # (1 - rho)/(1 + rho) in the limit; the sum of 25 lags by Bartlett misses half of it at rho = 0.9
    assert share == pytest.approx((1 - rho) / (1 + rho), rel=0.55)
