"""The loop closed twice: a diagnosis that says "A or B", the motion that tells them apart, the diagnosis with
all runs.

    python benchmarks/closing_twice.py [--cases 60] [--seed 0] [--out FILE.jsonl]

Each case hides the one or the other effect of a pair of near ones in the twin of a small arm of two joints,
so small that the first diagnosis, of small and slow motions, is in doubt: its size is changed until the
diagnosis names something and cannot reject something else, the true effect among these. Then `ident excite
--from` answers, the twin moves as it says (one run to fit and one that judges, each as long as the answer
says that it takes), and the study with all runs is diagnosed again. Right: the true effect comes first and
none of its rivals is left beside it. Where `ident excite` says that no motion tells the suspects apart there
is nothing to decide: such cases are counted for themselves.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

import ident
from ident.excitation.experiment import Experiment, Request, excite
from ident.excitation.known import as_motion, term_of
from ident.excitation.motion import FourierMotion
from ident.excitation.sensitivity import FINE_HZ, projector
from ident.excitation.separate import imitation
from ident.report.files import fit_document, write_document
from ident.twin import PlannedRun, Sensors, simulate
from ident.twin.trajectories import Reach, fourier, reach
from modelgen.effects import catalogue
from modelgen.geometry.robot_file import load_robot

ARM = """\
name: small
convention: mdh
gravity: [0, -9.81, 0]
links:
  - {joint: revolute, antecedent: 0, alpha: 0, d: 0,   theta: q1, r: 0}
  - {joint: revolute, antecedent: 1, alpha: 0, d: 0.3, theta: q2, r: 0}
