"""Recordings of a small arm whose dry friction changes its sign as it is told."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from recordings import motion, write_parquet, write_study
from small_arm import ARM

import generated
from ident.diagnosis.evidence.state import State
from ident.diagnosis.opening import opened
from ident.equations.prepared import prepare_study
from ident.recordings.study import load_study

Sign = Callable[[np.ndarray, np.ndarray], np.ndarray]  # of q, dq (N, 3) -> (N, 3)
Moves = Callable[..., tuple[np.ndarray, ...]]  # as recordings.motion


def one_way(*asked: float) -> tuple[np.ndarray, ...]:
    """As recordings.motion, but the second joint goes on and on, and stops every two seconds."""
    t, q, dq, ddq = motion(*asked)
    w = 0.5 * np.pi
    q[:, 1], dq[:, 1] = 0.15 * (t - np.sin(2 * w * t) / (2 * w)), 0.3 * np.sin(w * t) ** 2
    ddq[:, 1] = 0.3 * w * np.sin(2 * w * t)
    return t, q, dq, ddq


def back_again(seconds: float, rate: float, k: int, *rest: float) -> tuple[np.ndarray, ...]:
    """The same, and in the second run back."""
    t, *signals = one_way(seconds, rate, k, *rest)
    for x in signals:
        x[:, 1] *= 1 - 2 * k
    return t, *signals


def opened_dry_arm(
    folder: Path,
    sign: Sign,
    rate_hz: float,
    seed: int,
    top: float | None = None,
    step: float = 0.0,
    moves: Moves = motion,
    hum: float = 0.0,
    late: float = 0.0,
) -> State:
    """The first state of a diagnosis of two runs, 20 s and 12 s, with 0.02 N m of white noise; top: rate of
    every joint [rad/s], where the motion is not to be as fast as it comes; step: of the encoders [rad]; hum:
    of the torques at 7.3 Hz [N m]; late: by what all torques are [s]."""
    (folder / "robot.yaml").write_text(ARM)
    model = generated.load(str(folder / "robot.yaml"), "A")
    rng = np.random.default_rng(seed)
    chi = 0.3 * rng.normal(size=len(model.parameters))
    for k, name in enumerate(model.parameters):
        if name.startswith(("Fv", "Fc", "Iam")):
            chi[k] = 1.0
    for k, seconds in enumerate((20, 12)):
        t, q, dq, ddq = moves(seconds, rate_hz, k, 3, 2.0)
        share = 1.0 if top is None else top / np.abs(dq).max(axis=0)
        q, dq, ddq = share * q, share * dq, share * ddq
        tau = np.asarray(model.torque(q, dq, ddq, chi, sign=sign(q, dq)))
        tau = np.stack([np.interp(t - late, t, its) for its in tau.T], axis=1)
        tau += 0.02 * rng.normal(size=(len(t), 3))
        tau += hum * np.sin(2 * np.pi * 7.3 * t)[:, None]
        q = np.round(q / step) * step if step > 0 else q
        columns = {"t": t} | {f"q{j + 1}": q[:, j] for j in range(3)}
        write_parquet(
            folder / f"run{k + 1}.parquet", columns | {f"tau_m{j + 1}": tau[:, j] for j in range(3)}
        )
    entries = [{"file": "run1.parquet"}, {"file": "run2.parquet", "use": "validate"}]
    return opened(prepare_study(load_study(write_study(folder, entries, robot="robot.yaml")))).state
