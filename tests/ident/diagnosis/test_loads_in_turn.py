"""Loads whose windows overlap are told as those that follow each other, and windows open between rows."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.exam.make_cases import make_case
from ident.diagnosis.diagnosis import diagnose_study
from ident.diagnosis.evidence.metric import whole
from ident.diagnosis.evidence.refine import Refined, fit_sizes
from ident.diagnosis.evidence.state import Found, solved
from ident.diagnosis.loads.edge_gains import gains_with_edge
from ident.diagnosis.loads.edges import edged
from ident.diagnosis.loads.loads_in_turn import in_turn
from ident.diagnosis.loads.windows import since
from ident.diagnosis.opening import opened
from ident.diagnosis.outcome import Step, threshold
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.settling import refined_together
from ident.equations.prepared import prepare_study
from ident.recordings.study import load_study
from modelgen.effects import effect
from modelgen.effects.place import Place

TAU, ALPHA = threshold(0.01), 0.01
POINT = {"px": 0.0, "py": 0.0, "pz": 0.0}


def force(start, stop, copy=0):
    place = Place(side="link", recording="run1", start=start, stop=stop)
    return Term(effect("external_force"), place, POINT, copy=copy)


def found(state, *terms):
    made = [state.scene.columns(t) for t in terms]
    none = [np.zeros(next(iter(z.values())).shape[1]) for z in made]
    return refined_together(solved(state.plus(*map(Found, terms, made, none))))


@pytest.fixture(scope="module")
def pushed_twice(arm):
    forces = ("fx=0.4,fy=-0.3,fz=0.3,from=3.04,to=5.52", "fx=-0.3,fy=0.4,fz=0.3,from=7.27,to=10.31")
    return opened(prepare_study(arm(*(f"external_force:{its},recording=run1" for its in forces)))).state


@pytest.mark.long
def test_three_that_overlap_are_two_in_turn(pushed_twice):
    state = found(pushed_twice, force(3.0, 10.3), force(5.5, 7.3, 1), force(3.0, 5.5, 2))
    steps = [Step(t, None, ()) for t in state.terms]
    state, steps = in_turn(state, steps, TAU, ALPHA)
    windows = sorted((s.term.place.start, s.term.place.stop) for s in steps)
    assert windows == [pytest.approx((3.04, 5.52), abs=0.1), pytest.approx((7.27, 10.31), abs=0.1)]
    assert sorted(t.key for t in state.terms) == sorted(s.term.key for s in steps)


def body(start, stop, copy=0):
    weight = ("M", "MX", "MY", "MZ")
    place = Place(side="link", link=3, recording="run1", start=start, stop=stop, parts=weight)
    return Term(effect("payload_change"), place, {}, copy=copy)


def found_as(study, *terms):
    """A state in which these were found, and the steps that told them."""
    state = found(opened(prepare_study(study)).state, *terms)
    return state, [Step(t, None, ()) for t in state.terms]


PUSH = "external_force:fx=0.1,fy=-0.06,fz=0.06,from=3.04,to=9.5,recording=run1"
BODY = "payload_change:m=0.3,mz=0.03,from=3.0,recording=run1"


@pytest.mark.long
def test_the_rest_of_a_force_is_no_body(arm):
    state, (step,) = in_turn(*found_as(arm(PUSH), force(6.0, 9.5), body(3.2, 7.0)), TAU, ALPHA)
    assert step.term.effect.name == "external_force" and state.terms == (step.term,)
    assert (step.term.place.start, step.term.place.stop) == pytest.approx((3.04, 9.5), abs=0.1)


@pytest.mark.long
def test_a_body_that_comes_later_is_no_force_before_it(tmp_path):
    make_case("twice", ["payload_change"] * 2, 2970592250, "bodies", tmp_path, 30.0, 250.0, "")
    found = diagnose_study(load_study(tmp_path / "cases/bodies/study.yaml")).findings
    assert [f.effect for f in found] == ["payload_change"] * 2


def test_a_body_and_a_force_at_one_time_stay(arm):
    before = found_as(arm(PUSH, BODY), force(3.04, 9.5), body(3.0, None))
    assert in_turn(*before, TAU, ALPHA) == before


def test_two_in_turn_stay(pushed_twice):
    state = found(pushed_twice, force(3.0, 5.5), force(7.3, 10.3, 1))
    steps = [Step(t, None, ()) for t in state.terms]
    assert in_turn(state, steps, TAU, ALPHA) == (state, steps)


def test_what_the_study_declares_stays(pushed_twice):
    """Loads that no step tells are the user's, however they overlap."""
    state = found(pushed_twice, force(3.0, 10.3), force(5.5, 7.3, 1))
    assert in_turn(state, [], TAU, ALPHA) == (state, [])


def test_a_window_opens_between_the_rows(pushed_twice):
    """Two rows off it is found where it was put, to a fraction of a row."""
    state = pushed_twice
    hop = state.rows.hop
    beside = found(state, force(7.27, 10.31))
    m = whole(beside.metric, beside.rows.usable)
    begun = force(3.04 - 2 * hop, 5.52 + 2 * hop, 1)
    columns = beside.scene.columns(begun)
    r = edged(m, beside, Refined(begun, columns, *fit_sizes(m, columns)))
    assert r.term == replace(begun, place=r.term.place)
    assert (r.term.place.start, r.term.place.stop) == pytest.approx((3.04, 5.52), abs=hop)
    assert r.gain > fit_sizes(m, columns)[1] + TAU


@pytest.mark.parametrize("begins", [True, False])
@pytest.mark.parametrize("other", [6.1, None])
def test_gains_with_an_edge_are_those_of_columns_cut_anew(pushed_twice, begins, other):
    m = whole(pushed_twice.metric, pushed_twice.rows.usable)
    wide = pushed_twice.scene.columns(force(None, None))
    rows, t = since(pushed_twice, Place(recording="run1"))
    here, own = m.only(rows), {c: z[rows] for c, z in wide.items()}
    cuts = 3.0 + np.arange(0.0, 1.0, 0.05) if begins else 7.0 + np.arange(0.0, 1.0, 0.05)
    end = (np.inf if begins else -np.inf) if other is None else other
    ends = [(cut, end) if begins else (end, cut) for cut in cuts]
    cut = [{c: z * ((t >= a) & (t < b))[:, None] for c, z in own.items()} for a, b in ends]
    gains = gains_with_edge(here, own, t, cuts, end, begins)
    assert gains == pytest.approx([fit_sizes(here, z)[1] for z in cut], rel=1e-8)
