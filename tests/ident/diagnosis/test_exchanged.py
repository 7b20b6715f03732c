"""What the fitted rows say of what the judged ones have chosen: each pays for the search that they were."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from planted import ON_RECORDINGS, with_fault

from ident.diagnosis import diagnose_study
from ident.diagnosis.evidence.evidence import weigh
from ident.diagnosis.outcome import BUDGET
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.candidates import Library
from ident.diagnosis.search.exchanged import by_the_fitted, price
from ident.recordings.study import load_study
from modelgen.effects import catalogue
from modelgen.effects.place import Place

M, CANDIDATES = 240, 40


def exchanged(rows):
    return replace(rows, fitted=rows.judged, judged=rows.fitted)


def test_false_findings_keep_to_their_rate(tiny):
    """The best of forty candidates by the fitted rows, which then judge it: no e-value without the price, as
    its mean is above one."""
    rng, told = np.random.default_rng(0), []
    for _ in range(200):
        X, Z = rng.normal(size=(M, 4)), rng.normal(size=(M, CANDIDATES))
        rows = tiny["rows"](X, rng.normal(size=M))
        here = [np.column_stack([Z, rows.Y[0]])[rows.fitted], X[rows.fitted]]
        left = here[0] - here[1] @ np.linalg.lstsq(here[1], here[0])[0]
        gains = (left[:, :-1].T @ left[:, -1]) ** 2 / np.sum(left[:, :-1] ** 2, axis=0)
        columns = {0: Z[:, [int(np.argmax(gains))]]}
        told.append(weigh(tiny["metric"](exchanged(rows)), columns).log_e)
    alpha, dear = 0.05, np.log(CANDIDATES)
    assert np.mean(np.exp(told)) > 1 > np.mean(np.exp(np.array(told) - dear))
    most = scipy.stats.binom.isf(1e-3, len(told), alpha)
    assert np.sum(np.array(told) - dear > np.log(1 / alpha)) <= most


def test_what_few_rows_judge_many_show(tiny):
    """A torque of 0.8 times the noise in 6 of 120 judged rows, and in 60 of 120 fitted ones."""
    rng = np.random.default_rng(1)
    X, late = rng.normal(size=(M, 3)), np.arange(M) >= M // 2
    z = np.where(late & (np.arange(M) % 20 > 0), 0.0, rng.normal(size=M))[:, None]
    rows = tiny["rows"](X, X @ np.ones(3) + rng.normal(size=M) + 0.8 * z[:, 0])
    judged = weigh(tiny["metric"](rows), {0: z})
    shown = weigh(tiny["metric"](exchanged(rows)), {0: z})
    assert 0 < judged.log_e < 8 < shown.log_e - np.log(2000 / BUDGET)


def test_the_price_is_that_of_this_robot_s_catalogue(clean_arm):
    """Three joints with motors alone have fewer places than seven with sensors; what is said is paid for."""
    state = clean_arm.state
    library = Library(list(catalogue().values()), clean_arm.layout)
    asked = {(e.name, place) for e, place in library.places}
    assert len(asked) <= state.problem.asked < 837
    assert price(state) == pytest.approx(np.log(state.problem.asked / BUDGET)) and price(state) > 1
    columns = state.scene.columns(Term(catalogue()["power_law_friction"], Place(joint=0), {"p": 0.5}))
    m, told = by_the_fitted(state, columns)
    assert told.log_e == pytest.approx(weigh(m, columns).log_e - price(state))
    small = replace(state, problem=replace(state.problem, asked=1))
    assert price(small) == 0.0


@pytest.mark.long
class TestOfAMeasuredRobot:
    pytestmark = ON_RECORDINGS

    def test_a_spring_of_an_airbot(self, tmp_path):
        """Of 20 s of a validate run 8.0 nats are left beside slow noise of any size."""
        told = diagnose_study(load_study(with_fault("airbot_play", "a spring", tmp_path)))
        spring = next(f for f in told.findings if f.effect == "spring")
        assert spring.joints == (3,)
        before, after = (fit.full_rate_error["test"]["tau_m3"] for fit in (told.first, told.last))
        assert after < 0.5 * before
