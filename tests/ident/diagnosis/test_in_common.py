"""What short judged rows show only given the fitted ones: an e-value, and no answer to runs that differ."""

import os
from pathlib import Path

import numpy as np
import pytest
import scipy.stats

from ident.diagnosis import diagnose_study
from ident.diagnosis.evidence.evidence import over, weigh
from ident.diagnosis.evidence.given import given_fitted
from ident.recordings.study import load_study

M = 480
DATA = Path(os.environ.get("DYNIDENT_DATA") or Path(__file__).parents[4] / "shared" / "data")


def hidden(rng, size, own=0.0):
    """Five columns and a candidate that on the second half, which judges, is nearly one of them; own: of the
    first parameter, what it is more there."""
    X, late = rng.normal(size=(M, 5)), np.arange(M) >= M // 2
    z = np.where(late, X[:, 0] + 1e-3 * rng.normal(size=M), rng.normal(size=M))[:, None]
    y = X @ rng.normal(size=5) + rng.normal(size=M) + size * z[:, 0] + own * late * X[:, 0]
    return X, y, z


def test_false_findings_keep_to_their_rate(tiny):
    """A search among six candidates on the fitted rows; the mean of an e-value is one at most."""
    rng, told = np.random.default_rng(0), []
    for _ in range(200):
        X, Z = rng.normal(size=(M, 4)), rng.normal(size=(M, 6))
        m = tiny["metric"](tiny["rows"](X, rng.normal(size=M)))
        best = max((weigh(m, {0: Z[:, [k]]}).gain, k) for k in range(6))[1]
        columns = {0: Z[:, [best]]}
        told.append(given_fitted(m, m.both, columns, weigh(m, columns).sizes).per_channel.sum())
    for alpha in (0.05, 0.01):
        assert np.sum(np.array(told) > np.log(1 / alpha)) <= scipy.stats.binom.isf(1e-3, len(told), alpha)
    assert np.mean(np.exp(told)) < 1.5


def test_what_the_judged_rows_alone_do_not_show(tiny):
    X, y, z = hidden(np.random.default_rng(1), 1.0)
    m = tiny["metric"](tiny["rows"](X, y))
    alone = weigh(m, {0: z})
    given = given_fitted(m, m.both, {0: z}, alone.sizes)
    assert abs(alone.log_e) < 1 and given.per_channel.sum() > 8 and given.differ < 0


def test_it_is_the_ratio_of_all_rows_over_that_of_the_fitted_ones(tiny):
    X, y, z = hidden(np.random.default_rng(2), 0.5)
    m = tiny["metric"](tiny["rows"](X, y))
    sizes = weigh(m, {0: z}).sizes

    def nats(rows):
        left = [np.linalg.lstsq(X[rows], torque[rows])[1][0] for torque in (y, y - z @ sizes)]
        return (len(rows) - 5) / 2 * np.log(left[0] / left[1])

    expected = nats(np.arange(M)) - nats(np.arange(M // 2))
    assert given_fitted(m, m.both, {0: z}, sizes).per_channel.sum() == pytest.approx(expected, rel=1e-6)


def test_beside_a_model_that_did_its_best_without_it(tiny):
    """Two models, each with columns of its own, the one with the candidate: what is told given the fitted
    rows is the ratio of these two on all rows over that on the fitted ones."""
    rng = np.random.default_rng(4)
    X, y, z = hidden(rng, 0.5)
    before = X + 0.1 * rng.normal(size=X.shape)
    null, m = (tiny["metric"](tiny["rows"](columns, y)) for columns in (before, X))
    own = weigh(m, {0: z})
    told = over(null, m, given_fitted(m, m.both, {0: z}, own.sizes).of(own))

    def nats(rows):
        models = ((before, y), (X, y - z @ own.sizes))
        left = [np.linalg.lstsq(columns[rows], torque[rows])[1][0] for columns, torque in models]
        return (len(rows) - 5) / 2 * np.log(left[0] / left[1])

    assert told.log_e == pytest.approx(nats(np.arange(M)) - nats(np.arange(M // 2)), rel=1e-6)


def test_runs_of_other_parameters_are_said_to_differ(tiny):
    """A parameter that is another one in the judged rows looks like a candidate there, and is none."""
    X, y, z = hidden(np.random.default_rng(3), 0.15, own=1.0)
    m = tiny["metric"](tiny["rows"](X, y))
    assert given_fitted(m, m.both, {0: z}, weigh(m, {0: z}).sizes).differ > 8


@pytest.mark.long
@pytest.mark.skipif(
    not (DATA / "franka_panda").is_dir(), reason="the recordings of measured robots are not here"
)
def test_a_spring_in_ten_seconds_of_a_franka(tmp_path):
    """As strong over its third joint's range as a fifth of its torque."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    read = pq.read_table(DATA / "franka_panda" / "excite_first.parquet")
    table = {name: read.column(name).to_numpy()[::4] for name in read.column_names}
    q, tau = table["q3"], table["tau_l3"]
    k = 0.2 * np.std(tau) / np.std(q)
    pq.write_table(pa.table(table | {"tau_l3": tau + k * (q - q.mean())}), tmp_path / "run.parquet")
    ends = (("identify", 0, 6.5), ("validate", 6.5, 9.8), ("test", 9.8, 1e3))
    entries = "".join(
        f"- {{file: run.parquet, use: {use}, name: {use}, from: {begin}, to: {end}}}\n"
        for use, begin, end in ends
    )
    text = f"robot: franka_panda\nmodel: B\nlink_inertia: true\nrecordings:\n{entries}"
    (tmp_path / "study.yaml").write_text(text, encoding="utf-8")
    (finding,) = diagnose_study(load_study(tmp_path / "study.yaml")).findings
    assert (finding.effect, finding.joints) == ("spring", (3,))
    assert finding.parameters["k"]["value"] == pytest.approx(k, rel=0.15)
