"""WLS, covariance, F-statistics, normality and Durbin-Watson against statsmodels and scipy on the same
rows."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
import statsmodels.api as sm
from hypothesis import given, settings
from hypothesis import strategies as st
from statsmodels.stats.diagnostic import lilliefors as statsmodels_lilliefors
from statsmodels.stats.stattools import durbin_watson as sm_durbin_watson

from ident.equations.observation import ChannelFactor, DecimatedSegment, RecordingSystem, stack, triangular
from ident.estimation.estimators.reweighted import robust_sigma
from ident.estimation.least_squares import (
    bounded,
    channel_sigma,
    huber_factors,
    not_negative,
    weighted_least_squares,
)
from ident.estimation.noise import (
    ChannelNoise,
    autoregression,
    channel_noises,
    colour,
    durbin_watson,
    honest_covariance,
)
from ident.estimation.reduction import kolmogorov_smirnov, reduce

B, CHANNELS = 9, 3
NAMES = tuple(f"p{k}" for k in range(B))
SPARSE = [
    np.array([0, 1, 2, 3, 6]),
    np.array([1, 2, 4, 5, 7]),
    np.array([2, 3, 5, 6, 8]),
]  # columns of a channel
LEVELS = np.array([0.5, 2.0, 0.1])


def rows(seed=0, m=80, chi=None):
    """Dense W (channels, m, b) with structural zeros, Y (channels, m)."""
    rng = np.random.default_rng(seed)
    chi = rng.normal(size=B) if chi is None else chi
    W = np.zeros((CHANNELS, m, B))
    for j, columns in enumerate(SPARSE):
        W[j][:, columns] = rng.normal(size=(m, len(columns)))
    return W, W @ chi + LEVELS[:, None] * rng.normal(size=(CHANNELS, m))


def system(W, Y, label="run"):
    channel = np.concatenate([np.full(len(c), j) for j, c in enumerate(SPARSE)])
    column = np.concatenate(SPARSE)
    values = np.stack([W[j][:, k] for j, k in zip(channel, column)])
    factors = tuple(
        ChannelFactor(c, triangular(np.column_stack([W[j][:, c], Y[j]])), W.shape[1])
        for j, c in enumerate(SPARSE)
    )
    segment = DecimatedSegment(np.arange(W.shape[1]) * 0.5, values, Y, np.ones(Y.shape))
    return RecordingSystem(label, "identify", None, channel, column, factors, (segment,), W.shape[1])


def fitted(W, Y):
    factors = stack([system(W, Y)])
    return weighted_least_squares(factors, channel_sigma(factors), NAMES)


def test_sigma_of_each_channel_is_that_of_ordinary_least_squares():
    W, Y = rows()
    sigma = channel_sigma(stack([system(W, Y)]))
    for j, columns in enumerate(SPARSE):
        assert sigma[j] ** 2 == pytest.approx(sm.OLS(Y[j], W[j][:, columns]).fit().mse_resid, rel=1e-10)


def test_wls_and_covariance_are_those_of_statsmodels():
    W, Y = rows()
    estimate = fitted(W, Y)
    weights = np.repeat(1 / estimate.sigma**2, W.shape[1])
    plain = sm.WLS(Y.ravel(), W.reshape(-1, B), weights=weights).fit(cov_type="fixed scale")
    assert np.allclose(estimate.chi, plain.params, rtol=1e-9, atol=1e-12)
    assert np.allclose(estimate.covariance, plain.normalized_cov_params, rtol=1e-9, atol=1e-15)  # eq. 15
    assert np.allclose(
        estimate.relative_std_percent, 100 * np.sqrt(np.diag(plain.normalized_cov_params)) / abs(plain.params)
    )
    assert estimate.rss == pytest.approx(plain.ssr, rel=1e-9)


def test_f_statistics_are_those_of_statsmodels():
    chi = np.array([1.0, -1.0, 2.0, 0.5, 1.5, -0.7, 0.0, 0.0, 1e-3])
    W, Y = rows(3, chi=chi)
    full = fitted(W, Y)
    reduction = reduce(full)
    assert len(reduction.steps) >= 3
    kept = list(range(B))
    weights = np.repeat(1 / full.sigma**2, W.shape[1])
    for step in reduction.steps:
        bigger = sm.WLS(Y.ravel(), W.reshape(-1, B)[:, kept], weights=weights).fit()
        fewer = [k for k in kept if NAMES[k] != step.dropped]
        smaller = sm.WLS(Y.ravel(), W.reshape(-1, B)[:, fewer], weights=weights).fit()
        F, p, df = bigger.compare_f_test(smaller)
        assert (step.statistic, step.p_value, step.df_num) == pytest.approx((F, p, df), rel=1e-7)
        assert step.threshold == pytest.approx(scipy.stats.f.ppf(0.95, 1, step.df_den))
        assert step.accepted == (step is not reduction.steps[-1])
        kept = fewer
    assert reduction.estimate.b == B - len(reduction.steps) + 1


def test_threshold_of_many_rows_is_the_papers():
    assert scipy.stats.f.ppf(0.95, 1, 1e6) == pytest.approx(3.85, abs=0.01)


@pytest.mark.parametrize("heavy", [0.0, 0.4, 1.0])
def test_normality_is_lilliefors_of_statsmodels(heavy):
    rng = np.random.default_rng(3)
    x = (rng.normal(size=600) + heavy * rng.laplace(size=600)) * 1.7 + 0.2
    ours, (distance, p) = kolmogorov_smirnov(x), statsmodels_lilliefors(x, pvalmethod="table")
    assert ours.statistic == pytest.approx(distance, rel=1e-9)
    assert abs(np.log(max(ours.p_value, 1e-3) / max(p, 1e-3))) < 0.7  # both are approximations


def test_normality_holds_its_rate():
    """With parameters estimated the p-value is uniform: Kolmogorov's own refuses next to nothing."""
    rng = np.random.default_rng(4)
    p = np.array([kolmogorov_smirnov(rng.normal(2.0, 3.0, 80)).p_value for _ in range(2000)])
    assert abs(np.mean(p < 0.05) - 0.05) < 0.015 and abs(np.mean(p < 0.5) - 0.5) < 0.05


