"""A fleet of simulated robots over months, some of them wearing: what is named, when, and how often wrongly.

    python benchmarks/fleet.py [--robots 200] [--days 120] [--wearing 10] [--seeds 3]

Summaries are simulated, not recordings: estimates of seven joints' friction with the covariance of a
shift's log, friction that follows the hall's season, each joint's own temperature and its load, robots that
differ, days that are missing, and one outlier in a hundred. A wearing joint's friction grows linearly.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from ident.fleet.trends import Point, trends

JOINTS = tuple(str(j) for j in range(1, 8))
PARAMETERS = tuple(f"{kind}{joint}" for joint in JOINTS for kind in ("Fvm", "Fcm", "Offm"))
FRICTION = np.array([[12, 9], [12, 10], [10, 7], [9, 7], [4.5, 8], [2.3, 4.7], [1.6, 6.0]])  # Fv, Fc


def fleet(
    robots: int, days: int, wearing: int, seed: int
) -> tuple[list[Point], dict[str, tuple[str, int, int]]]:
    """Points, and {robot: (joint, first day of wear, day on which the error has doubled)}."""
    rng = np.random.default_rng(seed)
    truth: dict[str, tuple[str, int, int]] = {}
    points = []
    season = 4 * np.sin(2 * np.pi * (np.arange(days) + rng.uniform(0, 365)) / 365) + rng.normal(0, 1, days)
    for r in range(robots):
        name = f"robot{r:03d}"
        own = FRICTION * rng.lognormal(0, 0.15, FRICTION.shape)
        program = rng.uniform(0.3, 1.0, 7)
        wears = r < wearing
        joint, first = int(rng.integers(7)), int(rng.integers(days // 4, days // 2))
        growth = rng.uniform(0.006, 0.015)  # of the friction, a day
        base = rng.uniform(6, 9)  # error in percent: what the model lacks
        for d in range(days):
            if rng.random() < 0.05 and not (wears and d == first):
                continue
            speed = program * rng.normal(1, 0.05, 7)
            heat = speed**2 * rng.normal(1, 0.1, 7)
            load = 10 * program * rng.normal(1, 0.1, 7)
            warm = season[d] + 12 * heat
            worn = np.zeros(7)
            if wears:
                worn[joint] = growth * max(d - first, 0)
            values, cov = np.zeros(21), np.zeros((21, 21))
            for j in range(7):
                fv = own[j, 0] * (1 - 0.012 * warm[j]) * (1 + worn[j])
                fc = own[j, 1] * (1 - 0.002 * warm[j] + 0.01 * load[j]) * (1 + worn[j])
                spread = np.diag([0.012 * own[j, 0], 0.012 * own[j, 1], 0.02])
                corr = np.array([[1, -0.8, 0], [-0.8, 1, 0], [0, 0, 1.0]])
                S = spread @ corr @ spread
                out = 5.0 if rng.random() < 0.01 else 1.0
                values[3 * j : 3 * j + 3] = np.array([fv, fc, 0.1 * r % 1]) + out * rng.multivariate_normal(
                    np.zeros(3), S
                )
                cov[3 * j : 3 * j + 3, 3 * j : 3 * j + 3] = S
            share = (
                0.25 * worn.max()
            )  # a joint's quarter of the torque that the fit of the first day explains
            error = np.hypot(base * rng.lognormal(0, 0.03), 100 * share)
            points.append(Point(name, f"{d:03d}", values, cov, heat, speed, load, float(error)))
        if wears:
            doubled = first + int(np.ceil(np.sqrt(3) * base / 25 / growth))
            truth[name] = JOINTS[joint], first, doubled
    return points, truth


def score(robots: int, days: int, wearing: int, seed: int) -> tuple[int, int, int, list[int]]:
    """Named with their joint, named before the error doubled, false alarms, delays in days."""
    points, truth = fleet(robots, days, wearing, seed)
    alarms = [c for c in trends(points, PARAMETERS, JOINTS).changes if c.level == "alarm"]
    right = {c.robot: c for c in alarms if c.robot in truth and c.joint == truth[c.robot][0]}
    delays = [int(c.day) - truth[robot][1] for robot, c in right.items()]
    early = sum(int(c.day) < truth[robot][2] for robot, c in right.items())
    false = sum(not (c.robot in truth and c.joint == truth[c.robot][0]) for c in alarms)
    return len(right), early, false, delays


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, value in (("robots", 200), ("days", 120), ("wearing", 10), ("seeds", 3)):
        parser.add_argument(f"--{name}", type=int, default=value)
    options = parser.parse_args()
    for seed in range(options.seeds):
        start = time.perf_counter()
        found, early, false, delays = score(options.robots, options.days, options.wearing, seed)
        print(
            f"seed {seed}: {found} of {options.wearing} named with their joint, {early} before the error "
            f"doubled, median delay {np.median(delays or [np.nan]):.0f} days, {false} false alarms, "
            f"{time.perf_counter() - start:.1f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
