"""Penalised functions find structure, its signals, and nothing in noise."""

import numpy as np
import pytest

from ident.diagnosis.nameless import _ridge, flexible, wave_peaks
from ident.diagnosis.opening import opened
from ident.diagnosis.sufficiency import heard
from ident.equations.prepared import prepare_study


def asked(state, c, wanted=5.0, only=None):
    load = [state.model.total(motion)[:, c] for motion in state.motions]
    return flexible(state.metric, c, c, state.segments, load, 400.0, wanted, only)


@pytest.fixture(scope="module")
def odd(arm):
    """Joint 2 with friction that depends on the position of joint 1, as no effect of the catalogue does."""

    def strange(columns):
        q1, dq = columns["q1"], np.gradient(columns["q2"], columns["t"])
        columns["tau_m2"] = columns["tau_m2"] + 0.3 * np.cos(1.5 * q1) * dq

    return opened(prepare_study(arm(change=strange))).state


def test_nothing_in_noise(clean_arm):
    for c in range(3):
        found = asked(clean_arm.state, c, wanted=-1.0)
        assert found is None or found.evidence.log_e < np.log(4000)


def test_the_signals_of_a_strange_shape(odd):
    """Heard in the noise that it leaves: in that of the model without it, it is foretold by its own past."""
    found, _ = heard(odd, 1, 5.0)
    assert found is not None and found.evidence.log_e > np.log(4000)
    assert set(found.variables) <= {"q1", "dq2", "dq1"} and "q1" in found.variables
    plain = asked(odd, 1)
    assert plain is not None and plain.prior_evidence <= plain.evidence.gain + 1.0


def test_only_the_signals_asked_for(odd):
    found = asked(odd, 1, wanted=-1.0, only=frozenset({"q2", "dq2"}))
    assert found is None or set(found.variables) <= {"q2", "dq2"}


def test_the_evidence_pays_for_its_columns(tiny):
    """Forty columns of noise explain noise, but no nats are left when their prior is paid for."""
    rng = np.random.default_rng(0)
    M = 1200
    rows = tiny["rows"](rng.normal(size=(M, 3)), rng.normal(size=M))
    m = tiny["metric"](rows)
    Z = rng.normal(size=(M, 40))
    value, _ = _ridge(m, 0, Z)
    assert value < 3.0
    strong = tiny["rows"](rows.base[0][1], rows.Y[0] + 0.5 * Z[:, 0])
    value, column = _ridge(tiny["metric"](strong), 0, Z)
    assert value > 10.0
    assert np.corrcoef(column, Z[:, 0])[0, 1] > 0.8


def test_a_wave_over_the_position_has_its_line(clean_arm):
    segments = clean_arm.state.segments
    back = [np.sin(31.0 * s.q[:, 1]) for s in segments]
    assert min(abs(k - 31.0) for k in wave_peaks(segments, 1, back, 400.0)) < 0.7
