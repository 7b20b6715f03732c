"""Designed motions against random ones: condition, information, time, and violations of limits.

    python benchmarks/excitation.py [--robots kuka_lwr4p ur10e staubli_tx40] [--random 2000] [--designs 0]

Every random motion is feasible and as large as its limits allow; ten seconds each. `--designs N` counts
violations of limits at 1 kHz in N designs of one robot with few iterations, limits and boxes drawn at random.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from ident.excitation.experiment import Request, excite
from ident.excitation.information import scaled_condition
from ident.excitation.known import known_robot
from ident.excitation.limits import ExcitationError, bounds_of
from ident.excitation.motion import basis_for
from ident.excitation.optimal import random_motion
from modelgen.effects.frames import frames
from modelgen.geometry.robot_file import load_robot

TOP = {"dq": 2.0, "ddq": 8.0}


def rows(known, motion, sigma):  # type: ignore[no-untyped-def]
    """(rows, b) of one period at 20 Hz, weighted."""
    states = motion.states(np.arange(0.0, motion.period, 0.05))[:3]
    A = known.model.regressor(*states) / sigma[:, None]
    return A.reshape(-1, A.shape[2])


def information(A: np.ndarray) -> float:
    """log det of A'A, per parameter."""
    return float(np.linalg.slogdet(A.T @ A)[1] / A.shape[1])


def compare(name: str, count: int) -> None:
    """One robot: designed by either criterion, and the best of `count` random motions."""
    robot = load_robot(name)
    known, bounds = known_robot(robot, name), bounds_of(robot)
    holding, basis = known.holding(bounds), basis_for(10.0)
    sigma = None
    for criterion in ("balanced", "d", "condition"):
        begin, cpu = time.perf_counter(), time.process_time()
        done = excite(Request(name, criterion=criterion, sensitivity=False))
        took = f"{time.perf_counter() - begin:.1f} s ({time.process_time() - cpu:.1f} s of processor)"
        sigma = done.sigma
        A = rows(known, done.motion, sigma)
        print(
            f"{name} {criterion}: condition {scaled_condition(A):.2f}, log det {information(A):.3f}, "
            f"{took}, largest use of a limit {100 * done.largest_use[0]:.1f} %",
            flush=True,
        )
    assert sigma is not None
    rng = np.random.default_rng(1)
    rest = holding.rest(None, rng)
    best = (np.inf, -np.inf)
    for _ in range(count):
        A = rows(known, random_motion(holding, basis, rest, 10.0, rng, False), sigma)
        best = min(best[0], scaled_condition(A)), max(best[1], information(A))
    print(f"{name} best of {count} random: condition {best[0]:.2f}, log det {best[1]:.3f}", flush=True)


def violations(count: int, name: str) -> None:
    """Designs with limits, starts and boxes drawn at random that are violated somewhere at 1 kHz."""
    robot = load_robot(name)
    rng, found, refused, largest = np.random.default_rng(2), 0, 0, 0.0
    usual = {"dq": 2.0, "ddq": 8.0, "jerk": 80.0, "tau": 500.0}
    for seed in range(count):
        limits = [f"{key}={value * rng.uniform(0.2, 1):.3g}" for key, value in usual.items()]
        low = rng.uniform(-3, 0, robot.n)
        limits += [f"q:{k}={a:.3g}..{a + rng.uniform(1, 3):.3g}" for k, a in zip(robot.joint_labels, low)]
        corner = rng.uniform(-0.6, 0.4, 3)
        box = ",".join(f"{a:.3g}..{a + 0.3:.3g}" for a in corner)
        request = Request(
            name, duration=6.0, limits=tuple(limits), seed=seed, starts=1, iterations=8, sensitivity=False,
            keep_out=(f"box={box}",) if seed % 2 else (),
        )  # fmt: skip
        try:
            done = excite(request)
        except ExcitationError:
            refused += 1
            continue
        q, dq, ddq, jerk = done.motion.states(np.arange(0.0, 6.0, 1e-3))
        b = done.bounds
        tau = done.known.holding(b).torque((q, dq, ddq, jerk))
        share = [np.abs(dq) / b.dq, np.abs(ddq) / b.ddq, np.abs(jerk) / b.jerk, np.abs(tau) / b.tau]
        share.append(np.abs(q - (b.low + b.high) / 2) / ((b.high - b.low) / 2))
        worst = max(float(part.max()) for part in share)
        end = frames(robot, q).p[:, -1]
        inside = seed % 2 and np.any(np.all((corner < end) & (end < corner + 0.3), axis=1))
        found += worst > 1 + 1e-9 or bool(inside)
        largest = max(largest, worst)
    print(f"{found} of {count - refused} designs violate a limit at 1 kHz, largest use {largest:.6f}; "
          f"{refused} requests that no motion holds were refused")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", nargs="*", default=["kuka_lwr4p", "ur10e", "staubli_tx40"])
    parser.add_argument("--random", type=int, default=2000)
    parser.add_argument("--designs", type=int, default=0)
    parser.add_argument("--design-robot", default="scara")
    given = parser.parse_args()
    for name in given.robots:
        compare(name, given.random)
    if given.designs:
        violations(given.designs, given.design_robot)


if __name__ == "__main__":
    main()
