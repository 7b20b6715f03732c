"""Torque and motor position of one run with effects a study does not declare.

Every effect is written here from its mechanics, not from the catalogue under examination: hysteresis walks
along Dahl's closed form between reversals, elasticity moves the motor by the transmitted torque (the link
motion is the given one, so the flexible joint is inverted exactly), backlash is a play operator that
transmits nothing inside the gap, a contact acts through the tip's Jacobian.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from benchmarks.exam import robots


@dataclass(slots=True)
class Injected:
    """One effect: where it acts and with what parameters (SI). ``joint`` and ``source`` count from 0."""

    name: str
    joint: int | None
    params: dict[str, float]
    side: str = "motor"  # motor: tau_m only | link: both | sensor: tau_l only
    source: int | None = None
    run: int | None = None
    listed: bool = True  # in contract 7
    depends_on: tuple[str, ...] = ()


@dataclass(slots=True)
class Drives:
    """Joint-side drive and transmission parameters, each (n,)."""

    Ia: np.ndarray
    Fv: np.ndarray
    Fc: np.ndarray
    off: np.ndarray
    Fvl: np.ndarray
    Fcl: np.ndarray
    offl: np.ndarray
    presliding: np.ndarray  # rad (or m) of Dahl displacement, 0: smoothed sign
    smooth: np.ndarray  # rad/s of the smoothed sign


@dataclass(slots=True)
class Run:
    """Given motion of the links and its rigid torque; extra passes are kept in ``cache``."""

    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray
    index: int
    cache: dict[str, np.ndarray] = field(default_factory=dict)


@dataclass(slots=True)
class Plant:
    robot: robots.ExamRobot
    model: pin.Model
    links: list[pin.Inertia]
    drives: Drives
    sensors: bool  # a torque sensor after the gear separates the two sides


def dahl(x: np.ndarray, Fc: float, width: float) -> np.ndarray:
    """Dahl friction along the path x: between reversals F = s Fc + (F0 - s Fc) exp(-|x - x0| / width).

    A path turns between two samples, at the vertex of the parabola through the three around it: at the sample
    itself the friction of a slow recording would be late by half a sample, which no robot is.
    """
    step = np.sign(np.diff(x, prepend=x[0]))
    moving = np.flatnonzero(step)
    out = np.zeros_like(x)
    if len(moving) == 0:
        return out
    turns = moving[np.flatnonzero(np.diff(step[moving], prepend=0.0) != 0)]
    vertices = [_vertex(x, first) for first in turns]
    force, (begin, x0) = 0.0, vertices[0]
    for first, (end, at) in zip(turns, [*vertices[1:], (len(x), x[-1])]):
        s = step[first]
        out[begin:end] = s * Fc + (force - s * Fc) * np.exp(-np.abs(x[begin:end] - x0) / width)
        force = s * Fc + (force - s * Fc) * np.exp(-np.abs(at - x0) / width)
        begin, x0 = end, at
    return out


def _vertex(x: np.ndarray, first: int) -> tuple[int, float]:
    """First sample behind a turn that the difference of x shows at sample ``first``, and where x turned."""
    k = first - 1  # the outermost sample
    if k < 1 or (bend := x[k - 1] - 2 * x[k] + x[k + 1]) == 0.0:
        return first, x[max(k, 0)]
    slope = (x[k + 1] - x[k - 1]) / 2
    return (k if slope * bend > 0 else first), x[k] - slope**2 / (2 * bend)


def play(x: np.ndarray, gap: float) -> np.ndarray:
    """Output of a play operator of total width gap, starting in the middle."""
    step = np.sign(np.diff(x, prepend=x[0]))
    moving = np.flatnonzero(step)
    out = np.full_like(x, x[0])
    if len(moving) == 0:
        return out
    turns = moving[np.flatnonzero(np.diff(step[moving], prepend=0.0) != 0)]
    here = x[0]
    for first, last in zip(turns, [*turns[1:], len(x)]):
        piece = x[first:last]
        if step[first] > 0:
            out[first:last] = np.maximum(here, piece - gap / 2)
        else:
            out[first:last] = np.minimum(here, piece + gap / 2)
        here = out[last - 1]
    return out


def coulomb(q: np.ndarray, dq: np.ndarray, Fc: float, width: float, smooth: float) -> np.ndarray:
    """A sign as physics makes it: presliding over a fraction of a milliradian, or a steep tanh."""
    if Fc == 0.0:
        return np.zeros_like(q)
    return dahl(q, Fc, width) if width > 0 else Fc * np.tanh(dq / smooth)


def _gradient(x: np.ndarray, dt: float) -> np.ndarray:
    return np.gradient(x, dt, axis=0)


def _payload(plant: Plant, run: Run, p: dict[str, float]) -> np.ndarray:
    """Torque of a body on the last link, exact for its mass, centre and a ball's inertia; cached per unit."""
    key = f"payload{p['mx'] / p['m']:.9f}{p['my'] / p['m']:.9f}{p['mz'] / p['m']:.9f}"
    if key not in run.cache:
        centre = np.array([p["mx"], p["my"], p["mz"]]) / p["m"]
        unit = pin.Inertia.FromSphere(1.0, 0.05).se3Action(pin.SE3(np.eye(3), centre))
        links = [pin.Inertia.Zero() for _ in plant.links]
        links[-1] = unit
        run.cache[key] = robots.inverse_dynamics(
            robots.pinocchio_model(plant.robot, links), run.q, run.dq, run.ddq
        )
    return p["m"] * run.cache[key] * (run.t >= p["from"])[:, None]


