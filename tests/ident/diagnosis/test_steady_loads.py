"""A load that all torques feel is told where no function of the positions says more than it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_arm import ARM

import ident
from ident.diagnosis.evidence import sufficiency
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
from ident.twin import PlannedRun, Sensors, simulate, write_simulation
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


def test_a_tilt_is_one_that_leaves_functions_nothing(arm, monkeypatch):
    """Though its part in one torque says less than these: the model made up for it in the others' units."""
    more = SimpleNamespace(evidence=SimpleNamespace(log_e=1e6), variables=("q1",))
    for rest in (None, more):
        monkeypatch.setattr(sufficiency, "ask", lambda state, *_, rest=rest: rest if state.found else more)
        _, _, short = tilt_of(arm("base_tilt:roll=0.2,pitch=0.3"))
        assert (short is None) == (rest is None)


@pytest.mark.long
def test_of_an_upright_first_joint_a_tilt_stands_beside_what_follows_its_position(tmp_path):
    """A counterbalance was told alone: it has fewer numbers, and says less of all rows."""
    (tmp_path / "robot.yaml").write_text(ARM)
    sensors = Sensors(200.0, 2e-6, 0.15)
    runs = PlannedRun("run1", "identify", 14.0), PlannedRun("run2", "validate", 10.0)
    tilted = simulate(
        tmp_path / "robot.yaml", "A", ["base_tilt:roll=0.01,pitch=-0.01"], seed=3, sensors=sensors, runs=runs
    )
    dry = {1: 0.096, 2: 0.163, 3: 0.009}  # N m, as simulated
    for run in tilted.recordings:
        for j, Fc in dry.items():
            rate = np.gradient(run.columns[f"q{j}"], run.columns["t"])
            softer = np.tanh(rate / 0.005) - np.sign(rate)
            run.columns[f"tau_m{j}"] = run.columns[f"tau_m{j}"] + Fc * softer
    told = ident.diagnose(write_simulation(tilted, tmp_path / "study"))
    (finding,) = told.findings
    assert "base_tilt" in {finding.effect, *(its.effect for its in finding.equivalent)}


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
