"""Other estimators against statsmodels, SciPy's orthogonal distance regression and plain formulas."""

import numpy as np
import pytest
import statsmodels.api as sm
from recordings import recording, write_parquet, write_study
from statsmodels.sandbox.regression.gmm import IV2SLS

from ident.errors import NotEnoughDataError
from ident.estimation.estimators.instrumental import instrumental
from ident.estimation.estimators.total import gain_and_parameters
from ident.estimation.fit import fit_study
from ident.estimation.least_squares import solve, weighted_factor
from ident.recordings.study import load_study

pytestmark = pytest.mark.unexamined


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
    on_factor, _, rss = solve(found.R, np.ones(3, bool))
    assert np.allclose(on_factor, found.chi) and rss == pytest.approx(np.sum((Y - W @ found.chi) ** 2))
    assert np.allclose(Z @ found.T, Z @ np.linalg.lstsq(Z, W, rcond=None)[0])
    assert np.allclose(found.std, its.bse, rtol=1e-8)
    plain = sm.OLS(Y, W).fit()
    assert np.allclose(found.least_squares, plain.params, rtol=1e-10)
    residual = W - Z @ np.linalg.lstsq(Z, W, rcond=None)[0]
    both = sm.OLS(Y, np.column_stack([W, residual])).fit()
    F, p, _ = both.compare_f_test(plain)
    assert found.statistic == pytest.approx(F) and found.p_value == pytest.approx(p)
    assert np.abs(found.chi - [1, -2, 0.5]).max() < 0.05 < np.abs(found.least_squares - [1, -2, 0.5]).max()


def test_without_feedback_the_test_errs_as_often_as_it_says():
    rejected = [instrumental(factor(*closed_loop(0.0, 300, s)), 3, 300).p_value < 0.05 for s in range(400)]
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


def test_irls_is_statsmodels_rlm(tmp_path):
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


def _one(_):
    return 1.0


def test_recursive_is_that_of_summaries_and_spreads_as_it_says(tmp_path):
    """Two runs, the earlier one weighing a tenth: rows and deviations weighed by hand."""
    entries = []
    for k in range(2):
        write_parquet(tmp_path / f"run{k}.parquet", recording("A", seconds=25, rate=100, seed=k)[0])
        entries.append({"file": f"run{k}.parquet"})
    keys = {"estimator": "recursive", "forgetting": 0.1, "reduction": False}
    fit = fit_study(load_study(write_study(tmp_path, entries, **keys)))
    R = [weighted_factor(system.factors, fit.full.sigma, fit.full.b) for system in fit.systems]
    both = np.vstack([np.sqrt(0.1) * R[0], R[1]])
    assert np.allclose(np.linalg.lstsq(both[:, :-1], both[:, -1], rcond=None)[0], fit.full.chi, atol=1e-6)
    A = 0.1 * R[0][:, :-1].T @ R[0][:, :-1] + R[1][:, :-1].T @ R[1][:, :-1]
    middle = 0.01 * R[0][:, :-1].T @ R[0][:, :-1] + R[1][:, :-1].T @ R[1][:, :-1]
    white = np.sqrt(np.diag(np.linalg.solve(A, np.linalg.solve(A, middle).T)))
    one = fit_study(load_study(write_study(tmp_path, entries[1:], **keys)))
    plain = fit_study(load_study(write_study(tmp_path, entries[1:], reduction=False)))
    assert np.allclose(one.full.chi, plain.full.chi) and np.allclose(one.std, plain.std)
    usual = np.median(plain.std / np.sqrt(np.diag(np.linalg.inv(R[1][:, :-1].T @ R[1][:, :-1]))))
    assert 0.9 * usual < np.median(fit.std / white) < 1.5 * usual  # faded rows are counted as if fitted


def test_gains_by_tls_through_a_fit(tmp_path):
    table = recording("C", seconds=40, rate=200, noise=0.0)[0]
    rng = np.random.default_rng(4)
    for j in range(1, 8):  # currents as noisy as torques, gain 2
        table[f"i{j}"] = table.pop(f"tau_m{j}") / 2.0 + 0.3 * rng.normal(size=len(table["t"]))
        table[f"tau_l{j}"] = table[f"tau_l{j}"] + 0.3 * rng.normal(size=len(table["t"]))
    write_parquet(tmp_path / "run.parquet", table)
    for model in ("D", "C", "A"):
        keys = {"estimator": "tls", "drive_gains": "identify", "reduction": False}
        fit = fit_study(load_study(write_study(tmp_path, [{"file": "run.parquet"}], model, **keys)))
        if model == "D":
            gains = fit.full.chi[sorted(fit.columns.gain_columns.values())]
            std = fit.std[sorted(fit.columns.gain_columns.values())]
            assert np.all(np.abs(gains - 2) < 4 * std) and np.all(std < 0.1)
        else:
            assert any("identified by model D" in note for note in fit.notes)
            assert np.allclose(fit.study.drive_gains, gains)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"estimator": "iv"}, "add controller: {bandwidth_hz: 10}"),
        ({"estimator": "didim", "controller": {}, "model": "B"}, "write model: A or C without channels"),
        ({"estimator": "iv", "controller": {}, "effects": ["spring:1"]}, "leave effects out"),
        ({"estimator": "iv", "controller": {"kp": [1.0]}}, "kp and kd go together"),
        ({"estimator": "iv", "controller": {"kp": [1.0], "kd": [1.0]}}, "has 1 values"),
        ({"estimator": "iv", "controller": {}}, "has no column q_ref1"),
        ({"estimator": "iv", "controller": {"gain": 1}}, "unknown key; the keys are kind, bandwidth_hz"),
        ({"estimator": "tls"}, "write drive_gains: identify"),
        ({"estimator": "recursive"}, "give forgetting: 0.9"),
        ({"forgetting": 0.9}, "acts with estimator: recursive"),
    ],
)
def test_what_an_estimator_cannot_do_is_one_sentence(tmp_path, keys, said, capsys):
    from ident.command_line.cli import run

    write_parquet(tmp_path / "run.parquet", recording("A", seconds=25, rate=100)[0])
    study = write_study(tmp_path, [{"file": "run.parquet"}], keys.pop("model", "A"), **keys)
    assert run(["fit", str(study), "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err.strip()
    assert said in error and len(error.splitlines()) == 1