"""
PAIRS = (
    ("quadratic_friction", "nonlinear_viscous_friction"),
    ("stribeck_friction", "thermal_stribeck_friction"),
    ("spring", "counterbalance"),
    ("torque_ripple", "gear_ripple"),
    ("hysteresis", "maxwell_slip"),
    ("time_delay", "torque_lag"),
    ("load_dependent_friction", "load_dependent_viscous_friction"),
    ("thermal_friction", "thermal_coulomb_friction"),
    ("load_dependent_friction", "quadrant_friction"),
    ("joint_elasticity", "stiffening_gear"),
    ("offset_drift", "thermal_torque_constant"),
    ("power_law_friction", "stribeck_friction"),
    ("load_dependent_friction", "position_dependent_friction"),
)
OPEN = ("never in doubt", "no motion tells")  # cases in which there is nothing to decide
POOR, SECONDS = 0.3, 16.0  # of what the robot could do; of each of the first two runs
SENSORS = Sensors(rate_hz=125.0, noise_percent=0.0, noise_floor=3e-3)  # the same in every run
FACTORS = (1.1, 1.8)  # of the smallest size that a diagnosis of the clean arm would have seen
LONGEST = 300.0  # s of an answer


@dataclass(frozen=True)
class Case:
    """`round` makes the robot and its first motions, `number` the noise."""

    true: str
    joint: int
    round: int
    number: int
    robot: Path

    def runs(self) -> tuple[PlannedRun, ...]:
        """Small and slow motions: what a robot does that nobody asked anything."""
        whole = reach(load_robot(str(self.robot)))
        space = Reach(whole.centre, POOR * whole.half, POOR * whole.rate, POOR * whole.acceleration)
        made = [fourier(space, SECONDS, np.random.default_rng([self.round, 3, k])) for k in range(2)]
        return tuple(
            PlannedRun(f"run{k}_{self.number}", use, SECONDS, motion=motion)
            for k, (use, motion) in enumerate(zip(("identify", "validate"), made), 1)
        )

    def recordings(self, effects: tuple[str, ...], runs: tuple[PlannedRun, ...]) -> list[ident.Recording]:
        made = simulate(self.robot, effects=effects, seed=self.round, runs=runs, sensors=SENSORS)
        return [ident.Recording(pa.table(dict(r.columns)), r.use, name=r.label) for r in made.recordings]

    def told(self, recordings: list[ident.Recording]) -> ident.api.diagnosis.Diagnosis:
        return ident.diagnose(ident.Study(robot=str(self.robot), recordings=recordings))


def named(document: Mapping[str, Any]) -> list[str]:
    """The strongest finding, then what the data cannot reject beside it, each with its joints."""
    if not document["findings"]:
        return []
    first = document["findings"][0]
    return [f"{f['effect']}:{':'.join(map(str, f['joints']))}" for f in (first, *first["equivalent"])]


def request(document: Mapping[str, Any], effect: str, joint: int, factor: float = 1.0) -> str | None:
    """The smallest effect that would have been seen, times a factor, as the twin is asked for it."""
    sizes, settable = catalogue()[effect].size_names, {q.name for q in catalogue()[effect].quantities}
    for its in document["smallest_visible"]:
        if its["effect"] == effect and its["joints"] == [joint]:
            values = {n: v["value"] for n, v in its["parameters"].items() if n in settable}
            values = {n: v * factor if n in sizes else v for n, v in values.items()}
            return f"{effect}:{joint}:" + ",".join(f"{n}={v:.6g}" for n, v in values.items())
    return None


def in_doubt(case: Case, clean: Mapping[str, Any]) -> tuple[str, list[ident.Recording], Any, int] | None:
    """An effect so small that the first diagnosis cannot tell it from another: request, runs, diagnosis."""
    for tries, factor in enumerate(FACTORS, 1):
        effect = request(clean, case.true, case.joint, factor)
        if effect is None:
            return None
        runs = case.recordings((effect,), case.runs())
        d = case.told(runs)
        names = named(d.document())
        print("  ", effect, names, file=sys.stderr, flush=True)
        if len(names) > 1 and f"{case.true}:{case.joint}" in names:
            return effect, runs, d, tries
    return None


def answer(case: Case, folder: Path) -> tuple[Experiment, FourierMotion]:
    """What `ident excite --from` says, and its motion for the seconds that decide."""
    done = excite(
        Request(str(case.robot), diagnosis=folder, duration=10.0, starts=1, iterations=15, sensitivity=False)
    )
    seconds = float(np.clip(done.separated.seconds, 10.0, LONGEST))
    return done, FourierMotion(done.motion.basis, done.motion.x, seconds)


def nested(done: Experiment, true: str, other: str) -> bool:
    """Whether one of two effects contains the other: no motion rejects both ways."""
    t = np.arange(0.0, done.motion.period, 1 / FINE_HZ)
    motion = as_motion(done.motion.states(t), t)
    project = projector(done.known, motion, done.sigma)
    a, b = (term_of(done.known, text, done.bounds, motion) for text in (true, other))
    return imitation(project, a, b).same or imitation(project, b, a).same


def run(case: Case, clean: Mapping[str, Any]) -> dict[str, Any]:
    begin = time.perf_counter()
    found = in_doubt(case, clean)
    row: dict[str, Any] = {"true": f"{case.true}:{case.joint}", "round": case.round, "number": case.number}
    if found is None:
        return {**row, "outcome": "never in doubt", "took": time.perf_counter() - begin}
    effect, runs, first, tries = found
    row |= {"effect": effect, "before": named(first.document()), "tries": tries}
    with tempfile.TemporaryDirectory() as folder:
        write_document(Path(folder) / "diagnosis.json", first.document())
        write_document(Path(folder) / "fit.json", fit_document(first.result.last))
        done, motion = answer(case, Path(folder))
    offered = first.document()["findings"][0]["separate"]["seconds"]
    row |= {"asked": done.separated.labels, "offered": offered, "seconds": done.separated.seconds}
    if not np.isfinite(done.separated.seconds):
        return {**row, "outcome": "no motion tells", "took": time.perf_counter() - begin}
    moved = motion.motion
    again = case.recordings(
        (effect,),
        (
            PlannedRun("answer1", "identify", moved.duration, motion=moved),
            PlannedRun("answer2", "validate", moved.duration, motion=moved),
        ),
    )
    after = named(case.told([*runs, *again]).document())
    first = after[:1] == [row["true"]]
    outcome = "still open" if row["true"] in after else "wrong" if after else "nothing"
    if first:
        beside = all(nested(done, row["true"], other) for other in after[1:])
        outcome = "right" if len(after) == 1 else "right beside what contains it" if beside else outcome
    return {**row, "after": after, "outcome": outcome, "took": time.perf_counter() - begin}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=None)
    given = parser.parse_args()
    robot = Path(tempfile.mkdtemp()) / "small.yaml"
    robot.write_text(ARM)
    counts: dict[str, int] = defaultdict(int)
    tried: dict[str, int] = defaultdict(int)
    decided = number = 0
    effects = list(dict.fromkeys(name for pair in PAIRS for name in pair))
    while decided < given.cases:
        turn, k = divmod(number, 2 * len(effects))
        if k == 0:
            first = Case("", 1, 100 * given.seed + turn, number, robot)
            clean = first.told(first.recordings((), first.runs())).document()
        if tried[effects[k % len(effects)]] >= 3:  # what is never in doubt is left alone in the end
            number += 1
            continue
        case = Case(effects[k % len(effects)], 1 + k // len(effects), first.round, number, robot)
        row = run(case, clean)
        counts[row["outcome"]] += 1
        tried[case.true] += 1 if row["outcome"] in OPEN else -1
        decided += row["outcome"] not in OPEN
        number += 1
        print(json.dumps(row), flush=True)
        if given.out:
            with given.out.open("a") as out:
                out.write(json.dumps(row) + "\n")
    print(dict(counts))


if __name__ == "__main__":
    main()