def _tilt(plant: Plant, run: Run, p: dict[str, float]) -> np.ndarray:
    """Torque difference when the base is rolled and pitched: gravity seen from the base turns back."""
    if "gx" not in run.cache:
        zero = np.zeros_like(run.q)
        for name, axis in (("gx", 0), ("gy", 1), ("gz", 2)):
            model = robots.pinocchio_model(plant.robot, plant.links)
            model.gravity.linear = 9.81 * np.eye(3)[axis]
            run.cache[name] = robots.inverse_dynamics(model, run.q, zero, zero)
    base = pin.rpy.rpyToMatrix(p["roll"], p["pitch"], 0.0)
    g = base.T @ np.array([0.0, 0.0, -1.0]) - np.array([0.0, 0.0, -1.0])
    return sum(g[k] * run.cache[name] for k, name in enumerate(("gx", "gy", "gz")))


def _contact(plant: Plant, run: Run, p: dict[str, float]) -> np.ndarray:
    """A constant force, `tool` metres before the flange, 0.1 s of rise and fall; the motors resist it."""
    out = np.zeros_like(run.q)
    inside = np.flatnonzero((run.t >= p["from"]) & (run.t <= p["to"]))
    model = robots.pinocchio_model(plant.robot, plant.links)
    J = robots.tip_jacobian(model, plant.robot, run.q[inside], np.array([0.0, 0.0, p["tool"]]))
    t = run.t[inside]
    gate = np.clip(np.minimum(t - p["from"], p["to"] - t) / 0.1, 0, 1)
    force = np.array([p["fx"], p["fy"], p["fz"]])
    out[inside] = -gate[:, None] * np.einsum("ikj,k->ij", J, force)
    return out


def _slope_in(plant: Plant, run: Run, j: int) -> np.ndarray:
    """d tau / d q_j along the run, by one displaced pass."""
    key = f"slope{j}"
    if key not in run.cache:
        shifted = run.q.copy()
        shifted[:, j] += 1e-3
        run.cache[key] = (robots.inverse_dynamics(plant.model, shifted, run.dq, run.ddq) - run.tau) / 1e-3
    return run.cache[key]


LOADS = {"payload_change": _payload, "base_tilt": _tilt, "external_force": _contact}


