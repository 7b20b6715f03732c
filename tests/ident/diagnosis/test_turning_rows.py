"""What comes late where joints turn round alone is no late torque."""

import numpy as np
import pytest
from dry_arm import opened_dry_arm

import ident
from benchmarks.false_findings import make
from ident.diagnosis.evidence.evidence import weigh
from ident.diagnosis.evidence.presliding import _by_rate_alone
from ident.diagnosis.evidence.refine import refine
from ident.diagnosis.evidence.turning_rows import without_turning
from ident.diagnosis.outcome import threshold
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.weighing import shifts_all
from modelgen.effects import effect
from modelgen.effects.place import Place

TAU = threshold(0.01)


def late(by):
    """Dry friction that turns over so many samples after its joint."""

    def sign(q, dq):
        return np.sign(np.concatenate([dq[:1].repeat(by, axis=0), dq[:-by]]))

    return sign


def test_friction_that_turns_over_late_is_no_late_torque(tmp_path):
    """Beside friction whose travel is not known: what is wrong where a joint turns rings in the filter of the
    rows, and one row apart from it a delay was shown by 15 nats."""
    state = _by_rate_alone(opened_dry_arm(tmp_path, late(4), 500.0, 3), range(3))
    m = state.metric
    r = refine(m, state.scene, Term(effect("time_delay"), Place(side="motor"), {}))
    e = weigh(m, r.columns)
    assert e.log_e > 50 and weigh(without_turning(state, m), r.columns).log_e > TAU
    assert not shifts_all(state, m, r, e, TAU)


def test_nor_in_a_noise_that_remembers(tmp_path):
    """A hum is foretold from a second of rows: what those that turn had wrong was in all others."""
    state = _by_rate_alone(opened_dry_arm(tmp_path, late(4), 500.0, 3, hum=0.1), range(3))
    m = state.metric
    r = refine(m, state.scene, Term(effect("time_delay"), Place(side="motor"), {}))
    assert weigh(m, r.columns).log_e > 50
    assert weigh(without_turning(state, m, as_far_as_felt=True), r.columns).log_e < 1


@pytest.mark.long
def test_a_width_that_the_fitted_runs_had_is_no_law(tmp_path):
    """A clean robot of three joints, whose judged run turns more slowly than those that are fitted: friction
    under load was ahead by 23 nats, and 2 behind beside the width that this run asks for; a backlash was
    told."""
    make(254, tmp_path)
    found = ident.diagnose(ident.load(tmp_path / "study.yaml"))
    assert not found.findings and found.verdict == "none"
