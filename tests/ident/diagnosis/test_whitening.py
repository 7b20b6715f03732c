"""Whitened rows are white across gaps and masked rows, against explicit covariances and statsmodels."""

import numpy as np
import pytest
import scipy.linalg
from statsmodels.tsa.arima_process import ArmaProcess
from statsmodels.tsa.stattools import acf

from ident.diagnosis.rows.whitened import _vecchia, burg, whitener

COEFFICIENTS = np.array([1.2, -0.5])  # x_t = 1.2 x_(t-1) - 0.5 x_(t-2) + e_t


def noise(M, seed=0, sigma=0.3):
    process = ArmaProcess(np.r_[1, -COEFFICIENTS], [1.0])
    return process.generate_sample(M, scale=sigma, burnin=500, distrvs=np.random.default_rng(seed).normal)


def covariance(longest, sigma=1.0):
    return sigma**2 * ArmaProcess(np.r_[1, -COEFFICIENTS], [1.0]).acovf(longest + 1)


def test_burg_gives_the_process():
    x = noise(200_000)
    a, r, variance = burg(x, np.ones(len(x), bool), np.zeros(len(x), int), 20)
    assert a[:2] == pytest.approx(COEFFICIENTS, abs=0.01) and np.abs(a[2:]).max(initial=0) < 0.02
    assert variance == pytest.approx(0.3**2, rel=0.02)
    assert r[:3] == pytest.approx(covariance(2, 0.3), rel=0.02)


def test_white_noise_has_order_zero():
    x = np.random.default_rng(3).normal(size=1000)
    a, r, variance = burg(x, np.ones(1000, bool), np.zeros(1000, int), 20)
    assert len(a) == 0 and variance == r[0] == pytest.approx(np.var(x))


@pytest.mark.parametrize("masked", [0.25, 0.5])
def test_masked_rows_ask_for_no_higher_order(masked):
    orders = []
    for seed in range(12):
        use = np.random.default_rng(seed + 50).random(4000) >= masked
        orders.append(len(burg(noise(4000, seed), use, np.zeros(4000, int), 20)[0]))
    assert min(orders) >= 2 and np.median(orders) == 2 and max(orders) <= 6


def test_without_gaps_it_is_the_inverse_cholesky_factor():
    M, p = 60, 2
    r = covariance(M)
    L = _vecchia(np.ones(M, bool), np.zeros(M, int), r[: 2 * p + 1], p).toarray()
    assert np.allclose(L @ np.linalg.cholesky(scipy.linalg.toeplitz(r[:M])), np.eye(M), atol=1e-9)


def test_masked_rows_are_stepped_over():
    """Every used row minus its best linear prediction from the nearest used ones within reach."""
    M, p = 80, 2
    use = np.random.default_rng(1).random(M) > 0.3
    r = covariance(2 * p)
    L = _vecchia(use, np.zeros(M, int), r, p).toarray()
    assert not L[~use].any() and not L[:, ~use].any()
    full = covariance(M)
    for i in np.flatnonzero(use)[4:]:
        before = [j for j in range(i - 1, max(i - 2 * p, 0) - 1, -1) if use[j]][:p]
        if not before:
            assert L[i, i] == pytest.approx(1 / np.sqrt(full[0]))
            continue
        K = full[np.abs(np.subtract.outer(before, before))]
        k = full[i - np.array(before)]
        weights = np.linalg.solve(K, k)
        scale = np.sqrt(full[0] - weights @ k)
        assert L[i, before] == pytest.approx(-weights / scale, rel=1e-6)
        assert L[i, i] == pytest.approx(1 / scale, rel=1e-6)


def test_recordings_do_not_reach_into_each_other():
    M = 40
    piece = np.repeat([0, 1], M // 2)
    L = _vecchia(np.ones(M, bool), piece, covariance(8), 4).toarray()
    assert not L[M // 2 :, : M // 2].any()


@pytest.mark.parametrize("masked", [0.0, 0.25])
def test_whitened_noise_is_white(tiny, masked):
    M = 6000
    x = noise(M)
    use = np.random.default_rng(2).random(M) >= masked
    rows = tiny["rows"](np.zeros((M, 1)), x, use=use, piece=np.arange(M) // 1500)
    w = whitener(rows, x, use, use)
    z = (w @ x)[use]
    assert np.std(z) == pytest.approx(1.0, abs=0.04)
    assert np.all(np.abs(acf(z, nlags=10)[1:]) < 4 / np.sqrt(len(z)))
    if not masked:
        assert w.sigma == pytest.approx(0.3, rel=0.04)
        assert w.coefficients[:2] == pytest.approx(COEFFICIENTS, abs=0.06)


def test_a_knock_is_not_noise(tiny):
    """Thirty times the noise for two seconds of a hundred changes neither level nor colour."""
    M = 2000
    x = noise(M)
    loud = x.copy()
    loud[900:940] += 9.0
    rows = tiny["rows"](np.zeros((M, 1)), x)
    every = np.ones(M, bool)
    quiet, with_knock = whitener(rows, x, every, every), whitener(rows, loud, every, every)
    assert with_knock.sigma == pytest.approx(quiet.sigma, rel=0.1)
