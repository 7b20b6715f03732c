"""Estimators of the field on one robot under its controller: how far from the truth, how far from each other.

    python benchmarks/estimators.py [--runs 10] [--seconds 20] [--rate 1000] [--cutoffs 20,100] [--noises 1]

The Staubli TX40 with the parameters, the gains and the noise of BIRDy (Leboutet and others, Appl. Sci. 11,
2021: positions 1e-3 degrees, torques 0.05 N m, both white), moved along a Fourier series by a controller that
reads the noisy encoder; so the noise is in the torques as well. Each run is fitted by `ident fit` with every
estimator at a cut-off that suits the noise and at one that lets it through. The distance from the truth is
sqrt(mean(((chi - truth) / size)^2)) over the base parameters, size the larger of |truth| and the deviation
that a filtered fit has; `bias` is that of the mean over the runs, `spread` the rest, `in` how many of the
true values lie in the 95 % intervals; `norm` is the mean of |chi - truth| / |truth| in percent, the distance
that BIRDy's own postProcessing.m averages (there before it is divided). The last line ranks by each.

The published comparison (section 10.1 there, by two readers' digests of it: the tables of Appl. Sci. 11(9),
4303 and the result files, which the toolbox's repository leaves out, were not at hand): DIDIM and
instrumental variables are the most accurate; ordinary, weighted, reweighted and total least squares are
biased by the encoder's noise, and come close to them once the positions go through a zero-shift filter;
DIDIM takes about five times as long as least squares (15 to 130 times here). The rank order is checked here;
no distance is held against a printed one, nor are the estimators that are not built (maximum likelihood,
Kalman filters, neural networks, semidefinite programs).
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.ndimage import gaussian_filter1d

import generated
from ident.errors import IdentError
from ident.estimation.fit import fit_study
from ident.recordings.study import study_from
from ident.twin.closed_loop import Gains, Motion, Plant, follow
from ident.twin.trajectories import Reach, fourier

ROBOT = "staubli_tx40"
BODIES = {  # m [kg], m c [kg m], inertia at the frame's origin XX XY XZ YY YZ ZZ [kg m^2]
    1: (8.61, (0.0, 0.0, -0.4305), (0.424, 0.0, 0.0, 0.424, 0.0, 0.352)),
    2: (4.85, (0.392, -0.0072, 0.162), (0.0163, 7.85e-4, -0.0157, 0.0881, 3.24e-4, 0.0828)),
    3: (4.07, (0.0326, 0.0244, 0.265), (0.0223, -1.95e-4, -1.16e-3, 0.0224, -2.22e-3, 4.41e-3)),
    4: (3.62, (0.0145, -7.24e-3, -0.586), (0.109, 2.9e-5, 1.35e-3, 0.108, -1.17e-3, 4.07e-3)),
    5: (1.02, (0.0, -3.06e-3, -1.02e-3), (1.01e-3, 0.0, 0.0, 1.0e-3, -3.06e-6, 1.01e-3)),
    6: (0.2, (0.0, 0.0, 8.4e-3), (3.53e-3, 0.0, 0.0, 3.53e-3, 0.0, 3.53e-4)),
}
DRIVES = {
    "Iam": (0.362, 0.507, 0.0829, 0.0341, 0.0361, 0.0114),
    "Fvm": (7.9379, 5.6948, 1.9804, 1.1141, 1.60, 0.6894),
    "Fcm": (6.9822, 7.8301, 6.1939, 2.4063, 3.4092, 1.8313),
}
TORQUE_LOOP = np.array([35.24, 32.04, 23.94, 9.05, 15.5, 6.56])  # N m per unit of the controller's output
KP = TORQUE_LOOP * 0.75 * np.array([455.8254, 500.0, 253.7919, 200.2182, 244.3226, 478.4783])
KD = TORQUE_LOOP * np.array([2.5361, 4.1174, 1.1793, 0.5462, 0.5714, 0.1954])
NOISE_Q, NOISE_TAU = np.deg2rad(1e-3), 0.05
SPEED = np.deg2rad([287, 287, 430, 410, 320, 700])
ESTIMATORS = ("wls", "irls", "iv", "didim")


def tx40() -> tuple[generated.Model, np.ndarray]:
    """The compiled model A of the robot and its base parameters."""
    names = ("XX", "XY", "XZ", "YY", "YZ", "ZZ")
    standard: dict[str, float] = {}
    for j, (mass, first, inertia) in BODIES.items():
        standard |= {f"{name}{j}": value for name, value in zip(names, inertia)}
        standard |= {f"M{axis}{j}": value for axis, value in zip("XYZ", first)} | {f"M{j}": mass}
    standard |= {f"{kind}{j}": value for kind, its in DRIVES.items() for j, value in enumerate(its, 1)}
    model = generated.load(ROBOT, "A")
    return model, model.regroup(standard)


def moved(plant: Plant, gains: Gains, at, seconds: float, rate: float, noise: np.ndarray):
    """The robot under a controller that reads a noisy encoder, smoothed over 5 ms as drives do; noise (N, n).

    Such noise acts as if less had been asked for. -> t (N,), commanded, measured positions, torques (N, n).
    """
    t = np.arange(round(seconds * rate) + 1) / rate
    wanted, wanted_rate, ddq = at(t)
    felt = gaussian_filter1d(noise, 5e-3 * rate, axis=0)
    asked = Motion(t, wanted - felt, wanted_rate - np.gradient(felt, 1 / rate, axis=0), ddq)
    done, u = follow(plant, gains, asked)
    return t, wanted, done.q + noise, u


def recorded(folder: Path, seconds: float, rate: float, seed: int, scale: float = 1.0) -> np.ndarray:
    """Write one run of the TX40 with `scale` times the published position noise; -> its true chi."""
    model, chi = tx40()
    plant = Plant(lambda q, dq, ddq, sign: model.torque(q, dq, ddq, chi, sign=sign), np.full(6, 0.01))
    rng = np.random.default_rng([seed, 40])
    space = Reach(np.zeros(6), np.full(6, 1.5), 0.5 * SPEED, np.full(6, 15.0))
    motion = fourier(space, seconds, np.random.default_rng(3))  # one motion, many noises
    gains = Gains(KP, KD, np.zeros(6))
    noise = scale * NOISE_Q * rng.normal(size=(round(seconds * rate) + 1, 6))
    t, wanted, q, u = moved(plant, gains, motion.at, seconds, rate, noise)
    u = u + NOISE_TAU * rng.normal(size=u.shape)
    signals = {"q": q, "q_ref": wanted, "tau_m": u}
    table = {"t": t} | {f"{name}{j + 1}": x[:, j] for name, x in signals.items() for j in range(6)}
    pq.write_table(pa.table(table), folder / "run.parquet")
    return chi


def study(folder: Path, estimator: str, cutoff: float):
    """The same study for each estimator; the controller as it is known."""
    keys = {"robot": ROBOT, "model": "A", "recordings": [{"file": "run.parquet"}], "reduction": False}
    keys |= {"filter": {"position_cutoff_hz": cutoff, "decimation_cutoff_hz": 0.2 * cutoff}}
    keys |= {"without": ["offset"], "estimator": estimator}
    if estimator in ("iv", "didim"):
        keys["controller"] = {"kp": KP.tolist(), "kd": KD.tolist()}
    return study_from(keys, folder / "study.yaml")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--cutoffs", default="20,100")
    parser.add_argument("--noises", default="1,10", help="times the published noise of positions")
    options = parser.parse_args()
    for scale in map(float, options.noises.split(",")):
        found: dict[tuple[str, float], list] = {}
        for seed in range(options.runs):
            with tempfile.TemporaryDirectory() as folder:
                chi = recorded(Path(folder), options.seconds, options.rate, seed, scale)
                for cutoff in map(float, options.cutoffs.split(",")):
                    for name in ESTIMATORS:
                        start = time.perf_counter()
                        try:
                            fit = fit_study(study(Path(folder), name, cutoff))
                        except IdentError as error:
                            print(f"{name} at {cutoff:g} Hz: {error}")
                            continue
                        spent = time.perf_counter() - start
                        p = fit.feedback.p_value if fit.feedback else np.nan
                        truth = dict(zip(generated.load(ROBOT, "A").parameters, chi))
                        its = np.array([truth[name] for name in fit.columns.parameters])
                        found.setdefault((name, cutoff), []).append((fit.full.chi, fit.std, its, p, spent))
        report(found, scale)


def report(found: dict[tuple[str, float], list], scale: float) -> None:
    """A line for each estimator and cut-off."""
    print(f"\npositions with {scale:g} x 1e-3 degrees, torques with {NOISE_TAU:g} N m")
    heads = ("cut-off", "runs", "distance", "bias", "spread", "norm %", "in", "p < 1 %", "s")
    ranks: dict[float, list[tuple[float, float, str]]] = {}
    print(" " * 8 + "".join(f"{head:>10}" for head in heads))
    quiet = min(cutoff for _, cutoff in found)
    size = np.median([std for _, std, *_ in found["wls", quiet]], axis=0)
    for (name, cutoff), runs in sorted(found.items(), key=lambda item: item[0][1]):
        chi, std, truth = (np.array([run[k] for run in runs]) for k in range(3))
        away = (chi - truth) / np.maximum(np.abs(truth), size)
        mean = away.mean(axis=0)
        figures = [np.sqrt(np.mean(part**2)) for part in (away, mean, away - mean)]
        norm = 100 * np.mean(np.linalg.norm(chi - truth, axis=1) / np.linalg.norm(truth, axis=1))
        ranks.setdefault(cutoff, []).append((figures[0], norm, name))
        inside = np.mean(np.abs(chi - truth) < 1.96 * std)
        p = np.array([run[3] for run in runs])
        told = f"{np.mean(p < 0.01):.0%}" if np.isfinite(p).any() else ""
        words = [f"{cutoff:g} Hz", str(len(runs)), *(f"{x:.4f}" for x in (*figures, norm))]
        words += [f"{inside:.1%}", told]
        words.append(f"{np.median([run[4] for run in runs]):.1f}")
        print(f"{name:8}" + "".join(f"{word:>10}" for word in words), flush=True)
    for cutoff, its in ranks.items():
        orders = [" < ".join(row[2] for row in sorted(its, key=lambda row: row[k])) for k in (0, 1)]
        print(f"{cutoff:g} Hz, nearest first: {orders[0]} by distance, {orders[1]} by norm", flush=True)


if __name__ == "__main__":
    main()