def test_resting_rows_do_not_enter_the_robust_sigma():
    """A joint that rests most of the time: its noise is that of the rows that count."""
    rng = np.random.default_rng(0)
    W, Y = rows(1)
    Y = W @ np.ones(B) + rng.normal(size=Y.shape)
    part = system(W, Y)
    weight = part.segments[0].weight.copy()
    weight[0, 20:] = 0.0
    values = part.segments[0].values * (weight[part.channel] > 0)
    rest = replace(part.segments[0], weight=weight, Y=part.segments[0].Y * (weight > 0), values=values)
    sigma = robust_sigma([replace(part, segments=(rest,))], np.ones(B))
    rho = (Y - W @ np.ones(B))[0, :20]
    assert sigma[0] == pytest.approx(1.4826 * np.median(np.abs(rho)), rel=1e-9)


def test_durbin_watson_is_that_of_statsmodels():
    rho = np.random.default_rng(0).normal(size=(1, 300)).cumsum(axis=1)
    assert durbin_watson([rho]) == pytest.approx(sm_durbin_watson(rho[0]), rel=1e-12)


def test_dependent_columns_are_named_and_the_rest_identified():
    W, _Y = rows(1)
    W[:, :, 6] = 2 * W[:, :, 3]  # p6 moves as p3 does, p8 not at all
    W[:, :, 8] = 0
    estimate = fitted(W, W @ np.ones(B))
    assert next(d.parameter for d in estimate.dependent) == "p8"
    pair = estimate.dependent[1]
    assert {pair.parameter, pair.seen_in[0][0]} == {"p3", "p6"}
    assert pair.sentence().startswith(f"{pair.parameter} is seen only together with")
    others = [0, 1, 2, 4, 5, 7]
    assert np.allclose(estimate.chi[others], 1)
    kept, factor = (3, 3.0) if estimate.active[3] else (6, 1.5)
    assert estimate.chi[kept] == pytest.approx(factor)  # it absorbs the other


@given(st.permutations(list(range(60))), st.integers(0, CHANNELS - 1))
@settings(max_examples=20, deadline=None)
def test_order_of_rows_in_a_channel_does_not_matter(order, j):
    W, Y = rows(2, m=60)
    W2, Y2 = W.copy(), Y.copy()
    W2[j], Y2[j] = W[j][order], Y[j][order]
    one, other = fitted(W, Y), fitted(W2, Y2)
    assert np.allclose(one.chi, other.chi, rtol=1e-8, atol=1e-10)
    assert np.allclose(one.covariance, other.covariance, rtol=1e-7, atol=1e-12)


@given(st.floats(1e-4, 1e4), st.floats(1e-3, 1e3))
@settings(max_examples=20, deadline=None)
def test_units_scale_through(torque, column):
    W, Y = rows(4)
    scaled = W.copy() * torque
    scaled[:, :, 2] *= column
    one, other = fitted(W, Y), fitted(scaled, Y * torque)
    factor = np.where(np.arange(B) == 2, column, 1.0)
    assert np.allclose(other.chi * factor, one.chi, rtol=1e-7, atol=1e-10)
    assert np.allclose(other.std * factor, one.std, rtol=1e-7)
    assert reduce(other).essential == reduce(one).essential


