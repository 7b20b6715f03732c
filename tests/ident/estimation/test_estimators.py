"""Other estimators against statsmodels, SciPy's orthogonal distance regression and plain formulas."""

import numpy as np
import pytest
import statsmodels.api as sm
from recordings import recording, write_parquet, write_study
from statsmodels.sandbox.regression.gmm import IV2SLS

from ident.errors import NotEnoughDataError, StudyError
from ident.estimation.estimators.instrumental import instrumental
from ident.estimation.estimators.total import gain_and_parameters
from ident.estimation.fit import fit_study
from ident.recordings.study import load_study


def closed_loop(feedback, N=4000, seed=0):
    """Z, W, Y: the noise of Y reaches W through the loop."""
    rng = np.random.default_rng(seed)
    Z, rho = rng.normal(size=(N, 3)), 0.5 * rng.normal(size=N)
    W = Z + feedback * np.outer(rho, [1.0, 0.5, 0.0]) + 0.05 * rng.normal(size=(N, 3))
    return Z, W, W @ [1.0, -2.0, 0.5] + rho


def factor(*parts):
    return np.linalg.qr(np.column_stack(parts), mode="r")


def test_instruments_and_their_test_are_those_of_statsmodels():
    Z, W, Y = closed_loop(0.4)
    found = instrumental(factor(Z, W, Y), 3, len(Y))
    its = IV2SLS(Y, W, Z).fit()
    assert np.allclose(found.chi, its.params, rtol=1e-10)
    assert np.allclose(found.std, its.bse, rtol=1e-8)
    plain = sm.OLS(Y, W).fit()
    assert np.allclose(found.least_squares, plain.params, rtol=1e-10)
    residual = W - Z @ np.linalg.lstsq(Z, W, rcond=None)[0]
    both = sm.OLS(Y, np.column_stack([W, residual])).fit()
    F, p, _ = both.compare_f_test(plain)
    assert found.statistic == pytest.approx(F) and found.p_value == pytest.approx(p)
    assert "biased by feedback" in found.sentence()
    assert np.abs(found.chi - [1, -2, 0.5]).max() < 0.05 < np.abs(found.least_squares - [1, -2, 0.5]).max()


def test_without_feedback_the_test_errs_as_often_as_it_says():
    rejected = [
        bool(instrumental(factor(*closed_loop(0.0, 300, s)), 3, 300).sentence(0.05)) for s in range(400)
    ]
    assert 0.025 < np.mean(rejected) < 0.085
    Z, W, Y = closed_loop(0.0)
    with pytest.raises(NotEnoughDataError, match="instruments do not determine"):
        instrumental(factor(Z * 0, W, Y), 3, len(Y))


def test_a_gain_by_total_least_squares_is_unbiased_and_the_least_distance():
    rng = np.random.default_rng(3)
    W = rng.normal(size=(5000, 2))
    true = rng.normal(size=5000)
    i, tau = true + 0.5 * rng.normal(size=5000), 2.0 * true - W @ [0.3, -1.0] + 0.2 * rng.normal(size=5000)
    g, chi, _ = gain_and_parameters(factor(-i, W, tau), 0, (0.5, 0.2))
    assert g == pytest.approx(2.0, abs=0.05)
    assert np.allclose(chi, [0.3, -1.0], atol=0.05)
    small = np.linalg.lstsq(np.column_stack([i, -W]), tau, rcond=None)[0][0]
    assert small < 1.7  # what least squares makes of it

    def distance(gain):
        left = tau - gain * i
        left = left - W @ np.linalg.lstsq(W, left, rcond=None)[0]
        return np.sum(left**2) / (0.2**2 + 0.5**2 * gain**2)

    assert distance(g) <= min(distance(g * 1.001), distance(g * 0.999))


def test_irls_is_statsmodels_rlm_and_the_others_say_that_they_wait(tmp_path):
    table = recording("A", seconds=30)[0]
    table["tau_m3"][2000:2050] += 60.0
    write_parquet(tmp_path / "run.parquet", table)
    entries = [{"file": "run.parquet"}]
    fit = fit_study(load_study(write_study(tmp_path, entries, estimator="irls", reduction=False)))
    system = fit.systems[0]
    rows, Y = [], []
    for j, sigma in enumerate(fit.full.sigma):
        for segment in system.segments:
            used = segment.used[j]
            rows.append(system.dense(segment, j, fit.full.b)[used] / sigma)
            Y.append(segment.Y[j, used] / sigma)
    W = np.concatenate(rows)
    its = sm.RLM(np.concatenate(Y), W, sm.robust.norms.HuberT(1.345)).fit(
        scale_est=_one, start_params=fit.full.chi, maxiter=50
    )
    assert np.all(np.abs(its.params - fit.full.chi) < 0.1 * fit.full.std)
    for name in ("iv", "didim", "tls"):
        with pytest.raises(StudyError, match=f"{name} is not built yet"):
            load_study(write_study(tmp_path, entries, estimator=name))


def _one(_):
    return 1.0
