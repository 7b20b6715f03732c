"""Small simulated recordings of the paper's robot for tests of ident: smooth motion, true torque, noise."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

import generated

ROBOT = "kuka_lwr4p"


def motion(seconds: float, rate: float, seed: int, n: int = 7, speed: float = 1.0) -> tuple[np.ndarray, ...]:
    """t (N,), q, dq, ddq (N, n): Fourier series of five harmonics from 0.07 Hz on, exact derivatives."""
    rng = np.random.default_rng([seed, 5])
    t = np.arange(round(seconds * rate)) / rate
    q, dq, ddq = (np.zeros((len(t), n)) for _ in range(3))
    for k in range(1, 6):
        w = 2 * np.pi * 0.07 * k * speed
        for j in range(n):
            a, phase = rng.normal() * 0.7 / k, rng.uniform(0, 2 * np.pi)
            q[:, j] += a * np.sin(w * t + phase)
            dq[:, j] += a * w * np.cos(w * t + phase)
            ddq[:, j] -= a * w * w * np.sin(w * t + phase)
    return t, q, dq, ddq


def true_chi(model: Any, seed: int = 0) -> np.ndarray:
    """Plausible base parameters: friction of some N m, inertias below one."""
    rng = np.random.default_rng([seed, 6])
    chi = rng.normal(size=len(model.parameters)) * 0.4
    for k, name in enumerate(model.parameters):
        if name.startswith(("Fv", "Fc", "Iam")):
            chi[k] = rng.uniform(1, 6)
        if name == "ML":
            chi[k] = 4.6
    return chi


def recording(
    model_name: str = "A",
    payload: str | None = None,
    seconds: float = 30.0,
    rate: float = 200.0,
    seed: int = 0,
    noise: float = 0.2,
    carried: bool = True,
) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Columns t, q1.., torques of the model's channels, and the true base parameters by name."""
    model = generated.load(ROBOT, model_name, payload=payload)
    t, q, dq, ddq = motion(seconds, rate, seed)
    chi = true_chi(model)
    used = chi.copy()
    if payload and not carried:
        used[[k for k, name in enumerate(model.parameters) if name in LOAD]] = 0.0
    tau = np.asarray(model.torque(q, dq, ddq, used))
    rng = np.random.default_rng([seed, 7])
    tau = tau + noise * rng.normal(size=tau.shape)
    columns = {"t": t} | {f"q{j + 1}": q[:, j] for j in range(7)}
    return columns | {name: tau[:, k] for k, name in enumerate(model.channels)}, dict(
        zip(model.parameters, chi)
    )


LOAD = {f"{kind}L" for kind in ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")}


def write_parquet(path: Path, columns: dict[str, np.ndarray]) -> Path:
    pq.write_table(pa.table({name: pa.array(np.asarray(values)) for name, values in columns.items()}), path)
    return path


def write_study(
    folder: Path, entries: list[dict[str, Any]], model: str = "A", name: str = "study.yaml", **keys: Any
) -> Path:
    study = {
        "robot": ROBOT,
        "model": model,
        "recordings": entries,
        "filter": {"position_cutoff_hz": 10, "decimation_cutoff_hz": 2},
    } | keys
    path = folder / name
    path.write_text(yaml.safe_dump(study, sort_keys=False))
    return path
