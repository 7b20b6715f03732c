"""Designed motions against those that figaroh's own optimiser finds: the same robot, limits and length; and
against FloBaRoID's published method, restated.

    python benchmarks/excitation_peer.py
    python benchmarks/excitation_peer.py --flobaroid [--seed 0]
    python -m venv /tmp/figaroh && /tmp/figaroh/bin/pip install figaroh cyipopt-wheels
    python benchmarks/excitation_peer.py --figaroh /tmp/figaroh/bin/python [--seconds 10] [--seed 0]

Without an option, a UR10 against figaroh's published motion: examples/ur10/data/truth/train_waypoints.json of
thanhndv212/figaroh-examples (commit 98345176771fc29980a6b68806449b5439c8c05d), the best of sixteen seeds of
its IPOPT optimiser, condition number 61.7 by its own count; rest to rest in cubics of two seconds.

With --figaroh its optimiser runs here, with the settings of its own UR10 example (one segment, a waypoint
every two seconds, 20 Hz, at most 100 iterations), on the KUKA iiwa 7 of this repository; ours gets the limits
that it drew from the URDF, and for accelerations the largest that its motion takes. Motions are judged by the
same regressor at as many instants, by the condition number as it is and with columns of unit length, and by
log det.

FloBaRoID is no package and publishes no figure of an optimised motion. With --flobaroid its published method
is restated here, not its code run: unknowns, bounds and soft costs of kjyv/FloBaRoID, configs/kuka_lwr4.yaml
(commit 06dcd2a6507085e0665b9436ac907c03863de2db) and excitation/trajectoryOptimizer.py (commit
0133a1d82ef2e380c8a687d0a8b62adf8dc1bf9b), on the LWR4+ at a period of 10 s (it allows 6.3 to 21), without
its collisions. Its sampler (400 trials of Optuna) is SciPy's differential evolution, with at least as many;
its two steps of IPOPT are SLSQP to its end. `condition` is the objective of its versions before 0.9. What
it takes is time of this restatement, not FloBaRoID's.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import scipy.optimize

import generated
from ident.excitation.experiment import Request, excite
from ident.excitation.information import CRITERIA, scaled_condition
from ident.excitation.known import known_robot
from ident.excitation.limits import bounds_of
from modelgen.geometry.robot_file import load_robot

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


PEER = """
import sys, time, warnings
import numpy as np, yaml
from figaroh.optimal.base_optimal_trajectory import BaseOptimalTrajectory, BaseTrajectoryIPOPTProblem
from figaroh.tools.robot import load_robot

warnings.simplefilter("ignore")

class Optimiser(BaseOptimalTrajectory):
    def create_ipopt_problem(self, *given):
        return BaseTrajectoryIPOPTProblem(self, *given)

urdf, out, seconds, seed = sys.argv[1], sys.argv[2], float(sys.argv[3]), int(sys.argv[4])
np.random.seed(seed)
robot = load_robot(urdf, package_dirs=".", load_by_urdf=True)
names = [name for name in robot.model.names if name != "universe"]
parts = {"friction": False, "joint_offset": False, "actuator_inertia": False}
tasks = {
    "identification": {"enabled": True, "problem": {"use_joint_torques": True, "model_components": parts}},
    "optimal_trajectory": {
        "enabled": True,
        "problem": {"soft_lim": 0.1, "max_attempts": 500, "max_iterations": 100},
        "trajectory": {"waypoints": round(seconds / 2) + 1, "frequency": 20, "segment_duration": 2.0}}}
joints = {"joints": {"active_joints": names}, "mechanics": {}}
with open(out + ".yaml", "w") as file:
    yaml.safe_dump({"robot": {"name": "peer", "properties": joints}, "tasks": tasks}, file)
wall, cpu = time.perf_counter(), time.process_time()
search = Optimiser(robot, names, out + ".yaml")
ids = [search.model.getJointId(name) for name in names]
found = [search.model.joints[k] for k in ids]
search.identif_config.update(
    active_joints=names, act_Jid=ids, act_J=found,
    act_idxq=[j.idx_q for j in found], act_idxv=[j.idx_v for j in found])
search.initialize()
results = search.solve(stack_reps=1)
took = time.perf_counter() - wall, time.process_time() - cpu
q, dq, ddq = (np.vstack(results[key]) for key in ("P_F", "V_F", "A_F"))
own = np.linalg.cond(search._stack_base_regressors(q, dq, ddq))
np.savez(out, q=q, dq=dq, ddq=ddq, took=took, own=own, low=search.CB.lower_q, high=search.CB.upper_q,
         rate=search.CB.upper_dq, effort=search.CB.upper_effort)
