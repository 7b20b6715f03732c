"""The turn-over of friction, the noise floor and what a candidate is not credited with, on known truths."""

from types import SimpleNamespace

import numpy as np
import pytest

import generated
from ident.diagnosis.diagnosis import diagnose_recordings
from ident.diagnosis.friction_sign import replacing
from ident.diagnosis.model_view import build_view
from ident.diagnosis.noise_floor import noise_floor, white_floor
from ident.diagnosis.rows import build_rows
from ident.diagnosis.scoring import make_folds
from ident.diagnosis.state import first_state
from modelgen.effects import catalogue
from modelgen.effects.loads import force_columns
from modelgen.geometry.robot_file import load_robot

RATE, SECONDS = 250.0, 30.0
DRIVES = {"Iam": 1.2, "Fvm": 6.0, "Offm": 0.3}


@pytest.fixture(scope="module")
def arm():
    return generated.load("ur10e", "A"), load_robot("ur10e")


def motion(seed, n, f0=0.1):
    rng = np.random.default_rng(seed)
    t = np.arange(int(RATE * SECONDS)) / RATE
    q, dq, ddq = np.zeros((3, len(t), n))
    for j in range(n):
        for h in range(1, 6):
            w = 2 * np.pi * h * f0
            a, phase = rng.uniform(0.1, 0.5) / h, rng.uniform(0, 2 * np.pi)
            q[:, j] += a * np.sin(w * t + phase)
            dq[:, j] += a * w * np.cos(w * t + phase)
            ddq[:, j] -= a * w * w * np.sin(w * t + phase)
    return t, q, dq, ddq


def recorded(model, sign, extra, label="a", role="identify", seed=0, noise=0.01):
    """Torque of an arm with friction `sign(q, dq)`, plus `extra(t, q, dq, ddq)`, as a recording."""
    t, q, dq, ddq = motion(seed, model.n)
    standard = {}
    for j in range(1, model.n + 1):
        m, c = 6.0 / j, np.array([0.05, 0.02, 0.1]) / j
        standard |= {f"M{j}": m} | {f"M{x}{j}": m * v for x, v in zip("XYZ", c)}
        standard |= {f"XX{j}": 0.1 / j, f"YY{j}": 0.12 / j, f"ZZ{j}": 0.08 / j}
        standard |= {f"{k}{j}": v / j for k, v in DRIVES.items()}
    tau = model.torque(q, dq, ddq, model.regroup(standard)) + 5.0 / np.arange(1, model.n + 1) * sign(q, dq)
    size = np.sqrt(np.mean(tau**2, axis=0))
    rng = np.random.default_rng([seed, 7])
    tau = tau + extra(t, q, dq, ddq) + noise * size * rng.normal(size=tau.shape)
    q = q + 1e-6 * rng.normal(size=q.shape)
    return SimpleNamespace(label=label, role=role, payload=None, t=t, q=q, tau_m=tau, tau_l=None), size


def dahl(travel):
    state = catalogue()["hysteresis"].state

    def sign(q, dq):
        return np.stack([state.integrate(x, {"width": travel}, 0.0) for x in q.T], axis=1)

    return sign


def sharp(q, dq):
    return np.tanh(dq / 2e-3)


def nothing(t, q, dq, ddq):
    return np.zeros_like(q)


@pytest.mark.parametrize("travel", [8e-6, 4e-5, 2e-4])
def test_the_turn_over_of_friction_is_that_of_the_robot(arm, travel):
    """Dahl friction of a known travel: within a factor of two of the chosen one, on every joint."""
    model, robot = arm
    run, _ = recorded(model, dahl(travel), nothing, noise=0.002)
    rows = build_rows([run], tuple(model.channels), None)
    view = build_view(model, rows.fine, robot, rows.runs, {})
    state = first_state(rows, view, make_folds(rows.run, rows.t, ["identify"]))
    for turn_over in state.context.rows.fine.turn_over:
        assert turn_over.law == "travel" and travel / 2 < turn_over.value < travel * 2


def test_a_step_is_worth_what_taking_it_once_gains():
    """The likelihood is a parabola in the multiple of the step: a top at 2 leaves 3/4 for the step."""
    assert replacing(100.0, 1.0) == 100.0
    assert replacing(100.0, 2.0) == pytest.approx(75.0)
    assert replacing(100.0, 0.4) == 0.0  # beyond twice the top a step loses


