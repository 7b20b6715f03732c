"""The criterion: an e-value on rows that chose nothing, blind to the rigid model's parameters."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.stats

from ident.diagnosis.evidence.blocks import block_sums, enough, rarely, weights
from ident.diagnosis.evidence.evidence import weigh
from ident.diagnosis.evidence.metric import orthonormal, side_by_side
from ident.diagnosis.evidence.refine import Refined
from ident.diagnosis.search.weighing import Weighed, nearly

M = 480


def problem(tiny, rng, size=0.0, shift=None):
    """Five columns, a candidate, noise; the candidate's share of the torque."""
    X = rng.normal(size=(M, 5))
    z = rng.normal(size=(M, 2))
    y = X @ (rng.normal(size=5) if shift is None else shift) + rng.normal(size=M) + size * z[:, 0]
    return tiny["metric"](tiny["rows"](X, y)), z


def test_false_findings_keep_to_their_rate(tiny):
    """P(log E > ln 1/alpha) <= alpha for a search among six candidates on the fitted rows."""
    rng = np.random.default_rng(0)
    told = []
    for _ in range(200):
        X, Z = rng.normal(size=(M, 4)), rng.normal(size=(M, 6))
        m = tiny["metric"](tiny["rows"](X, rng.normal(size=M)))
        best = max(range(6), key=lambda k: weigh(m, {0: Z[:, [k]]}).gain)
        told.append(weigh(m, {0: Z[:, [best]]}).log_e)
    told = np.array(told)
    for alpha in (0.05, 0.01):
        most = scipy.stats.binom.isf(1e-3, len(told), alpha)  # of 200 at that rate
        assert np.sum(told > np.log(1 / alpha)) <= most
    assert np.mean(np.exp(told)) < 1.5  # an e-value: its mean is one at most


def test_what_is_there_is_found(tiny):
    rng = np.random.default_rng(1)
    m, z = problem(tiny, rng, size=1.0)
    e = weigh(m, {0: z[:, [0]]})
    assert e.log_e > np.log(4000) and e.supported(0.01)
    assert e.sizes == pytest.approx([1.0], abs=0.2)
    assert e.per_channel.sum() == pytest.approx(e.log_e) and e.left > 0.9


def test_it_does_not_depend_on_the_models_parameters(tiny):
    """The same noise on any chi gives the same evidence (residual contrasts)."""
    told = []
    for shift in (np.zeros(5), np.array([100.0, -3.0, 7.0, 1e3, 0.1])):
        m, z = problem(tiny, np.random.default_rng(2), 0.3, shift)
        told.append(weigh(m, {0: z}))
    assert told[0].log_e == pytest.approx(told[1].log_e, rel=1e-6)
    assert told[0].sizes == pytest.approx(told[1].sizes, rel=1e-6)
    assert told[0].blocks == pytest.approx(told[1].blocks, rel=1e-5, abs=1e-6)


