"""Fits under a feedback that carries the encoder's noise into the torque: what is biased, what says so."""

import json

import numpy as np
import pytest
import yaml
from recordings import write_parquet, write_study
from scipy.ndimage import gaussian_filter1d
from small_arm import ARM

import generated
from ident.estimation.fit import fit_study
from ident.recordings.study import load_study
from ident.twin.closed_loop import Gains, Motion, Plant, follow

pytestmark = pytest.mark.unexamined

HZ, SECONDS, RATE = 6.0, 12, 250
TRUTH = {"Fvm": (0.8, 1.2, 0.5), "Iam": (0.1, 0.2, 0.1)}  # dry friction has its own error at reversals
BODY = {"M": 4.0, "MX": 0.6, "MY": 0.05, "XX": 0.02, "YY": 0.15, "ZZ": 0.15}


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """A folder with two runs of one arm, `quiet` and `noisy` encoders, and its true base parameters."""
    folder = tmp_path_factory.mktemp("loop")
    (folder / "small.yaml").write_text(ARM)
    model = generated.load(str(folder / "small.yaml"), "A")
    standard = {f"{kind}{j}": values[j - 1] for kind, values in TRUTH.items() for j in (1, 2, 3)}
    standard |= {f"{kind}{j}": value for kind, value in BODY.items() for j in (1, 2, 3)}
    chi = model.regroup(standard)
    plant = Plant(lambda q, dq, ddq, sign: model.torque(q, dq, ddq, chi, sign=sign), np.full(3, 0.005))
    t = np.arange(SECONDS * RATE + 1) / RATE
    rng = np.random.default_rng(2)
    w = 2 * np.pi * 0.25 * np.arange(1, 6)
    a, phase = rng.normal(size=(5, 3)) * 0.4 / np.sqrt(np.arange(1, 6))[:, None], rng.uniform(0, 6, (5, 3))
    angle = t[:, None, None] * w[:, None] + phase
    q = np.sum(a * np.sin(angle), axis=1)
    wanted = [q, np.sum(a * w[:, None] * np.cos(angle), axis=1)]
    wanted.append(-np.sum(a * w[:, None] ** 2 * np.sin(angle), axis=1))
    gains = Gains.of_bandwidth(plant.inertia(q), np.full(3, HZ), 1.0)
    for name, level in (("quiet", 0.0), ("noisy", 4e-4)):
        noise = level * rng.normal(size=q.shape)
        felt = gaussian_filter1d(noise, 3.0, axis=0)
        asked = Motion(t, q - felt, wanted[1] - np.gradient(felt, 1 / RATE, axis=0), wanted[2])
        done, u = follow(plant, gains, asked, rtol=1e-4)
        u = u + 0.05 * rng.normal(size=u.shape)
        signals = {"q": done.q + noise, "q_ref": q, "tau_m": u}
        table = {"t": t} | {f"{kind}{j + 1}": x[:, j] for kind, x in signals.items() for j in range(3)}
        write_parquet(folder / f"{name}.parquet", table)
    return folder, dict(zip(model.parameters, chi))


def fitted(folder, run, estimator, **keys):
    more = {
        "robot": "small.yaml",
        "reduction": False,
        "without": ["offset", "coulomb_friction"],
        "estimator": estimator,
    }
    more |= {"filter": {"position_cutoff_hz": 50, "decimation_cutoff_hz": 20}} | keys
    path = write_study(folder, [{"file": f"{run}.parquet"}], name=f"{run}_{estimator}.yaml", **more)
    return fit_study(load_study(path)), path


def away(fit, truth):
    """(b,) errors in honest standard deviations."""
    return np.array([x - truth[name] for x, name in zip(fit.full.chi, fit.columns.parameters)]) / fit.std


LOOP = {"controller": {"bandwidth_hz": HZ, "damping": 1.0}}


def test_feedback_biases_least_squares_not_instruments_and_the_fit_says_so(arm):
    folder, truth = arm
    plain, _ = fitted(folder, "noisy", "wls", **LOOP)
    said = [check.message for check in plain.checks if check.check == "feedback"]
    assert len(said) == 1 and "compare with estimator: iv" in said[0] and plain.feedback.p_value < 1e-6
    assert np.abs(away(plain, truth)).max() > 4
    for estimator in ("iv", "didim"):
        fit, _ = fitted(folder, "noisy", estimator, **LOOP)
        assert np.abs(away(fit, truth)).max() < 4 and np.mean(np.abs(away(fit, truth)) < 1.96) > 0.75


@pytest.mark.long
def test_without_noise_of_positions_nothing_is_said_and_all_agree(arm):
    folder, _ = arm
    plain, _ = fitted(folder, "quiet", "wls", **LOOP)
    assert plain.feedback is not None and not plain.feedback.sentence()
    for estimator in ("iv", "didim"):
        fit, _ = fitted(folder, "quiet", estimator, **LOOP)
        assert np.all(np.abs(fit.full.chi - plain.full.chi) < 4 * fit.std + 1e-3)
    exact, _ = fitted(folder, "quiet", "iv", controller={"kind": "computed_torque"})
    assert np.all(np.abs(exact.full.chi - plain.full.chi) < 2 * plain.std + 2e-3)


def test_the_command_writes_the_test_and_refuses_a_loop_that_is_none(arm, tmp_path, capsys):
    from ident.command_line.cli import run

    folder, _ = arm
    _, study = fitted(folder, "noisy", "iv", **LOOP)
    assert run(["fit", str(study), "-o", str(tmp_path / "out")]) == 0
    tests = json.loads((tmp_path / "out" / "fit.json").read_text())["tests"]
    assert tests["durbin_wu_hausman"]["p_value"] < 1e-6
    capsys.readouterr()
    wild = {"controller": {"kp": [1e-3] * 3, "kd": [1e-6] * 3}}
    _, path = fitted(folder, "quiet", "wls")
    path.write_text(path.read_text().replace("estimator: wls", yaml.safe_dump({"estimator": "didim"} | wild)))
    assert run(["fit", str(path), "-o", str(tmp_path / "wild")]) == 1
    error = capsys.readouterr().err.strip()
    assert "simulated" in error and "estimator: wls" in error and len(error.splitlines()) == 1
