"""A designed motion of a UR10 against the one that figaroh's own optimiser found: the same robot, joint
ranges, length and top rates.

    python benchmarks/excitation_peer.py

figaroh's motion is published: examples/ur10/data/truth/train_waypoints.json of thanhndv212/figaroh-examples
(commit 98345176771fc29980a6b68806449b5439c8c05d), the best of sixteen seeds of its IPOPT optimiser, condition
number 61.7 by its own count; rest to rest in cubics of two seconds. Both motions are judged by the same
regressor at 50 Hz, by the condition number as it is and with columns of unit length, and by log det.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

import generated
from ident.excitation.experiment import Request, excite
from ident.excitation.information import scaled_condition

UR10 = """\
name: ur10
convention: mdh
gravity: [0, 0, -9.81]
links:
  - {joint: revolute, antecedent: 0, alpha: 0,     d: 0,       theta: q1, r: 0.1273}
  - {joint: revolute, antecedent: 1, alpha: pi/2,  d: 0,       theta: q2, r: 0}
  - {joint: revolute, antecedent: 2, alpha: 0,     d: -0.612,  theta: q3, r: 0}
  - {joint: revolute, antecedent: 3, alpha: 0,     d: -0.5723, theta: q4, r: 0.163941}
  - {joint: revolute, antecedent: 4, alpha: pi/2,  d: 0,       theta: q5, r: 0.1157}
  - {joint: revolute, antecedent: 5, alpha: -pi/2, d: 0,       theta: q6, r: 0.0922}
"""
LOW = (-3.1416, -2.3708, 0.7708, -2.7708, -1.7708, -1.5)
HIGH = (3.1416, -1.3708, 1.7708, -0.3708, -0.0708, 1.2)
EVERY = 2.0  # s
WAYPOINTS = np.array(
    [
        [-2.51327, -1.47080, 1.31524, -0.82413, -1.60080, -0.51000],
        [-0.72610, -2.28079, 1.67063, -0.61096, -0.90886, 0.92919],
        [1.06111, -2.28078, 1.65412, -1.88227, -1.61767, 0.92954],
        [1.14683, -2.28072, 0.86113, -2.55427, -1.61756, -1.25658],
        [1.14777, -2.28077, 1.66697, -2.03618, -0.24164, -1.25665],
        [-0.68408, -1.47081, 1.67053, -2.03586, -0.63005, -1.25619],
        [1.10313, -1.47082, 1.67073, -0.61147, -0.24120, 0.92973],
        [0.82745, -1.47259, 1.65272, -2.50043, -0.34208, -1.20163],
        [-0.99534, -2.28016, 1.14768, -2.54433, -1.59915, -1.21892],
        [0.79121, -2.27990, 0.91581, -2.53425, -1.60396, -1.23522],
        [0.69354, -2.27956, 1.29306, -0.65833, -1.13287, -1.23512],
        [2.47126, -1.47160, 0.94348, -0.62316, -1.17083, 0.91766],
        [0.64013, -1.47166, 0.87604, -1.62367, -0.88956, 0.90539],
    ]
)


def theirs(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, dq, ddq (N, 6): cubics that rest at every waypoint."""
    k = np.minimum((t / EVERY).astype(int), len(WAYPOINTS) - 2)
    s, way = (t / EVERY - k)[:, None], np.diff(WAYPOINTS, axis=0)[k]
    return (
        WAYPOINTS[k] + way * (3 * s**2 - 2 * s**3),
        way * (6 * s - 6 * s**2) / EVERY,
        way * (6 - 12 * s) / EVERY**2,
    )


def main() -> None:
    robot = Path(tempfile.mkdtemp()) / "ur10.yaml"
    robot.write_text(UR10)
    model = generated.load(str(robot), "A")
    t = np.arange(0.0, EVERY * (len(WAYPOINTS) - 1), 0.02)
    peer = theirs(t)
    rate, acceleration = (np.abs(part).max() for part in peer[1:])
    limits = [f"q:{k}={a}..{b}" for k, (a, b) in enumerate(zip(LOW, HIGH), 1)]
    limits += [f"dq={rate:.4g}", f"ddq={acceleration:.4g}", "jerk=1000"]
    print(f"{t[-1]:.0f} s, at most {rate:.2f} rad/s and {acceleration:.2f} rad/s^2 on every joint")

    bodies = np.array([not name.startswith(("Ia", "Fv", "Fc", "Off")) for name in model.parameters])

    def tell(name: str, states: tuple[np.ndarray, ...], took: str) -> None:
        W = model.regressor(*states[:3])
        for kind, columns in (("all", bodies | True), ("bodies alone", bodies)):
            A = W[:, :, columns].reshape(-1, columns.sum())
            told = np.linalg.slogdet(A.T @ A)[1] / A.shape[1]
            print(
                f"{name}, {kind}: condition {np.linalg.cond(A):.1f}, of unit columns "
                f"{scaled_condition(A):.1f}, log det per parameter {told:.2f}{took}",
                flush=True,
            )

    tell("figaroh, best of 16 seeds", peer, "")
    for criterion in ("d", "condition"):
        begin, cpu = time.perf_counter(), time.process_time()
        done = excite(
            Request(str(robot), duration=24.0, limits=tuple(limits), criterion=criterion, sensitivity=False)
        )
        took = f", {time.perf_counter() - begin:.0f} s ({time.process_time() - cpu:.0f} s of processor)"
        tell(f"designed ({criterion})", done.motion.states(t), took)


if __name__ == "__main__":
    main()
