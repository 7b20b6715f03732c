"""Whether a diagnosis sees what it says that it would have seen: 95 of 100 effects of the size it states.

    python benchmarks/smallest_visible.py [--cases 100] [--effects stribeck_friction:2 ...] [--out FILE.jsonl]

A small arm's twin moves without any effect; its diagnosis states the smallest size of each effect that it
would have seen, in every round of effects that of another noise. Then the twin hides an effect of that very
size in the same motion, with other noise in every case, and is diagnosed again. Seen: anything is told on
that joint; named: the effect or what it is equivalent to.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from closing_twice import ARM, named, request

import ident
from ident.twin import PlannedRun, Sensors, simulate
from ident.twin.trajectories import fourier, reach
from modelgen.geometry.robot_file import load_robot

SENSORS = Sensors(rate_hz=125.0)
EFFECTS = (
    "stribeck_friction:2",
    "asymmetric_friction:1",
    "offset_drift:1",
    "load_dependent_friction:2",
    "torque_ripple:1",
    "spring:1",
    "power_law_friction:2",
    "nonlinear_viscous_friction:2",
    "position_dependent_friction:1",
    "thermal_coulomb_friction:2",
)


def diagnosed(robot: Path, effect: tuple[str, ...], number: int, seconds: float) -> Any:
    """The document of one case; the number of it makes its noise."""
    space = reach(load_robot(str(robot)))
    runs = tuple(
        PlannedRun(f"{use}{number}", use, s, motion=fourier(space, s, np.random.default_rng([5, k])))
        for k, (use, s) in enumerate((("identify", seconds), ("validate", seconds)))
    )
    made = simulate(robot, effects=effect, seed=3, runs=runs, sensors=SENSORS)
    tables = [ident.Recording(pa.table(dict(r.columns)), r.use, name=r.label) for r in made.recordings]
    return ident.diagnose(ident.Study(robot=str(robot), recordings=tables)).document()


def place(name: str) -> tuple[str, int]:
    effect, joint = name.split(":")
    return effect, int(joint)


def told(robot: Path, effects: list[str], number: int, seconds: float) -> dict[str, str]:
    """{place: request of the size that the diagnosis of the clean arm would have seen}."""
    clean = diagnosed(robot, (), number, seconds)
    asked = {name: text for name in effects if (text := request(clean, *place(name)))}
    print(f"clean: {clean['verdict']}; not told of: {sorted(set(effects) - set(asked))}", flush=True)
    return asked


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--effects", nargs="*", default=EFFECTS)
    parser.add_argument("--out", type=Path, default=None)
    given = parser.parse_args()
    robot = Path(tempfile.mkdtemp()) / "small.yaml"
    robot.write_text(ARM)
    tried, seen, known = Counter[str](), Counter[str](), Counter[str]()
    asked: list[tuple[str, str]] = []
    for case in range(1, given.cases + 1):
        if not asked:
            asked = list(told(robot, list(given.effects), 10_000 + case, given.seconds).items())
        name, text = asked.pop(0)
        document = diagnosed(robot, (text,), case, given.seconds)
        joint = place(name)[1]
        places = [*document["findings"], *document["unexplained"]]
        shown = any(joint in its["joints"] for its in places)
        tried[name] += 1
        seen[name] += shown
        known[name] += name in named(document)
        row = {"case": case, "asked": text, "verdict": document["verdict"], "seen": shown}
        print(json.dumps(row | {"named": named(document)}), flush=True)
        if given.out:
            with given.out.open("a") as out:
                out.write(json.dumps(row | {"named": named(document)}) + "\n")
    print(f"seen {sum(seen.values())} of {given.cases}, named {sum(known.values())}")
    for name, count in tried.items():
        print(f"  {name}: seen {seen[name]}, named {known[name]} of {count}")


if __name__ == "__main__":
    main()
