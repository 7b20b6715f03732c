"""Base parameter counts of random robots: exact derivation against the numeric rank of Pinocchio's regressor.

python benchmarks/base_parameter_counts.py [--robots 200] [--first-seed 0]
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

from pinocchio_robot import numeric_base_count
from random_robots import random_robot

from modelgen.regrouping import regroup_inertial


def main() -> int:
    """Compare counts with and without rotor inertias; exit status 1 if any differ."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=200)
    parser.add_argument("--first-seed", type=int, default=0)
    arguments = parser.parse_args()
    right, gaps, seconds = 0, [], []
    for seed in range(arguments.first_seed, arguments.first_seed + arguments.robots):
        robot = random_robot(seed)
        ok = True
        for rotors in (False, True):
            start = time.perf_counter()
            exact = len(regroup_inertial(robot, rotors).kept)
            seconds.append(time.perf_counter() - start)
            numeric, gap = numeric_base_count(robot, rotors)
            gaps.append(gap)
            if exact != numeric:
                ok = False
                print(
                    f"seed {seed}, rotors {rotors}: derived {exact}, numeric rank {numeric} (gap {gap:.1e})"
                )
        right += ok
    print(f"{right} of {arguments.robots} robots right; smallest singular value gap {min(gaps):.1e}")
    print(f"derivation: median {statistics.median(seconds):.3f} s, slowest {max(seconds):.3f} s")
    return 0 if right == arguments.robots else 1


if __name__ == "__main__":
    raise SystemExit(main())
