"""How often something is blamed on robots that lack nothing, of which a study's `alpha` is promised.

    python benchmarks/false_findings.py --studies 500 -o /tmp/clean          # goes on where it was stopped
    python benchmarks/false_findings.py --studies 500 -o /tmp/clean --table  # of what is there

Robots of two to four joints, simulated apart from ident (exam/): Pinocchio's torques, dry friction as Dahl's
law or a smooth sign, quantised positions, slow and ordinary motions at 50 to 1,000 Hz, one to four runs.
Their torques have noise of one of the kinds below, 0.3 to 3 times the usual size. A row a kind of noise:
studies, those in which an effect is named or a check blames the data (poor or coarse they may be), those with
something unexplained, those with no answer; and the largest share of blamed ones that so many studies are
compatible with (Clopper and Pearson, 95 %).
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.signal
import scipy.stats
import yaml

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.confusion_matrix import examine
from benchmarks.exam import motion, physics, robots

Rng = np.random.Generator
USES = (
    ["identify"],
    ["identify", "validate"],
    ["identify", "identify"],
    ["identify", "identify", "validate"],
    ["identify", "identify", "identify", "validate"],
)
QUALITY = ("poor_excitation", "coarse_signal", "spike")  # slow motion in steps, heavy tails
RATES = (50.0, 100.0, 125.0, 200.0, 250.0, 500.0, 1000.0)


def _first_order(seconds: float, shape: tuple[int, int], rate: float, rng: Rng) -> np.ndarray:
    """(N, n) of unit variance with a time constant."""
    a, begin = np.exp(-1 / (rate * seconds)), int(8 * rate * seconds) + 1
    new = rng.normal(size=(shape[0] + begin, shape[1]))
    return scipy.signal.lfilter([np.sqrt(1 - a * a)], [1, -a], new, axis=0)[begin:]


def _coloured(shape: tuple[int, int], rate: float, load: np.ndarray, rng: Rng) -> np.ndarray:
    return _first_order(1 / (2 * np.pi * rng.uniform(0.7, 6.0)), shape, rate, rng)


def _slow(shape: tuple[int, int], rate: float, load: np.ndarray, rng: Rng) -> np.ndarray:
    return 0.6 * rng.normal(size=shape) + _first_order(rng.uniform(1.0, 8.0), shape, rate, rng)


def _walk(shape: tuple[int, int], rate: float, load: np.ndarray, rng: Rng) -> np.ndarray:
    return 0.6 * rng.normal(size=shape) + np.cumsum(rng.normal(size=shape), axis=0) / np.sqrt(shape[0])


def _pink(shape: tuple[int, int], rate: float, load: np.ndarray, rng: Rng) -> np.ndarray:
    """Power falling with the frequency, over twice the run so that its ends do not meet."""
    f = np.fft.rfftfreq(2 * shape[0], 1 / rate)
    z = rng.normal(size=(len(f), shape[1])) + 1j * rng.normal(size=(len(f), shape[1]))
    z *= np.where(f > 0, 1 / np.sqrt(np.maximum(f, f[1])), 0.0)[:, None]
    x = np.fft.irfft(z, 2 * shape[0], axis=0)[: shape[0]]
    return x / x.std(axis=0)


def _loaded(shape: tuple[int, int], rate: float, load: np.ndarray, rng: Rng) -> np.ndarray:
    """Louder where the torque (N, n) is large."""
    return rng.normal(size=shape) * (0.3 + 2.0 * np.abs(load) / np.abs(load).max(axis=0))


def _hum(shape: tuple[int, int], rate: float, load: np.ndarray, rng: Rng) -> np.ndarray:
    t = np.arange(shape[0])[:, None] / rate
    hertz = float(rng.choice([50.0, 16.7, 7.3, 3.1]))
    return rng.normal(size=shape) + np.sin(2 * np.pi * hertz * t + rng.uniform(0, 6, shape[1]))


NOISES: dict[str, Callable[[tuple[int, int], float, np.ndarray, Rng], np.ndarray]] = {
    "white": lambda shape, rate, load, rng: rng.normal(size=shape),
    "first order, 0.7 to 6 Hz": _coloured,
    "white and 1 to 8 s": _slow,
    "white and a random walk": _walk,
    "1/f": _pink,
    "with the load": _loaded,
    "white and a hum": _hum,
    "heavy tails": lambda shape, rate, load, rng: 0.6 * rng.standard_t(2.5, size=shape),
}


def robot_of(seed: int) -> robots.ExamRobot:
    """Two to four revolute joints, each axis turned against the one before, moved or both."""
    rng = np.random.default_rng([88, seed])
    n, rows = int(rng.integers(2, 5)), [robots.Row(False, 0.0, 0.0, 0.0, 0.3)]
    for _ in range(1, n):
        turned = rows[-1].alpha == 0.0 or rng.random() < 0.5
        alpha = float(rng.choice([-robots.HALF, robots.HALF])) if turned else 0.0
        rows.append(robots.Row(False, alpha, round(float(rng.uniform(0.1, 0.4)), 3), 0.0, 0.0))
    return robots.ExamRobot(f"clean_{n}_{seed}", tuple(rows), 6.0 + 4 * n, False)


def _runs(model: Any, n: int, rate: float, seconds: float, count: int, rng: Rng) -> list[physics.Run]:
    pace = float(np.exp(rng.uniform(np.log(0.05), np.log(2.0))))  # rad/s at most
    shape = motion.point_to_point if pace > 0.3 and rng.random() < 0.25 else motion.fourier
    centre, out = rng.uniform(-1, 1, n), []
    for k in range(count):
        t = np.arange(round(seconds * rate) + 1) / rate
        q, dq, ddq = shape(t, pace * rng.uniform(0.7, 1.2, n), 2.0 * rng.uniform(0.6, 1.0, n), rng)
        q = q + centre
        out.append(physics.Run(t, q, dq, ddq, robots.inverse_dynamics(model, q, dq, ddq), k))
    return out


def _drives(model: Any, runs: list[physics.Run], rng: Rng) -> physics.Drives:
    """Of the sizes that torques of ordinary motions ask for, whatever these are."""
    n = model.nv
    usual = robots.inverse_dynamics(
        model, rng.uniform(-1.5, 1.5, (200, n)), rng.normal(size=(200, n)), 2 * rng.normal(size=(200, n))
    )
    S = np.sqrt(np.mean(usual**2, axis=0))
    S = np.maximum(S, 0.03 * S.max())
    rates = np.abs(np.vstack([r.dq for r in runs]))
    v = np.sqrt(np.mean(rates**2, axis=0))
    slides = rng.random() < 0.5  # presliding; else a sign smoothed over a rate
    travel = np.exp(rng.uniform(np.log(6e-6), np.log(1e-4), n)) if slides else np.zeros(n)
    smooth = (
        np.full(n, 1e-9) if slides else rates.max(axis=0) * np.exp(rng.uniform(np.log(1e-3), np.log(0.02), n))
    )
    none = np.zeros(n)
    return physics.Drives(
        Ia=S / 3.0 * rng.uniform(0.02, 0.3, n),
        Fv=S / np.maximum(v, 0.3) * rng.uniform(0.02, 0.3, n),
        Fc=S * rng.uniform(0.05, 0.3, n),
        off=S * rng.uniform(-0.05, 0.05, n),
        Fvl=none,
        Fcl=none,
        offl=none,
        presliding=travel,
        smooth=smooth,
    )


def make(seed: int, folder: Path) -> dict[str, Any]:
    """A study with its recordings in a folder; what is known of it."""
    rng = np.random.default_rng([20261126, seed])
    robot = robot_of(seed)
    model = robots.pinocchio_model(robot, links := robots.random_links(robot, rng))
    rate, uses = float(rng.choice(RATES)), USES[int(rng.integers(len(USES)))]
    seconds = float(rng.uniform(25, 60))
    runs = _runs(model, robot.n, rate, seconds, len(uses), rng)
    plant = physics.Plant(robot, model, links, _drives(model, runs, rng), False)
    torques = [physics.simulate(plant, run, [])[1] for run in runs]
    rms = np.sqrt(np.mean(np.vstack(torques) ** 2, axis=0))
    noise, times = str(rng.choice(list(NOISES))), float(np.exp(rng.uniform(np.log(0.3), np.log(3.0))))
    step = float(np.exp(rng.uniform(np.log(5e-6), np.log(4e-4))))  # rad of the positions
    robots.write_robot_file(robot, folder / "robot.yaml")
    study: dict[str, Any] = {"robot": "robot.yaml", "model": "A", "recordings": []}
    size = times * rms * rng.uniform(0.004, 0.012, robot.n)
    for k, (run, torque, use) in enumerate(zip(runs, torques, uses)):
        tau = torque + size * NOISES[noise](torque.shape, rate, torque, rng)
        q = np.round(run.q / step + rng.uniform(-0.5, 0.5, robot.n)) * step
        table = {"t": run.t} | {f"q{j + 1}": q[:, j] for j in range(robot.n)}
        table |= {f"tau_m{j + 1}": tau[:, j] for j in range(robot.n)}
        pq.write_table(pa.table(table), folder / f"run{k + 1}.parquet")
        study["recordings"].append({"file": f"run{k + 1}.parquet", "use": use})
    (folder / "study.yaml").write_text(yaml.safe_dump(study, sort_keys=False))
    return {"seed": seed, "joints": robot.n, "noise": noise, "times": times, "rate_hz": rate, "uses": uses}


def told(answer: dict[str, Any]) -> str:
    """blamed, unexplained, none or no answer."""
    document = answer.get("document")
    if document is None:
        return "no answer"
    if blamed(document):
        return "blamed"
    return "none" if document["verdict"] == "none" else "unexplained"


def blamed(document: dict[str, Any]) -> list[str]:
    """The effects that are named, and the checks that say something else than how well the data show it."""
    effects = [f"{f['effect']} {f['joints']}" for f in document["findings"]]
    return effects + [c["check"] for c in document["checks"] if c["check"] not in QUALITY]


def table(answers: list[dict[str, Any]]) -> str:
    lines = [f"{'noise':28} studies  blamed  at most  unexplained  no answer"]
    for noise in (*NOISES, "all"):
        its = [told(a) for a in answers if noise in ("all", a["truth"]["noise"])]
        wrong, known = its.count("blamed"), len(its) - its.count("no answer")
        if known:
            most = scipy.stats.beta.ppf(0.95, wrong + 1, known - wrong) if wrong < known else 1.0
            lines.append(
                f"{noise:28} {len(its):7} {wrong:7} {100 * most:6.1f} % {its.count('unexplained'):12} "
                f"{its.count('no answer'):10}"
            )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--studies", type=int, default=500)
    parser.add_argument("--first", type=int, default=0, help="seed of the first one")
    parser.add_argument("-o", "--output", type=Path, required=True, help="answers, a file a study")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds for one study")
    parser.add_argument("--table", action="store_true", help="only of the answers that are there")
    a = parser.parse_args()
    a.output.mkdir(parents=True, exist_ok=True)
    answers = []
    for seed in range(a.first, a.first + a.studies):
        stored = a.output / f"{seed}.json"
        if not stored.exists() and not a.table:
            with tempfile.TemporaryDirectory() as folder:
                truth = make(seed, Path(folder))
                answer = {"truth": truth} | examine(Path(folder) / "study.yaml", a.limit)
            stored.write_text(json.dumps(answer))
            said = told(answer)
            names = blamed(answer["document"]) if "document" in answer else [answer["error"][-150:]]
            cpu = f"{answer.get('cpu_seconds', 0):.0f} s"
            print(seed, said, *names, truth["noise"], f"x {truth['times']:.2g}", cpu, flush=True)
        if stored.exists():
            answers.append(json.loads(stored.read_text()))
    print(table(answers))


if __name__ == "__main__":
    main()