def test_it_is_the_gaussian_likelihood_ratio(tiny):
    """Against least squares by hand: null and hypothesis both with the model refitted on the judged rows."""
    rng = np.random.default_rng(3)
    m, z = problem(tiny, rng, 0.3)
    e = weigh(m, {0: z})
    X, y = m.rows.base[0][1], m.rows.Y[0]
    first, second = np.arange(M // 2), np.arange(M // 2, M)

    def rss(columns, torque):
        return float(np.sum((torque - columns @ np.linalg.lstsq(columns, torque)[0]) ** 2))

    a = np.linalg.lstsq(np.hstack([X, z])[first], y[first])[0][5:]
    ratio = rss(X[second], y[second]) / rss(X[second], (y - z @ a)[second])
    assert e.sizes == pytest.approx(a, rel=1e-6)
    assert e.log_e == pytest.approx((M // 2 - 5) / 2 * np.log(ratio), rel=1e-6)


def test_columns_of_the_model_say_nothing(tiny):
    rng = np.random.default_rng(4)
    m, _ = problem(tiny, rng)
    e = weigh(m, {0: m.rows.base[0][1][:, [2]]})
    assert e.left < 1e-9 and abs(e.log_e) < 1e-3


def test_a_single_burst_is_not_supported(tiny):
    """All the gain in one block of a minute: log E says yes, the blocks do not agree."""
    rng = np.random.default_rng(5)
    long = 5 * M
    y, z = rng.normal(size=long), np.zeros(long)
    z[100:110] = z[long // 2 + 100 : long // 2 + 110] = 1.0
    m = tiny["metric"](tiny["rows"](rng.normal(size=(long, 3)), y + 8 * z))
    e = weigh(m, {0: (z + 1e-2 * rng.normal(size=long))[:, None]})
    assert e.log_e > np.log(4000) and not e.supported(0.01)


def test_blocks_that_count_alike_are_a_sign_test():
    for blocks in (12, 30):
        weight = weights(np.full(blocks, np.inf))
        asked = -(-enough(weight, 0.01) // int(weight[0]))
        rare = rarely(blocks, 0.01)
        assert (
            scipy.stats.binom.sf(asked - 1, blocks, 0.5)
            <= rare
            < scipy.stats.binom.sf(asked - 2, blocks, 0.5)
        )


def test_agreement_by_chance_is_as_rare_as_it_says():
    """Whatever the blocks are expected to gain, coins pass no more often than alpha."""
    rng = np.random.default_rng(7)
    for expected in (np.full(40, 3.0), rng.exponential(1.0, 40), np.geomspace(1e-3, 50.0, 40)):
        weight = weights(expected)
        passed = np.mean((rng.random((20_000, 40)) < 0.5) @ weight >= enough(weight, 0.01))
        assert passed <= 1.2 * 0.01


def test_blocks_in_which_an_effect_does_not_act_have_no_say(tiny):
    """It acts in a sixth of them: their signs are half and half elsewhere, and all agree there."""
    rng = np.random.default_rng(8)
    long = 5 * M
    acts = (np.arange(long) // 50) % 6 == 0
    z = np.where(acts, 1.0, 0.01) * rng.normal(size=long)
    m = tiny["metric"](tiny["rows"](rng.normal(size=(long, 3)), rng.normal(size=long) + 0.4 * z))
    e = weigh(m, {0: z[:, None]})
    alike = replace(e, expected=np.full(len(e.blocks), np.inf))
    assert e.supported(0.01) and not alike.supported(0.01)


def test_orthonormal_leaves_out_what_has_no_data():
    A = np.random.default_rng(6).normal(size=(40, 3))
    A = np.column_stack([A, A[:, 0] + A[:, 1], np.zeros(40)])
    basis = orthonormal(A.T @ A)
    assert basis.shape == (5, 3)
    assert np.allclose((A @ basis).T @ (A @ basis), np.eye(3), atol=1e-7)


def test_blocks_keep_the_sum(tiny):
    rows = tiny["rows"](np.ones((M, 1)), np.zeros(M))
    values = np.random.default_rng(7).normal(size=M)
    blocks = block_sums(rows, values, rows.judged)
    assert len(blocks) >= 12
    assert blocks.sum() == pytest.approx(values[rows.judged].sum(), abs=3.0)


def test_what_too_few_blocks_confirm_is_near_and_the_rest_is_not(tiny):
    """Of hypotheses that pass all but the blocks' agreement the strongest of each channel; none of what says
    too little, and none of what is told."""
    rng = np.random.default_rng(8)
    m, z = problem(tiny, rng, size=1.0)
    told = weigh(m, {0: z[:, [0]]})
    few = np.where(np.arange(len(told.blocks)) % 2, -1.0, 3.0)
    split = replace(told, blocks=few, expected=np.full(len(few), 2.0))
    against = replace(split, blocks=np.where(np.arange(len(few)) == 1, -20.0, few))

    def near(*evidence):
        names = [SimpleNamespace(key=k, free=1) for k in range(len(evidence))]
        hypotheses = [(Refined(name, {0: z[:, [0]]}, np.ones(1), 9.0), e) for name, e in zip(names, evidence)]
        return [(r.term.key, [q.term.key for q in beside]) for r, e, beside in
                nearly(Weighed(m, tuple(hypotheses), (), tuple(hypotheses)), np.log(4000), 0.01)]  # fmt: skip

    assert told.supported(0.01) and not split.supported(0.01)
    assert near(split) == [(0, [])]
    assert near(split, replace(split, log_e=split.log_e - 1)) == [(0, [1])]
    assert near(replace(split, log_e=5.0)) == [] and near(told) == []
    assert against.contradicted(0.01) and near(against) == []
    assert not split.contradicted(0.01) and not told.contradicted(0.01)


def test_what_acts_in_other_channels_has_as_many_columns_everywhere():
    """Two effects that were told together, one of them of a motor's torque and one of its sensor's, too."""
    one, other = {0: np.full((4, 1), 2.0)}, {0: np.ones((4, 2)), 1: np.full((4, 2), 3.0)}
    both = side_by_side(one, other)
    assert {c: z.shape for c, z in both.items()} == {0: (4, 3), 1: (4, 3)}
    assert (both[0] == [2, 1, 1]).all() and (both[1] == [0, 3, 3]).all()
