"""A load told in a part of its time, and the rest of it as a load of another kind, is one load."""

import numpy as np
import pytest

from ident.diagnosis.evidence.state import Found, solved
from ident.diagnosis.loads.one_of_two import one_of_two
from ident.diagnosis.opening import opened
from ident.diagnosis.outcome import Step
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.settling import refined_together
from ident.equations.prepared import prepare_study
from modelgen.effects import effect
from modelgen.effects.place import Place

POINT = {"px": 0.0, "py": 0.0, "pz": 0.0}
FORCE = "external_force:fx=0.1,fy=-0.06,fz=0.06,from=3.04,to=9.5,recording=run1"
BODY = "payload_change:m=0.1,mz=0.01,from=2.0,to=6.0,recording=run1"


def force(start, stop):
    return Term(effect("external_force"), Place(side="link", recording="run1", start=start, stop=stop), POINT)


def body(start, stop):
    weight = ("M", "MX", "MY", "MZ")
    place = Place(side="link", link=3, recording="run1", start=start, stop=stop, parts=weight)
    return Term(effect("payload_change"), place, {})


def told(state, *terms):
    """A state in which they were found, and what is told of them."""
    made = [state.scene.columns(t) for t in terms]
    none = [np.zeros(next(iter(z.values())).shape[1]) for z in made]
    state = refined_together(solved(state.plus(*map(Found, terms, made, none))))
    return state, [Step(t, None, ()) for t in state.terms]


@pytest.fixture(scope="module")
def pushed(arm):
    return opened(prepare_study(arm(FORCE))).state


def test_the_rest_of_a_force_is_no_body(pushed):
    state, (step,) = one_of_two(*told(pushed, force(6.0, 9.5), body(3.2, 7.0)))
    assert step.term.effect.name == "external_force" and state.terms == (step.term,)
    assert (step.term.place.start, step.term.place.stop) == pytest.approx((3.04, 9.5), abs=0.1)


def test_two_that_are_there_stay(arm):
    before = told(opened(prepare_study(arm(FORCE, BODY))).state, force(3.04, 9.5), body(2.0, 6.0))
    assert one_of_two(*before) == before


def test_what_the_study_declares_stays(pushed):
    state, _ = told(pushed, force(6.0, 9.5), body(3.2, 7.0))
    assert one_of_two(state, []) == (state, [])
