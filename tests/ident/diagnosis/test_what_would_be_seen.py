"""What is said to be seen in 95 of 100 cases is, by the loop's own rule on rows with that effect in them."""

import numpy as np
import pytest

from ident.diagnosis.candidates import Library
from ident.diagnosis.evidence import weigh
from ident.diagnosis.loop import threshold
from ident.diagnosis.visible import POWER, seen_from, smallest_visible
from modelgen.effects import catalogue

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


@pytest.mark.parametrize("shape", [(1.0, 0.0), (0.4, 1.0)])
def test_95_of_100_are_seen(case, shape):
    drawn, extra, rng = case
    v, tau = np.array(shape), threshold(ALPHA)
    size = seen_from(drawn(rng.normal(size=len(extra))), {0: extra}, v, 0, tau, ALPHA)
    seen = 0
    for _ in range(300):
        m = drawn(rng.normal(size=len(extra)) + size * extra @ v)
        e = weigh(m, {0: extra})
        seen += e.log_e > tau and e.gain > tau and e.supported(ALPHA)
    assert seen / 300 == pytest.approx(POWER, abs=0.04)  # three sigma of 300 draws


def test_what_the_model_holds_is_never_seen(case, tiny):
    rng = np.random.default_rng(2)
    base = rng.normal(size=(1200, 3))
    m = tiny["metric"](tiny["rows"](base, rng.normal(size=1200)))
    assert seen_from(m, {0: base[:, :1] + base[:, 1:2]}, np.ones(1), 0, threshold(ALPHA), ALPHA) is None


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