def test_white_noise_is_its_own_floor(arm):
    model, robot = arm
    noise = 0.02
    run, size = recorded(model, sharp, nothing, noise=noise)
    rows = build_rows([run], tuple(model.channels), None)
    view = build_view(model, rows.fine, robot, rows.runs, {})
    state = first_state(rows, view, make_folds(rows.run, rows.t, ["identify"]))
    expected = noise * size * np.sqrt(rows.filter.cutoff_hz / (RATE / 2))
    white = white_floor(rows, state.context.torque)
    assert white == pytest.approx(expected, rel=0.25)
    whole = noise_floor(rows, state.context.torque, state.system.residual)
    rms = np.sqrt(np.mean((state.system.residual * rows.keep) ** 2, axis=1) / rows.keep.mean(axis=1))
    assert np.all(whole <= rms * (1 + 1e-9)) and np.all(whole > 0.7 * rms)


def test_a_wave_in_the_residual_is_no_noise(arm):
    """A sine of the period of nothing else stands in one line of the spectrum: the floor stays below half."""
    model, robot = arm
    run, size = recorded(model, sharp, nothing, noise=0.01)
    rows = build_rows([run], tuple(model.channels), None)
    view = build_view(model, rows.fine, robot, rows.runs, {})
    state = first_state(rows, view, make_folds(rows.run, rows.t, ["identify"]))
    wave = state.system.residual + 0.05 * size[:, None] * np.sin(2 * np.pi * 1.3 * rows.t)
    floor = noise_floor(rows, state.context.torque, wave)
    assert np.all(floor < 0.5 * np.sqrt(np.mean(wave**2, axis=1)))


def test_a_delay_hidden_behind_presliding_is_found(arm):
    """Friction that turns over within a travel lags like a delay does; told apart to 5 %."""
    model, robot = arm
    delay = 0.015
    runs = []
    for seed, (label, role) in enumerate((("a", "identify"), ("b", "validate"))):
        run, _ = recorded(model, dahl(2e-5), nothing, label, role, seed)
        late = np.interp(run.t - delay, run.t, run.tau_m[:, 3])
        run.tau_m[:, 3] = late
        runs.append(run)
    diagnosis = diagnose_recordings(runs, model, robot, {})
    assert [(f.effect, f.joints) for f in diagnosis.findings] == [("time_delay", (4,))]
    assert diagnosis.findings[0].parameters["delay"]["value"] == pytest.approx(delay, rel=0.05)


def test_a_contact_beside_the_origin_is_placed(arm):
    """A push 8 cm beyond the last frame, for 7 s of one run: its force within 3 %, its place within 1 cm."""
    model, robot = arm
    force, point = np.array([6.0, -9.0, 5.0]), (0.0, 0.0, 0.08)

    def push(t, q, dq, ddq):
        inside = 1.0 * ((t > 12.0) & (t < 19.0))[:, None]
        return -inside * (force_columns(robot, q, point=point)[:, :, :3] @ force)

    runs = [
        recorded(model, sharp, push if role == "identify" else nothing, label, role, seed)[0]
        for seed, (label, role) in enumerate((("a", "identify"), ("b", "validate")))
    ]
    (finding,) = diagnose_recordings(runs, model, robot, {}).findings
    assert finding.effect == "external_force"
    told = finding.parameters
    assert told["force"]["value"] == pytest.approx(float(np.linalg.norm(force)), rel=0.03)
    assert [told[k]["value"] for k in ("px", "py", "pz")] == pytest.approx(point, abs=0.01)


def test_a_gear_that_lets_go_in_its_gap_is_a_backlash(arm):
    """Joint 1 has no gravity: only the torque that is not passed on shows the gap."""
    model, robot = arm
    gap = 4e-3
    play = catalogue()["backlash"].state

    def lost(t, q, dq, ddq):
        z = play.integrate(q[:, 0], {"travel": gap}, 0.0)
        crossing = 1 - np.clip(5 * np.abs(z) - 4, 0, 1)
        out = np.zeros_like(q)
        standard = {"ZZ1": 9.0}
        out[:, 0] = -crossing * model.torque(q, dq, ddq, model.regroup(standard))[:, 0]
        return out

    def heavier(t, q, dq, ddq):
        more = model.torque(q, dq, ddq, model.regroup({"ZZ1": 9.0}))
        return more + lost(t, q, dq, ddq)

    runs = [
        recorded(model, sharp, heavier, label, role, seed)[0]
        for seed, (label, role) in enumerate((("a", "identify"), ("b", "validate")))
    ]
    findings = diagnose_recordings(runs, model, robot, {}).findings
    assert [(f.effect, f.joints) for f in findings] == [("backlash", (1,))]
    assert findings[0].parameters["gap"]["value"] == pytest.approx(gap, rel=0.1)
