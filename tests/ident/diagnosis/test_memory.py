"""A state of the diagnosis is megabytes of columns: it has to go with the last that holds it."""

import gc
import weakref
from dataclasses import replace

from ident.diagnosis.evidence.refine import refine
from ident.diagnosis.evidence.state import Found, solved
from ident.diagnosis.rows.terms import Term
from modelgen.effects import effect


def test_a_state_goes_with_its_last_holder(clean_arm):
    """And not at the next collection of circles, until which ten minutes of seven joints grew to 4 GB."""
    gain = effect("drive_gain_error")
    term = Term(gain, next(iter(gain.places(clean_arm.layout))), {})
    state = replace(clean_arm.state)
    gc.disable()
    try:
        r = refine(state.metric, state.scene, term)  # a multiple of the model's torque, beside its own fit
        trial = solved(state.plus(Found(r.term, r.columns, r.sizes)))
        refine(trial.metric, trial.scene, term)
        gone = [weakref.ref(state), weakref.ref(trial)]
        del state, trial, r
        assert [ref() for ref in gone] == [None, None]
    finally:
        gc.enable()
