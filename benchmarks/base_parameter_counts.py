"""Base parameters of random robots: counts against Pinocchio's numeric rank, rules at rational states.

python benchmarks/base_parameter_counts.py [--robots 200] [--first-seed 0]

A robot is right if its inertial base parameters are as many as the rank of Pinocchio's regressor at random
states, with and without rotor inertias, and if every rule of model A with a payload holds at a fresh rational
state (exactly; to 60 digits where a twist makes the geometry irrational). The last line times derivations.
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

from modelgen.base_parameters.rule_check import broken_columns
from modelgen.base_parameters.rules import derive_rules


def main() -> int:
    """Exit status 1 if any robot is wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", type=int, default=200)
    parser.add_argument("--first-seed", type=int, default=0)
    arguments = parser.parse_args()
    counted, ruled, gaps, seconds = 0, 0, [], []
    for seed in range(arguments.first_seed, arguments.first_seed + arguments.robots):
        robot, ok = random_robot(seed), True
        for model in "AB":
            start = time.process_time()
            exact = len(derive_rules(robot, model).base)
            seconds.append(time.process_time() - start)
            numeric, gap = numeric_base_count(robot, model)
            gaps.append(gap)
            if exact != numeric:
                ok = False
                print(f"seed {seed}, model {model}: derived {exact}, rank {numeric} (gap {gap:.1e})")
        counted += ok
        broken = broken_columns(derive_rules(robot, "A", "L"), seed, states=1)
        ruled += not broken
        if broken:
            print(f"seed {seed}: broken rules of {', '.join(broken)}")
    print(f"counts right on {counted} of {arguments.robots} robots, rules right on {ruled}")
    print(f"smallest gap between the singular values that decide a rank: {min(gaps):.0e}")
    times = f"median {statistics.median(seconds):.3f} s, slowest {max(seconds):.3f} s"
    print(f"derivation, processor time: {times}")
    return 0 if counted == ruled == arguments.robots else 1


if __name__ == "__main__":
    raise SystemExit(main())
