"""The whole loop on small runs of a UR10e: what is there is named, what is not there is not."""

from types import SimpleNamespace

import numpy as np
import pytest

import generated
from ident.diagnosis.diagnosis import diagnose_recordings, diagnose_study
from ident.diagnosis.document import diagnosis_document
from ident.recordings.study import load_study
from modelgen.geometry.robot_file import load_robot

RATE, SECONDS, SMOOTH = 250.0, 30.0, 2e-3
DRIVES = {"Iam": 1.2, "Fvm": 6.0, "Fcm": 5.0, "Offm": 0.3}


@pytest.fixture(scope="module")
def arm():
    return generated.load("ur10e", "A"), load_robot("ur10e")


def motion(rng, n):
    t = np.arange(int(RATE * SECONDS)) / RATE
    q, dq, ddq = np.zeros((3, len(t), n))
    for j in range(n):
        for h in range(1, 6):
            w = 2 * np.pi * h / 10.0
            a, phase = rng.uniform(0.1, 0.5) / h, rng.uniform(0, 2 * np.pi)
            q[:, j] += a * np.sin(w * t + phase)
            dq[:, j] += a * w * np.cos(w * t + phase)
            ddq[:, j] -= a * w * w * np.sin(w * t + phase)
    return t, q, dq, ddq


def run(model, label, role, rng, extra=None):
    standard = {}
    for j in range(1, model.n + 1):
        size = 1.0 / j
        m, c = 6.0 * size, np.array([0.05, 0.02, 0.1]) * size
        standard |= {f"M{j}": m} | {f"M{x}{j}": m * v for x, v in zip("XYZ", c)}
        standard |= {f"XX{j}": 0.1 * size, f"YY{j}": 0.12 * size, f"ZZ{j}": 0.08 * size}
        standard |= {f"{k}{j}": v * size for k, v in DRIVES.items()}
    t, q, dq, ddq = motion(rng, model.n)
    tau = model.torque(q, dq, ddq, model.regroup(standard), sign=np.tanh(dq / SMOOTH))
    size = np.sqrt(np.mean(tau**2, axis=0))
    if extra is not None:
        tau = tau + extra(t, q, dq, model, ddq)
    tau = tau + rng.normal(size=tau.shape) * 0.03 * size
    q = q + rng.normal(size=q.shape) * 1e-5
    return SimpleNamespace(label=label, role=role, payload=None, t=t, q=q, tau_m=tau, tau_l=None)


def diagnosed(arm, extra=None, on=("a", "b"), seed=3):
    model, robot = arm
    rng = np.random.default_rng(seed)
    runs = [
        run(model, label, role, rng, extra if label in on else None)
        for label, role in (("a", "identify"), ("b", "validate"))
    ]
    return diagnose_recordings(runs, model, robot, {}, position_cutoff_hz=10.0)


def test_nothing_is_named_when_nothing_is_there(arm):
    diagnosis = diagnosed(arm)
    assert diagnosis.verdict == "none" and not diagnosis.findings
    assert diagnosis.before == diagnosis.after


def test_stribeck_friction_is_named_with_its_size(arm):
    def stribeck(t, q, dq, model, ddq):
        out = np.zeros_like(q)
        out[:, 2] = 2.0 * np.exp(-((dq[:, 2] / 0.1) ** 2)) * np.tanh(dq[:, 2] / SMOOTH)
        return out

    diagnosis = diagnosed(arm, stribeck)
    assert [(f.effect, f.joints) for f in diagnosis.findings] == [("stribeck_friction", (3,))]
    for name, true in (("Fs", 2.0), ("vs", 0.1)):
        told = diagnosis.findings[0].parameters[name]
        assert abs(told["value"] - true) < 4 * told["std"] + 1e-9
    assert diagnosis.after["validate"]["tau_m3"] < 0.7 * diagnosis.before["validate"]["tau_m3"]
    document = diagnosis_document(diagnosis)
    assert document["verdict"] == "effect" and set(document["error_percent"]["after"]) == {
        "identify",
        "validate",
    }


def test_payload_of_one_run_only(arm):
    def carried(t, q, dq, model, ddq):
        body = {"M6": 0.8, "MX6": 0.01, "MY6": -0.02, "MZ6": 0.06}
        return model.torque(q, dq, ddq, model.regroup(body), sign=np.zeros_like(q))

    diagnosis = diagnosed(arm, carried, on=("b",))
    first = diagnosis.findings[0]
    assert (first.effect, first.parameters["recording"]["value"]) == ("payload_change", "b")
    assert first.parameters["m"]["value"] == pytest.approx(0.8, rel=0.04)


def test_a_torque_of_no_catalogue_is_unexplained_and_nobody_is_blamed(arm):
    def strange(t, q, dq, model, ddq):
        out = np.zeros_like(q)
        out[:, 3] = 3.0 * q[:, 3] * np.abs(dq[:, 1])
        return out

    diagnosis = diagnosed(arm, strange)
    assert diagnosis.verdict == "unexplained"
    assert [u.joints for u in diagnosis.unexplained] == [(4,)]


def test_degrees_are_suspected_by_the_diagnosis_too(tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    t = np.arange(0, 12, 0.005)
    table = {"t": t}
    for j in range(1, 7):
        table |= {f"q{j}": np.degrees(np.sin((0.3 + 0.1 * j) * t)), f"tau_m{j}": np.cos(j * t)}
    pq.write_table(pa.table(table), tmp_path / "run.parquet")
    (tmp_path / "study.yaml").write_text(
        "robot: ur10e\nmodel: A\nrecordings:\n  - {file: run.parquet, use: identify}\n"
    )
    diagnosis = diagnose_study(load_study(tmp_path / "study.yaml"), max_terms=0)
    assert any("looks like degrees" in note for note in diagnosis_document(diagnosis)["notes"])
