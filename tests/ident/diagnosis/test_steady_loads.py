"""A load that all torques feel is told where no function of the positions says more than it."""

from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.evidence import weigh
from ident.diagnosis.evidence.metric import acting
from ident.diagnosis.evidence.refine import refine
from ident.diagnosis.evidence.sufficiency import short_of
from ident.diagnosis.loads.is_a_load import by_what_it_needs, cross_evidence, halves_of
from ident.diagnosis.opening import opened
from ident.diagnosis.outcome import threshold
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.weighing import main_channel
from ident.equations.prepared import prepare_study
from modelgen.effects import effect

ALPHA = 0.01
TAU = threshold(ALPHA)


def tilt_of(study):
    """What a tilted base says of recordings, by which torque, and what is short of it."""
    its = opened(prepare_study(study))
    state, tilt = its.state, effect("base_tilt")
    m = state.plain_metric  # before anything is found a slow torque is noise to the whitened one
    (place,) = tilt.places(its.layout)
    r = refine(m, state.scene, Term(tilt, place, {"roll": 2e-3, "pitch": 2e-3}))
    e = weigh(m, r.columns)
    c = main_channel(e, r.term, state)
    return e, c, short_of(state, m, r, e, c, TAU)


def a_cable(columns):
    """Pulls on the first joint, which stands upright, as the second winds it up."""
    columns["tau_m1"] = columns["tau_m1"] + 0.1 * np.sin(columns["q1"] + 2 * columns["q2"])


def test_a_tilt_is_one(arm):
    e, _, short = tilt_of(arm("base_tilt:roll=0.2,pitch=0.3"))
    assert e.log_e > TAU and short is None


def test_a_cable_is_no_tilt(arm):
    _, c, short = tilt_of(arm(change=a_cable))
    assert c == 0 and short is not None and "q1" in short.flex.variables


def test_a_body_that_weighs_nothing_is_none(arm):
    """Inertias take the noise of an acceleration away; the body of a second must be there without them."""
    its = opened(prepare_study(arm("payload_change:m=1.0,mx=0.02,my=0,mz=0.1,recording=run1,from=4,to=10")))
    state, payload = its.state, effect("payload_change")
    place = max(payload.places(its.layout), key=lambda place: len(place.parts))
    term = Term(payload, replace(place, recording="run1", start=4.0, stop=10.0), {})
    columns = state.scene.columns(term)
    halves = halves_of(state, state.metric, columns)
    e = cross_evidence(halves, columns, acting(columns))
    assert by_what_it_needs(halves, term, columns, e, TAU, ALPHA)
    names = payload.parameters_of(term.place)
    light = {c: z * np.array([name not in payload.needed for name in names]) for c, z in columns.items()}
    hollow = cross_evidence(halves, light, acting(columns))
    assert hollow.log_e > TAU and not by_what_it_needs(halves, term, light, hollow, TAU, ALPHA)