@given(st.integers(12, 68))
@settings(max_examples=15, deadline=None)
def test_a_recording_cut_in_two_gives_the_same(cut):
    W, Y = rows(5)
    whole = fitted(W, Y)
    factors = stack([system(W[:, :cut], Y[:, :cut], "a"), system(W[:, cut:], Y[:, cut:], "b")])
    halves = weighted_least_squares(factors, channel_sigma(factors), NAMES)
    assert np.allclose(halves.chi, whole.chi, rtol=1e-8, atol=1e-10)
    assert np.allclose(halves.covariance, whole.covariance, rtol=1e-7)


def test_a_dropped_column_of_zeros_changes_nothing():
    W, Y = rows(6)
    W[:, :, 7] = 0
    with_zeros = fitted(W, Y)
    assert not with_zeros.active[7]
    kept = [k for k in range(B) if k != 7]
    weights = np.repeat(1 / with_zeros.sigma**2, W.shape[1])
    assert np.allclose(
        with_zeros.chi[kept], sm.WLS(Y.ravel(), W.reshape(-1, B)[:, kept], weights=weights).fit().params
    )


def test_huber_is_that_of_statsmodels():
    W, Y = rows(7, m=200)
    Y[0, ::17] += 40.0
    outliers = system(W, Y)
    sigma = LEVELS
    estimate = weighted_least_squares(stack([outliers]), sigma, NAMES)
    for _ in range(60):
        factors, down = huber_factors([outliers], sigma, estimate.chi)
        estimate = weighted_least_squares(factors, sigma, NAMES)
    assert down >= 12
    scaled = (W / sigma[:, None, None]).reshape(-1, B)
    plain = sm.RLM((Y / sigma[:, None]).ravel(), scaled, M=sm.robust.norms.HuberT(1.345)).fit(
        scale_est=FixedScale(), tol=1e-12, maxiter=500
    )
    assert np.allclose(estimate.chi, plain.params, rtol=1e-6, atol=1e-8)


class FixedScale:
    def __call__(self, *args, **kwargs):
        return 1.0


def test_bounds_hold_what_physics_forbids():
    names = ("Iam1", "Fvm1R", "MX2", "ML", "ZZ1R", "Fcl3", "Offm1", "M3R", "XX1")
    assert [not_negative(name) for name in names] == [
        True,
        True,
        False,
        True,
        False,
        True,
        False,
        False,
        False,
    ]
    W, Y = rows(8, chi=np.array([-0.3, 1, 1, 1, 1, 1, 1, 1, 1.0]))
    factors = stack([system(W, Y)])
    free = weighted_least_squares(factors, channel_sigma(factors), names)
    assert free.chi[0] < 0
    held, at_zero = bounded(free)
    assert at_zero == ("Iam1",)
    weights = np.repeat(1 / free.sigma**2, W.shape[1])
    assert np.allclose(held.chi[1:], sm.WLS(Y.ravel(), W.reshape(-1, B)[:, 1:], weights=weights).fit().params)


def ar1(m, a, rng):
    e = rng.normal(size=m) * np.sqrt(1 - a * a)
    out = np.empty(m)
    out[0] = rng.normal()
    for k in range(1, m):
        out[k] = a * out[k - 1] + e[k]
    return out


def test_colouring_is_the_root_of_the_correlation_matrix():
    correlation = 0.7 ** np.arange(6)
    correlation[2:] *= 0.9
    a = autoregression(correlation[:3], 10**6)
    noise = ChannelNoise(1.0, a, correlation, 50)
    L = colour(np.eye(50), noise)
    omega = L.T @ L
    assert np.allclose(np.diag(omega), 1, atol=1e-10)
    for lag in range(len(a) + 1):
        assert np.allclose(np.diag(omega, lag), correlation[lag], atol=1e-10)


def test_honest_covariance_is_the_spread_of_estimates_under_coloured_noise():
    chi, draws = np.ones(B), []
    reported, white = [], []
    W, _ = rows(9, m=300, chi=chi)
    W = np.cumsum(W, axis=1) / 10  # slow columns, as gravity's are: there correlation hurts most
    rng = np.random.default_rng(10)
    for _ in range(120):
        noise = np.stack([ar1(300, 0.6, rng) for _ in range(CHANNELS)]) * LEVELS[:, None]
        found = system(W, W @ chi + noise)
        factors = stack([found])
        estimate = weighted_least_squares(factors, channel_sigma(factors), NAMES)
        draws.append(estimate.chi)
        reported.append(
            np.sqrt(np.diag(honest_covariance([found], estimate, channel_noises([found], estimate))))
        )
        white.append(estimate.std)
    spread = np.std(draws, axis=0)
    ratio = np.mean(reported, axis=0) / spread
    assert np.all(np.abs(ratio - 1) < 0.25), ratio  # 120 draws tell a spread to 6.5 % (one sigma)
    assert np.median(np.mean(white, axis=0) / spread) < 0.7
