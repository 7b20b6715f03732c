"""Designed motions against random ones: condition, information, time, and violations of limits.

    python benchmarks/excitation.py [--robots kuka_lwr4p ur10e staubli_tx40] [--random 2000] [--designs 0]
    python benchmarks/excitation.py --robots --separate

Every random motion is feasible and as large as its limits allow; ten seconds each. `--designs N` counts
violations of limits at 1 kHz in N designs of one robot with few iterations: limits, lengths, criteria,
starts, kinds of motion and boxes are drawn at random. `--separate`: what the motion that separates tells of
two suspects over what the D-optimal one does, the smaller of the two ways round.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from ident.excitation.experiment import Experiment, Request, excite
from ident.excitation.information import CRITERIA, scaled_condition
from ident.excitation.known import as_motion, known_robot
from ident.excitation.limits import ExcitationError, bounds_of
from ident.excitation.motion import basis_for
from ident.excitation.optimal import random_motion
from ident.excitation.sensitivity import FINE_HZ, projector
from ident.excitation.separate import imitation
from ident.excitation.suspects import suspects
from modelgen.effects.frames import frames
from modelgen.geometry.robot_file import load_robot

PAIRS = (
    "stribeck_friction:2,power_law_friction:2",
    "asymmetric_friction:3,quadratic_friction:3",
    "torque_ripple:4,position_dependent_friction:4",
)
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


def drawn_request(name: str, seed: int) -> tuple[Request, np.ndarray | None]:
    """Limits, length, kind, start and a box (its lower corner) at random."""
    robot, rng = load_robot(name), np.random.default_rng([2, seed])
    usual = {"dq": 2.0, "ddq": 8.0, "jerk": 80.0, "tau": 150.0}
    limits = [f"{key}={value * rng.uniform(0.1, 1):.3g}" for key, value in usual.items()]
    low = rng.uniform(-3, 0, robot.n)
    high = low + rng.uniform(1, 3, robot.n)
    limits += [f"q:{k}={a:.3g}..{b:.3g}" for k, a, b in zip(robot.joint_labels, low, high)]
    corner = rng.uniform(-0.6, 0.4, 3) if seed % 2 else None
    box = () if corner is None else ("box=" + ",".join(f"{a:.6g}..{a + 0.3:.6g}" for a in corner),)
    share = rng.uniform(0.005, 0.995, robot.n) if seed % 3 == 0 else None
    start = None if share is None else tuple((low + share * (high - low)).tolist())
    long = 27.0 if seed % 10 == 4 else 6.0
    return Request(
        name, duration=round(long * rng.uniform(0.7, 1), 2), limits=tuple(limits),
        kind="point_to_point" if seed % 20 == 9 else "fourier", seed=seed, starts=1, iterations=6,
        criterion=CRITERIA[seed % 5], start=start, keep_out=box,
        sensitivity=False,
    ), corner  # fmt: skip


def largest_use(done: Experiment, corner: np.ndarray | None) -> tuple[float, str]:
    """(share of a limit that is used at 1 kHz over the whole motion, which one); 2 inside the box."""
    t = np.arange(0.0, done.motion.duration, 1e-3)
    q, dq, ddq, jerk = done.motion.states(t)
    b = done.bounds
    tau = done.known.holding(b).torque((q, dq, ddq, jerk))
    share = {"dq": np.abs(dq) / b.dq, "ddq": np.abs(ddq) / b.ddq, "jerk": np.abs(jerk) / b.jerk}
    share |= {"tau": np.abs(tau) / b.tau, "q": np.abs(q - b.middle) / b.half}
    if corner is not None:
        end = frames(done.robot, q).p[:, -1]
        share["box"] = 2.0 * np.all((corner < end) & (end < corner + 0.3), axis=1)
    return max((float(part.max()), key) for key, part in share.items())


def violations(count: int, name: str, first: int = 0) -> None:
    """Designs under random limits that are violated somewhere at 1 kHz."""
    found, refused, worst = [], 0, (0.0, "")
    for seed in range(first, first + count):
        request, corner = drawn_request(name, seed)
        try:
            used = largest_use(excite(request), corner)
        except ExcitationError:
            refused += 1
            continue
        worst = max(worst, used)
        if used[0] > 1 + 1e-9:
            found.append(seed)
            print(f"seed {seed}: {100 * used[0]:.4f} % of {used[1]}", flush=True)
    print(
        f"{name}: {len(found)} of {count - refused} designs violate a limit at 1 kHz, largest use "
        f"{worst[0]:.6f} of {worst[1]}; {refused} requests that no motion holds were refused",
        flush=True,
    )


def separations(name: str) -> None:
    """T of the designed motion over that of the D-optimal one, for pairs of near effects."""
    plain = excite(Request(name, criterion="d", sensitivity=False))
    for pair in PAIRS:
        cpu = time.process_time()
        done = excite(Request(name, separate=pair, sensitivity=False))
        cpu = time.process_time() - cpu
        trial = as_motion(done.motion.states(t := np.arange(0.0, done.motion.period, 1 / FINE_HZ)), t)
        terms = suspects(done.known, pair.split(","), done.bounds, projector(done.known, trial, done.sigma))
        rates = []
        for motion in (done.motion, plain.motion):
            project = projector(done.known, as_motion(motion.states(t), t), done.sigma)
            rates.append(min(imitation(project, *way).rate for way in (terms, terms[::-1])))
        print(f"{name} {pair}: {rates[0] / rates[1]:.2f} times as much a second, {cpu:.1f} s of processor")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", nargs="*", default=["kuka_lwr4p", "ur10e", "staubli_tx40"])
    parser.add_argument("--random", type=int, default=2000)
    parser.add_argument("--designs", type=int, default=0)
    parser.add_argument("--design-robot", default="scara")
    parser.add_argument("--separate", action="store_true")
    parser.add_argument("--first", type=int, default=0, help="seed of the first design")
    given = parser.parse_args()
    for name in given.robots:
        compare(name, given.random)
    if given.separate:
        separations("kuka_lwr4p")
    if given.designs:
        violations(given.designs, given.design_robot, given.first)


if __name__ == "__main__":
    main()
