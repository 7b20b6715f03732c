"""What is said to be seen in 95 of 100 cases is, by the loop's own rule on rows with that effect in them."""

from dataclasses import replace

import numpy as np
import pytest

from ident.diagnosis.evidence.absorbed import Dryness, dryness, products
from ident.diagnosis.evidence.evidence import weigh
from ident.diagnosis.evidence.given import given_fitted
from ident.diagnosis.evidence.metric import metric, stacked
from ident.diagnosis.evidence.state import solved
from ident.diagnosis.evidence.turned import turned
from ident.diagnosis.outcome import threshold
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.candidates import Library
from ident.diagnosis.telling.visible import POWER, _root, seen_from, smallest_visible
from modelgen.effects import catalogue
from modelgen.effects.place import Place

ALPHA = 0.01


@pytest.fixture(scope="module")
def case(tiny):
    """A metric of white rows, two columns that nobody has, and how to draw its torque again."""
    rng = np.random.default_rng(1)
    base, extra = rng.normal(size=(2400, 3)), rng.normal(size=(2400, 2))
    extra[:, 1] += base[:, 0]

    def drawn(torque):
        return tiny["metric"](tiny["rows"](base, torque))

    return drawn, extra, rng


def share_seen(drawn, extra, v, size, rng):
    """Of 300 draws; and the share that the judged rows show by themselves."""
    tau, seen, alone = threshold(ALPHA), 0, 0
    for _ in range(300):
        m = drawn(rng.normal(size=len(extra)) + size * extra @ v)
        e = weigh(m, {0: extra})
        given = given_fitted(m, m.both, {0: extra}, e.sizes).of(e)
        here = e.log_e > tau and e.supported(ALPHA)
        there = given.log_e > tau and given.supported(ALPHA) and not given.contradicted(ALPHA)
        seen += e.gain > tau and (here or there)
        alone += e.gain > tau and here
    return seen / 300, alone / 300


@pytest.mark.first_case
@pytest.mark.parametrize("shape", [(1.0, 0.0), (0.4, 1.0)])
def test_95_of_100_are_seen(case, shape):
    drawn, extra, rng = case
    v = np.array(shape)
    size = seen_from(drawn(rng.normal(size=len(extra))), {0: extra}, v, 0, threshold(ALPHA), ALPHA)
    seen, _ = share_seen(drawn, extra, v, size, rng)
    assert seen == pytest.approx(POWER, abs=0.04)  # three sigma of 300 draws


def test_95_of_100_are_seen_of_what_the_judged_rows_show_given_the_fitted_ones_alone(tiny):
    """A torque that a parameter of the model answers on either side, each time with another value."""
    rng = np.random.default_rng(4)
    base, extra = rng.normal(size=(2400, 3)), rng.normal(size=(2400, 1))
    fitted = np.arange(2400) < 1200
    extra[:, 0] = base[:, 0] * np.where(fitted, 0.1, -0.1) + extra[:, 0] * np.where(fitted, 0.1, 0.03)

    def drawn(torque):
        return tiny["metric"](tiny["rows"](base, torque))

    v = np.ones(1)
    size = seen_from(drawn(rng.normal(size=2400)), {0: extra}, v, 0, threshold(ALPHA), ALPHA)
    seen, alone = share_seen(drawn, extra, v, size, rng)
    assert seen == pytest.approx(POWER, abs=0.04)
    assert alone < 0.5


def test_nine_of_ten_slow_ones_are_seen_beside_noise_that_may_be_slow(tiny):
    """A torque that rises over each run, beside white noise that is not known to be white."""
    rng, tau, v = np.random.default_rng(6), threshold(ALPHA), np.ones(1)
    base, t = rng.normal(size=(2400, 3)), np.tile(np.linspace(-1.0, 1.0, 1200), 2)
    base[:, 0], extra = 1.0, t[:, None]

    def drawn(torque):
        plain = tiny["metric"](tiny["rows"](base, torque))
        return metric(plain.rows, *stacked(plain.rows, []), plain.whiteners)

    size = seen_from(drawn(rng.normal(size=2400)), {0: extra}, v, 0, tau, ALPHA)
    told = [weigh(drawn(rng.normal(size=2400) + size * t), {0: extra}) for _ in range(40)]
    assert np.mean([e.log_e > tau and e.gain > tau for e in told]) >= 0.85
    white = seen_from(tiny["metric"](tiny["rows"](base, rng.normal(size=2400))), {0: extra}, v, 0, tau, ALPHA)
    assert size > 1.5 * white