def _own(e: Injected, run: Run, s: dict[str, np.ndarray], plant: Plant) -> np.ndarray:
    """Torque of one effect on its own joint; s holds q, dq, ddq of the side it acts on, and the load."""
    j, p, t = e.joint, e.params, run.t
    assert j is not None
    q, dq, load = s["q"][:, j], s["dq"][:, j], s["load"][:, j]
    sgn = np.tanh(dq / plant.drives.smooth[j])
    k = e.source
    match e.name:
        case "stribeck_friction":
            return p["Fs"] * np.exp(-((dq / p["vs"]) ** 2)) * sgn
        case "nonlinear_viscous_friction":
            return p["Fv3"] * dq**3
        case "asymmetric_friction":
            return p["Fva"] * np.abs(dq)
        case "load_dependent_friction":
            return p["mu"] * np.abs(load) * sgn
        case "thermal_friction":
            return p["a"] * p["Fv"] * np.exp(-t / p["T"]) * dq
        case "torque_ripple":
            return p["A"] * np.sin(p["wavenumber"] * q + p["phi"])
        case "spring":
            return p["k"] * (q - p["q0"])
        case "joint_coupling":
            assert k is not None
            return p["Fv"] * s["dq"][:, k] + p["Ia"] * s["ddq"][:, k]
        # from here on: in no catalogue
        case "position_friction":
            return p["F"] * np.sin(q + p["phi"]) * sgn
        case "speed_ripple":
            return p["A"] * dq * np.sin(p["wavenumber"] * q + p["phi"])
        case "cross_drag":
            assert k is not None
            return p["D"] * dq * np.abs(s["dq"][:, k])
        case "chirp":
            return p["A"] * np.sin(2 * np.pi * (p["f0"] * t + p["rate"] * t**2 / 2))
        case "temperature_step":
            return p["F"] * (t > p["at"]) * dq
        case "cable":
            assert k is not None
            return p["A"] * np.tanh((q - p["share"] * s["q"][:, k] - p["q0"]) / p["width"])
        case "cubic_spring":
            return p["k3"] * (q - p["q0"]) ** 3
        case "soft_stop":
            return p["k2"] * np.maximum(q - p["q0"], 0) ** 2
        case "position_damping":
            return p["D"] * np.cos(2 * q + p["phi"]) * dq
        case "cross_stiffness":
            assert k is not None
            return p["k"] * np.sin(q) * s["q"][:, k] ** 2
        case "sloshing":
            return p["A"] * np.sin(2 * np.pi * p["f"] * t + p["beta"] * np.sin(2 * np.pi * 0.05 * t))
        case "damaged_tooth":
            return p["A"] * np.exp(p["sharpness"] * (np.cos(p["wavenumber"] * q + p["phi"]) - 1))
        case "acceleration_friction":
            return p["F"] * np.tanh(s["ddq"][:, j] / p["a"])
        case "creeping_seal":
            return p["F"] * np.exp(-_since_reversal(t, dq) / p["T"]) * sgn
        case "flipping_cable":
            return p["F"] * _latched(q, p["low"], p["high"])
        case "clutch":
            return p["F"] * (1 + np.tanh((np.abs(dq) - p["v"]) / (0.1 * p["v"]))) / 2 * sgn
        case "leaking_balancer":
            return p["A"] * np.sin(q + p["phi"]) * t / t[-1]
    raise KeyError(e.name)