"""


HARMONICS = (3, 3, 4, 4, 5, 6, 6)  # of FloBaRoID's LWR4+, joint by joint
CENTRE, COEFFICIENT = np.deg2rad(25.0), 1.0  # rad, rad/s: bounds of its unknowns
RIDGE, UTILISATION, LEAST = 1e-4, 0.25, 0.02  # its defaults: of the largest eigenvalue, of the torque limits
GENERATIONS = 20


class Restated:
    """FloBaRoID's motions x (n + 2 sum of HARMONICS,), centres then coefficients; what it asks of them."""

    def __init__(self, robot: str, seconds: float, kind: str) -> None:
        self.known, self.bounds = known_robot(load_robot(robot), robot), bounds_of(load_robot(robot))
        self.kind, self.seconds, self.scale = kind, seconds, 0.0
        self.bodies = bodies_of(self.known.model)
        self.t = np.arange(0.0, seconds, 0.02)
        n = len(HARMONICS)
        self.high = np.concatenate((np.full(n, CENTRE), np.full(2 * sum(HARMONICS), COEFFICIENT)))

    def states(self, x: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, dq, ddq (N, n): a Fourier series about a centre, which need not rest where it begins."""
        n, w = len(HARMONICS), 2 * np.pi / self.seconds
        out = np.zeros((3, len(t), n))
        out[0] = self.bounds.middle + x[:n]
        parts = np.split(x[n:], np.cumsum((*HARMONICS, *HARMONICS))[:-1])
        for j, (a, b) in enumerate(zip(parts[:n], parts[n:])):
            k = w * np.arange(1, len(a) + 1)
            s, c = np.sin(np.outer(t, k)), np.cos(np.outer(t, k))
            out[0, :, j] += s @ (a / k) - c @ (b / k)
            out[1, :, j] = c @ a + s @ b
            out[2, :, j] = -s @ (a * k) + c @ (b * k)
        return out[0], out[1], out[2]

    def over(self, x: np.ndarray) -> np.ndarray:
        """Not positive where it holds: positions, rates, torques below their limits, the torques not idle."""
        q, dq, ddq = self.states(x, self.t)
        tau = np.abs(self.known.model.torque(q, dq, ddq, self.known.chi)).max(axis=0)
        b = self.bounds
        return np.concatenate((b.low - q.min(0), q.max(0) - b.high, np.abs(dq).max(0) - b.dq,
                               tau - b.tau, LEAST * b.tau - tau))  # fmt: skip

    def __call__(self, x: np.ndarray) -> float:
        q, dq, ddq = self.states(x, self.t)
        A = self.known.model.regressor(q, dq, ddq)[:, :, self.bodies].reshape(-1, self.bodies.sum())
        eigenvalues = np.linalg.eigvalsh(A.T @ A)
        if self.kind == "condition":
            return float(np.log(eigenvalues[-1] / max(eigenvalues[0], 1e-300)) / 2)
        used = np.abs(self.known.model.torque(q, dq, ddq, self.known.chi)).max(axis=0) / self.bounds.tau
        swing = np.ptp(q, axis=0) / (self.bounds.high - self.bounds.low)
        volume = -np.log(eigenvalues + RIDGE * eigenvalues[-1]).sum()
        self.scale = self.scale or 10 / abs(volume)  # ten where it begins
        soft = used.std() / used.mean() + max(0.0, 1 - used.mean() / UTILISATION) + 1 - swing.mean()
        return float(self.scale * volume + 10 * soft)

    def found(self, seed: int) -> np.ndarray:
        """The best of GENERATIONS of as many motions as there are unknowns, refined."""
        box = scipy.optimize.Bounds(-self.high, self.high)
        limits = scipy.optimize.NonlinearConstraint(self.over, -np.inf, 0.0)
        tried = scipy.optimize.differential_evolution(
            self,
            box,
            constraints=limits,
            maxiter=GENERATIONS,
            popsize=1,
            seed=seed,
            polish=False,
        )
        refined = scipy.optimize.minimize(
            self, tried.x, bounds=box, method="SLSQP", options={"maxiter": 100},
            constraints={"type": "ineq", "fun": lambda x: -self.over(x)},
        )  # fmt: skip
        return refined.x if self.over(refined.x).max() < 0.01 else tried.x


def bodies_of(model: generated.Model) -> np.ndarray:
    """(b,) parameters that figaroh designs for."""
    return np.array([not name.startswith(("Ia", "Fv", "Fc", "Off")) for name in model.parameters])


def told(model: generated.Model, name: str, states: tuple[np.ndarray, ...], took: str = "") -> None:
    """A line on all columns, and one on those of the bodies alone."""
    W = model.regressor(*states[:3])
    bodies = bodies_of(model)
    for kind, columns in (("all", bodies | True), ("bodies alone", bodies)):
        A = W[:, :, columns].reshape(-1, columns.sum())
        value = np.linalg.slogdet(A.T @ A)[1] / A.shape[1]
        print(
            f"{name}, {kind}: condition {np.linalg.cond(A):.1f}, of unit columns "
            f"{scaled_condition(A):.1f}, log det per parameter {value:.2f}{took}",
            flush=True,
        )


def ours(robot: str, seconds: float, limits: list[str], t: np.ndarray) -> None:
    """Our motions of the same length under the same limits."""
    model = generated.load(robot, "A")
    for criterion in CRITERIA:
        begin, cpu = time.perf_counter(), time.process_time()
        done = excite(
            Request(robot, duration=seconds, limits=tuple(limits), criterion=criterion, sensitivity=False)
        )
        took = f", {time.perf_counter() - begin:.0f} s ({time.process_time() - cpu:.1f} s of processor)"
        told(model, f"designed ({criterion})", done.motion.states(t), took)


def published() -> None:
    robot = Path(tempfile.mkdtemp()) / "ur10.yaml"
    robot.write_text(UR10)
    t = np.arange(0.0, EVERY * (len(WAYPOINTS) - 1), 0.02)
    peer = theirs(t)
    rate, acceleration = (np.abs(part).max() for part in peer[1:])
    limits = [f"q:{k}={a}..{b}" for k, (a, b) in enumerate(zip(LOW, HIGH), 1)]
    limits += [f"dq={rate:.4g}", f"ddq={acceleration:.4g}", "jerk=1000"]
    print(f"{t[-1]:.0f} s, at most {rate:.2f} rad/s and {acceleration:.2f} rad/s^2 on every joint")
    told(generated.load(str(robot), "A"), "figaroh, best of 16 seeds", peer)
    ours(str(robot), EVERY * (len(WAYPOINTS) - 1), limits, t)


def live(python: str, seconds: float, seed: int) -> None:
    from modelgen.geometry import robot_file

    robot = str(Path(robot_file.__file__).parents[1] / "robots" / "kuka_iiwa7.urdf")
    folder = Path(tempfile.mkdtemp())
    (folder / "peer.py").write_text(PEER)
    command = [python, str(folder / "peer.py"), robot, str(folder / "out"), str(seconds), str(seed)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    peer = np.load(folder / "out.npz")
    top = float(np.abs(peer["ddq"]).max())
    limits = [f"q:{k}={a}..{b}" for k, (a, b) in enumerate(zip(peer["low"], peer["high"]), 1)]
    for key, name in (("dq", "rate"), ("tau", "effort")):
        limits += [f"{key}:{k}={value}" for k, value in enumerate(peer[name], 1)]
    limits += [f"ddq={top:.4g}", "jerk=1000"]
    wall, cpu = peer["took"]
    print(f"iiwa 7, {seconds:g} s, at most {top:.2f} rad/s^2; its own condition {float(peer['own']):.1f}")
    states = tuple(peer[name] for name in ("q", "dq", "ddq"))
    told(generated.load(robot, "A"), "figaroh", states, f", {wall:.0f} s ({cpu:.1f} s of processor)")
    ours(robot, seconds, limits, np.linspace(0.0, seconds, len(peer["q"])))


def restated(seconds: float, seed: int) -> None:
    """FloBaRoID's method and ours on the LWR4+; accelerations: ours get the largest of its motions."""
    robot, tops, t = "kuka_lwr4p", [], np.arange(0.0, seconds, 0.02)
    for kind in ("log det and soft costs", "condition"):
        its = Restated(robot, seconds, kind)
        begin, cpu = time.perf_counter(), time.process_time()
        x = its.found(seed)
        took = f", {time.perf_counter() - begin:.0f} s ({time.process_time() - cpu:.1f} s of processor)"
        states = its.states(x, t)
        tops.append(float(np.abs(states[2]).max()))
        told(its.known.model, f"FloBaRoID restated ({kind}), {its.over(x).max():.3f} over", states, took)
    print(f"LWR4+, {seconds:g} s, at most {max(tops):.2f} rad/s^2 on every joint")
    ours(robot, seconds, [f"ddq={max(tops):.4g}", "jerk=1000"], t)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--figaroh", default=None, help="a Python that has figaroh and cyipopt")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--flobaroid", action="store_true", help="its published method, restated")
    given = parser.parse_args()
    if given.flobaroid:
        restated(given.seconds, given.seed)
    elif given.figaroh:
        live(given.figaroh, given.seconds, given.seed)
    else:
        published()


if __name__ == "__main__":
    main()