def test_rounding_does_not_draw_anew():
    """Of equal and of nearly equal eigenvalues, whose vectors rounding turns as it likes."""
    rng = np.random.default_rng(3)
    Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    for A in (np.eye(3), 4.0 * np.eye(3) + 1e-15, Q @ np.diag([1.0, 1.0, 3.0]) @ Q.T):
        R = _root(A)
        assert np.allclose(R @ R.T, np.linalg.inv(A), atol=1e-12)
        for _ in range(20):
            E = rng.normal(size=(3, 3)) * 1e-15
            assert _root(A + E + E.T) == pytest.approx(R, abs=1e-12)
    blind = np.array([[1.0, 1.0], [1.0, 1.0]])
    assert np.allclose(_root(blind) @ _root(blind).T, 0.25, atol=1e-12)


def test_what_the_model_holds_is_never_seen(case, tiny):
    rng = np.random.default_rng(2)
    base = rng.normal(size=(1200, 3))
    m = tiny["metric"](tiny["rows"](base, rng.normal(size=1200)))
    assert seen_from(m, {0: base[:, :1] + base[:, 1:2]}, np.ones(1), 0, threshold(ALPHA), ALPHA) is None


def test_what_the_turn_over_takes_up_is_what_it_takes_when_it_is_settled_again(clean_arm):
    """A power law of three times the joint's dry friction, in the rows themselves; half of it goes into the
    turn-over's width."""
    state, size = clean_arm.state, 0.3
    term = Term(catalogue()["power_law_friction"], Place(joint=0), {"p": 0.5})
    columns = state.scene.columns(term)
    Y = state.rows.Y.copy()
    Y[0] += size * columns[0][:, 0]
    again = turned(solved(replace(state, rows=replace(state.rows, Y=Y))))
    as_white = metric(again.rows, *again.design, again.whiteners, slow=False)
    real = weigh(as_white, again.scene.columns(term)).log_e

    def expected(dry):
        left = products(state.metric, state.metric.whiten(columns), dry).left(np.ones(1), size)
        b, free = left.own[0] / left.A[0, 0], state.metric.judged.free[0]
        own, square = b * left.own_blocks.sum(), b * b * left.A_blocks.sum()
        wrong = left.square_blocks.sum() - 2 * own + square
        return free / 2 * np.log1p((2 * own - square) / (free + wrong))

    assert expected(dryness(state, 0)) == pytest.approx(real, rel=0.3)  # a ladder of widths, and no noise
    assert expected(None) > 1.4 * real


@pytest.mark.parametrize("shown", [0.0, 1.0])
def test_a_sign_that_the_model_imitates_wholly_takes_up_nothing(tiny, shown):
    """Of a joint that has no rows, or whose sign is what the others' columns make of it."""
    rng = np.random.default_rng(5)
    base, extra = rng.normal(size=(1200, 3)), rng.normal(size=(1200, 1))
    m = tiny["metric"](tiny["rows"](base, rng.normal(size=1200)))
    sign = shown * base @ np.array([[1.0], [2.0], [0.0]])
    left = products(m, {0: extra}, Dryness(m, {0: np.hstack((sign, 0.5 * sign))}, 1.0)).left(np.ones(1), 0.3)
    alone = products(m, {0: extra}).left(np.ones(1), 0.3)
    for told, bare in ((left.A, alone.A), (left.A_blocks, alone.A_blocks), (left.own, alone.own)):
        assert told == pytest.approx(bare, rel=1e-9)


@pytest.mark.long
def test_every_joint_is_told_its_sizes(clean_arm):
    from ident.diagnosis.loop import trace

    library = Library(list(catalogue().values()), clean_arm.layout, clean_arm.room.library)
    outcome = trace(clean_arm.state, library, ALPHA)
    told = smallest_visible(outcome.last, library, outcome.tau, ALPHA)
    assert {its.joints for its in told} == {(1,), (2,), (3,)}
    assert len({its.effect for its in told}) > 10
    assert all(np.isfinite(its.share) and its.share > 0 for its in told)
    closed = smallest_visible(outcome.last, library, outcome.tau, ALPHA, frozenset({0}))
    assert {its.joints for its in closed} == {(2,), (3,)}