def _since_reversal(t: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """(N,) seconds since the rate last changed its sign, or since the recording began."""
    turns = np.flatnonzero(np.diff(np.sign(dq), prepend=0.0) != 0)
    return t - t[turns[np.searchsorted(turns, np.arange(len(t)), side="right") - 1]]


def _latched(q: np.ndarray, low: float, high: float) -> np.ndarray:
    """(N,) 1 from where the position rose past `high` until it falls past `low`, else -1."""
    crossed = np.where(q > high, 1.0, np.where(q < low, -1.0, 0.0))
    at = np.maximum.accumulate(np.where(crossed != 0, np.arange(len(q)), 0))
    return np.where(crossed[at] != 0, crossed[at], -1.0)


MEASURED = {
    "drive_gain_error",
    "sensor_crosstalk",
    "offset_drift",
    "time_delay",
    "saturation",
    "dead_zone",
    "bent_scale",
}
MOTION = {"joint_elasticity", "backlash", "hysteresis"}


def _measured(e: Injected, t: np.ndarray, tau_m: np.ndarray, tau_l: np.ndarray) -> None:
    """Effects of the recording itself, in place."""
    tau, j, p = (tau_l if e.side == "sensor" else tau_m), e.joint, e.params
    match e.name:
        case "drive_gain_error":
            tau[:, j] *= p["gain"]
        case "sensor_crosstalk":
            tau[:, j] += p["gain"] * tau[:, e.source]
        case "offset_drift":
            tau[:, j] += p["slope"] * t
        case "time_delay":
            for c in range(tau.shape[1]) if j is None else [j]:
                tau[:, c] = np.interp(t - p["delay"], t, tau[:, c])
                if j is None and e.side != "sensor":
                    tau_l[:, c] = np.interp(t - p["delay"], t, tau_l[:, c])
        case "saturation":
            tau[:, j] = np.clip(tau[:, j], -p["limit"], p["limit"])
        case "dead_zone":
            x = tau[:, j]
            tau[:, j] = np.sign(x) * np.maximum(np.abs(x) - p["width"], 0)
        case "bent_scale":
            tau[:, j] -= p["bend"] * tau[:, j] ** 3


def simulate(plant: Plant, run: Run, effects: list[Injected]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Motor position, motor torque and sensor torque (N, n each), without noise."""
    d, n, t = plant.drives, plant.robot.n, run.t
    dt = t[1] - t[0]
    here = [e for e in effects if e.run is None or e.run == run.index]
    load = run.tau.copy()
    for e in here:
        if e.name in LOADS:
            load += LOADS[e.name](plant, run, e.params)
    elastic = {e.joint: e for e in here if e.name == "joint_elasticity"}
    slack = {e.joint: e for e in here if e.name == "backlash"}
    bristle = {(e.joint, e.side): e for e in here if e.name == "hysteresis"}
    link = {"q": run.q, "dq": run.dq, "ddq": run.ddq, "load": load}
    through = load.copy()  # what the gear transmits
    for j, e in slack.items():
        assert j is not None
        out = play(run.q[:, j], e.params["gap"])
        through += _slope_in(plant, run, j) * (out - run.q[:, j])[:, None]
        if e.params["drops"]:  # nothing is transmitted while the motor crosses the gap
            through[:, j] *= np.clip(np.abs(run.q[:, j] - out) / (e.params["gap"] / 2) * 5 - 4, 0, 1)
    if plant.sensors:
        for j in range(n):
            through[:, j] += d.Fvl[j] * run.dq[:, j] + d.offl[j]
            if (j, "link") in bristle:
                p = bristle[j, "link"].params
                through[:, j] += dahl(run.q[:, j], p["Fc"], p["Fc"] / p["sigma"])
            else:
                through[:, j] += coulomb(run.q[:, j], run.dq[:, j], d.Fcl[j], d.presliding[j], d.smooth[j])
    motion_free = [e for e in here if e.name not in LOADS and e.name not in MEASURED and e.name not in MOTION]
    for e in motion_free:
        if e.side == "link":
            through[:, e.joint] += _own(e, run, link, plant)
    q, dq, ddq = run.q.copy(), run.dq.copy(), run.ddq.copy()
    for j, e in elastic.items():
        q[:, j] += through[:, j] / e.params["k"]
        dq[:, j] = _gradient(q[:, j], dt)
        ddq[:, j] = _gradient(dq[:, j], dt)
    motor = {"q": q, "dq": dq, "ddq": ddq, "load": through}
    tau_m = through + d.Ia * ddq + d.Fv * dq + d.off
    for j in range(n):
        if (j, "motor") in bristle:
            p = bristle[j, "motor"].params
            tau_m[:, j] += dahl(q[:, j], p["Fc"], p["Fc"] / p["sigma"])
        else:
            tau_m[:, j] += coulomb(q[:, j], dq[:, j], d.Fc[j], d.presliding[j], d.smooth[j])
    for e in motion_free:
        if e.side == "motor":
            tau_m[:, e.joint] += _own(e, run, motor, plant)
    tau_l = through.copy()
    for e in motion_free:
        if e.side == "sensor":
            tau_l[:, e.joint] += _own(e, run, link, plant)
    for e in here:
        if e.name in MEASURED:
            _measured(e, t, tau_m, tau_l)
    return q, tau_m, tau_l
