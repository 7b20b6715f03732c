"""Friction under load, held to a simulated arm: which share of an offset the gear carries, and the width
within which all that steps with a joint's sign turns over."""

import json

import numpy as np
import pytest

from benchmarks.closing_twice import ARM
from ident.diagnosis.diagnosis import diagnose_study
from ident.diagnosis.evidence.refine import refine
from ident.diagnosis.evidence.settled import with_found
from ident.diagnosis.evidence.state import Found
from ident.diagnosis.evidence.turned import turned
from ident.diagnosis.opening import opened
from ident.diagnosis.rows.steps import multiplies_sign, steps
from ident.diagnosis.rows.terms import Term
from ident.equations.prepared import prepare_study
from ident.recordings.study import load_study
from ident.twin import PlannedRun, Sensors, simulate, write_simulation
from ident.twin.parameters import twin_parameters
from modelgen.effects import catalogue
from modelgen.geometry.robot_file import load_robot

RUNS = (PlannedRun("run1", "identify", 14.0), PlannedRun("run2", "validate", 10.0))


@pytest.fixture
def loaded(tmp_path):
    """study(seed, **standard): an arm of two joints, the first with a friction of 0.3 of its load."""
    (tmp_path / "small.yaml").write_text(ARM)

    def study(seed, **standard):
        robot = tmp_path / "small.yaml"
        known = twin_parameters(load_robot(str(robot)), None, seed).standard | standard
        (tmp_path / "known.json").write_text(json.dumps(known))
        made = simulate(
            robot,
            "A",
            ("load_dependent_friction:1:mu=0.3",),
            seed=seed,
            sensors=Sensors(rate_hz=250.0),
            runs=RUNS,
            parameters=tmp_path / "known.json",
        )
        return write_simulation(made, tmp_path / "study")

    return study


@pytest.mark.long
def test_an_offset_behind_the_teeth_is_no_second_friction(loaded):
    """Of one that counted as none of the load a friction by position and a Stribeck friction were told."""
    d = diagnose_study(load_study(loaded(2, Offm1=-0.3, Offl1=-0.2)))
    assert [(f.effect, f.joints) for f in d.findings] == [("load_dependent_friction", (1,))]
    assert not d.unexplained
    assert d.findings[0].parameters["mu"]["value"] == pytest.approx(0.3, abs=0.02)


@pytest.mark.long
def test_all_that_steps_with_a_sign_turns_over_at_once(loaded):
    """The width was sought beside the load's friction as it had turned over before: 0.16 mrad/s, then 9, then
    0.16 again."""
    begun = opened(prepare_study(load_study(loaded(4))))
    effect = catalogue()["load_dependent_friction"]
    place = next(place for place in effect.places(begun.layout) if place.joint == 0)
    found = refine(begun.state.metric, begun.state.scene, Term(effect, place, effect.complete(None)))
    once = with_found(begun.state, Found(found.term, found.columns, found.sizes))
    assert turned(once).turns[0].rate == pytest.approx(once.turns[0].rate, rel=0.05)


def test_what_a_sign_multiplies_is_what_changes_with_it(loaded):
    """A Stribeck friction is a multiple of the sign; a hysteresis has a memory, a cubic friction no sign."""
    begun = opened(prepare_study(load_study(loaded(4))))
    motion, model = begun.state.motions[0], begun.state.model
    terms = {}
    for name in ("stribeck_friction", "hysteresis", "nonlinear_viscous_friction"):
        effect = catalogue()[name]
        place = next(place for place in effect.places(begun.layout) if place.joint == 0)
        terms[name] = Term(effect, place, effect.complete(None))
    assert [multiplies_sign(term, 0) for term in terms.values()] == [True, False, False]
    assert not multiplies_sign(terms["stribeck_friction"], 1)
    made = steps(terms["stribeck_friction"], motion, model)[0][:, 0]
    vs = terms["stribeck_friction"].theta["vs"]
    np.testing.assert_allclose(made, np.exp(-((motion.dq[:, 0] / vs) ** 2)), atol=1e-12)
