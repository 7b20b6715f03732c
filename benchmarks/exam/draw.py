"""Random effects: which joint, which shape, and the range in which the size may lie to stay physical.

A drawn effect is a function of one size ``a``; the size itself is set afterwards so that the error of the
joint, measured by a plain fit of the rigid model, comes to the wanted percentage.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.exam.physics import Injected, Plant, Run

PAPER = ("coulomb_friction", "viscous_friction", "offset", "rotor_inertia")
CATALOGUE = (
    "stribeck_friction",
    "nonlinear_viscous_friction",
    "asymmetric_friction",
    "load_dependent_friction",
    "thermal_friction",
    "hysteresis",
    "torque_ripple",
    "spring",
    "joint_elasticity",
    "joint_coupling",
    "base_tilt",
    "payload_change",
    "external_force",
    "drive_gain_error",
    "sensor_crosstalk",
    "offset_drift",
    "time_delay",
    "backlash",
)
OUTSIDE = (
    "position_friction",
    "speed_ripple",
    "cross_drag",
    "saturation",
    "dead_zone",
    "chirp",
    "temperature_step",
    "cable",
    "cubic_spring",
    "soft_stop",
    "position_damping",
    "cross_stiffness",
    "sloshing",
    "damaged_tooth",
    "acceleration_friction",
    "creeping_seal",
    "flipping_cable",
    "clutch",
    "leaking_balancer",
    "bent_scale",
)
SEVERAL = (
    "stribeck_friction",
    "torque_ripple",
    "joint_coupling",
    "payload_change",
    "external_force",
    "sensor_crosstalk",
)  # of which one joint, or one run, may have two
COVERABLE = (
    "cubic_spring",
    "soft_stop",
    "temperature_step",
    "dead_zone",
    "saturation",
    "cable",
    "damaged_tooth",
    "bent_scale",
)  # a catalogue may rightly own these


@dataclass(frozen=True, slots=True)
class Drawn:
    build: Callable[[float], Injected]
    start: float
    low: float
    high: float


def another(one: Injected, other: Injected) -> bool:
    """Whether a second effect of a name is another one than the first: of another joint's motion, another
    wave or curve, another time."""
    a, b = one.params, other.params
    apart = [max(a[k], b[k]) > 2 * min(a[k], b[k]) for k in ("wavenumber", "vs") if k in a]
    if "to" in a:
        apart.append(one.run != other.run or a["to"] < b["from"] or b["to"] < a["from"])
    elif "from" in a:  # of two fitted runs that carry a body each all along only the difference shows
        within = max(a["from"], b["from"]) > 0
        apart.append(within and (one.run != other.run or abs(a["from"] - b["from"]) > 5.0))
    return any(apart) or one.source != other.source


@dataclass(frozen=True, slots=True)
class Scene:
    """What sizes are measured against: one identify run without effects."""

    plant: Plant
    runs: list[Run]
    model: str
    torque: np.ndarray  # (n,) rms of the diagnosed torque
    identify_runs: int

    @property
    def n(self) -> int:
        return self.plant.robot.n


def _friction_side(scene: Scene, rng: np.random.Generator) -> str:
    if scene.model == "B":
        return "link"
    if scene.model == "C" and rng.random() < 0.3:
        return "link"
    return "motor"


def draw(name: str, scene: Scene, joint: int, rng: np.random.Generator) -> Drawn | None:
    """An effect of the given name on the given joint (from 0), or None where it makes no sense."""
    d, run = scene.plant.drives, scene.runs[0]
    j, T = joint, float(run.t[-1])
    side = _friction_side(scene, rng)
    S = scene.torque[j]
    dq, q = run.dq[:, j], run.q[:, j]
    vmax, vrms = float(np.abs(dq).max()), float(np.sqrt(np.mean(dq**2)))
    Fc, Fv = (d.Fcl[j], d.Fvl[j]) if side == "link" else (d.Fc[j], d.Fv[j])
    others = [k for k in range(scene.n) if k != j]
    near = [k for k in (j - 1, j + 1) if 0 <= k < scene.n]
    source = int(rng.choice(near if rng.random() < 0.7 else others))
    sign = float(rng.choice([-1.0, 1.0]))
    revolute = not scene.plant.robot.rows[j].prismatic
    reach = float(np.abs(q - q.mean()).max())

    def one(**kw: float) -> Injected:
        return Injected(name, j, kw, side)

    match name:
        case "stribeck_friction":
            vs = float(rng.uniform(0.03, 0.2)) * vmax
            return Drawn(lambda a: one(Fs=a, vs=vs), 0.1 * S, 0.0, 1.5 * max(Fc, 0.1 * S))
        case "nonlinear_viscous_friction":
            limit = 0.6 * Fv / vmax**2 if sign < 0 else 3 * Fv / vmax**2
            return Drawn(lambda a: one(Fv3=sign * a), 0.3 * limit, 0.0, limit)
        case "asymmetric_friction":
            return Drawn(lambda a: one(Fva=sign * a), 0.2 * Fv, 0.0, 0.9 * max(Fv, 0.1 * S / vrms))
        case "load_dependent_friction":
            return Drawn(lambda a: one(mu=a), 0.05, 0.0, 0.3)
        case "thermal_friction":
            tau = float(rng.uniform(0.15, 0.8)) * T
            base = max(Fv, 1e-9)
            return Drawn(lambda a: one(a=a, T=tau, Fv=base), 0.3, 0.0, 2.0)
        case "hysteresis":
            if Fc <= 0:
                return None
            return Drawn(lambda a: one(Fc=Fc, sigma=Fc / a), 0.02, 2e-3, 0.2 if revolute else 0.05)
        case "torque_ripple":
            k = float(rng.choice([rng.uniform(4, 12), rng.uniform(12, 50)])) * (1 if revolute else 8)
            phi = float(rng.uniform(-np.pi, np.pi))
            return Drawn(lambda a: one(A=a, wavenumber=k, phi=phi), 0.05 * S, 0.0, 0.5 * S)
        case "spring":
            q0 = float(q.mean() + rng.uniform(-0.3, 0.3) * reach)
            return Drawn(lambda a: one(k=a, q0=q0), 0.2 * S, 0.0, 3 * S / reach)
        case "joint_elasticity":
            top = float(np.abs(run.tau[:, j]).max())
            return Drawn(lambda a: one(k=top / a), 0.005, 5e-4, 0.04 if revolute else 0.01)
        case "joint_coupling":
            other = scene.runs[0]
            v = float(np.sqrt(np.mean(other.dq[:, source] ** 2)))
            w = float(np.sqrt(np.mean(other.ddq[:, source] ** 2)))
            mix = float(rng.uniform(0.3, 1.0))

            def coupled(a: float) -> Injected:
                return Injected(
                    name, j, {"Fv": sign * a * mix / v, "Ia": sign * a * (1.3 - mix) / w}, side, source
                )

            return Drawn(coupled, 0.1 * S, 0.0, 1.0 * S)
        case "base_tilt":
            angle = float(rng.uniform(-np.pi, np.pi))
            return Drawn(
                lambda a: Injected(
                    name, None, {"roll": a * np.cos(angle), "pitch": a * np.sin(angle)}, "link"
                ),
                0.02,
                0.0,
                0.1,
            )
        case "payload_change":
            c = rng.uniform([-0.05, -0.05, 0.03], [0.05, 0.05, 0.12])
            if scene.identify_runs > 1 or rng.random() < 0.3:
                when = 0.0 if rng.random() < 0.6 else float(rng.uniform(0.3, 0.7)) * T
            else:
                when = float(rng.uniform(0.3, 0.7)) * T
            which = int(rng.integers(scene.identify_runs))
            if when == 0.0 and scene.identify_runs == 1:
                when = 0.4 * T

            def load(a: float) -> Injected:
                p = {"m": a, "mx": a * c[0], "my": a * c[1], "mz": a * c[2], "from": when}
                return Injected(name, None, p, "link", run=which)

            return Drawn(load, 0.5, 0.0, 0.25 * scene.plant.robot.mass)
        case "external_force":
            way = rng.normal(size=3)
            way /= np.linalg.norm(way)
            length = float(rng.uniform(4, 15)) * T / 60
            begin = float(rng.uniform(0.1, 0.85)) * (T - length)
            which = int(rng.integers(scene.identify_runs))
            tool = float(rng.choice([0.0, 0.0, 0.08]))

            def push(a: float) -> Injected:
                p = {
                    "fx": a * way[0],
                    "fy": a * way[1],
                    "fz": a * way[2],
                    "from": begin,
                    "to": begin + length,
                    "tool": tool,
                }
                return Injected(name, None, p, "link", run=which)

            return Drawn(push, 10.0, 0.0, 80.0)
        case "drive_gain_error":
            s = "sensor" if scene.model == "B" or (scene.model == "C" and rng.random() < 0.4) else "motor"
            return Drawn(lambda a: Injected(name, j, {"gain": 1 + sign * a}, s), 0.1, 0.02, 0.3)
        case "sensor_crosstalk":
            if scene.model not in ("B", "C"):
                return None
            return Drawn(lambda a: Injected(name, j, {"gain": sign * a}, "sensor", source), 0.03, 0.0, 0.3)
        case "offset_drift":
            s = "sensor" if scene.model == "B" or (scene.model == "C" and rng.random() < 0.4) else "motor"
            return Drawn(lambda a: Injected(name, j, {"slope": sign * a}, s), 0.1 * S / T, 0.0, S / T)
        case "time_delay":
            s = "sensor" if scene.model == "B" else "motor"
            where = None if rng.random() < 0.6 else j
            return Drawn(lambda a: Injected(name, where, {"delay": a}, s), 4e-3, 1e-3, 2.5e-2)
        case "backlash":
            drops = float(rng.random() < 0.5)
            return Drawn(lambda a: one(gap=a, drops=drops), 0.005, 2e-4, 0.045 if revolute else 0.01)
    return _outside(name, scene, j, source, side, sign, rng)


def _outside(
    name: str, scene: Scene, j: int, source: int, side: str, sign: float, rng: np.random.Generator
) -> Drawn | None:
    run = scene.runs[0]
    S, T = scene.torque[j], float(run.t[-1])
    q, dq = run.q[:, j], run.dq[:, j]
    vrms = float(np.sqrt(np.mean(dq**2)))
    reach = float(np.abs(q - q.mean()).max())
    phi = float(rng.uniform(-np.pi, np.pi))
    s = "sensor" if scene.model == "B" or (scene.model == "C" and rng.random() < 0.4) else "motor"
    me, them = f"q{j + 1}", f"q{source + 1}"

    def one(depends: tuple[str, ...], src: int | None = None, on: str = side, **kw: float) -> Injected:
        return Injected(name, j, kw, on, src, listed=False, depends_on=depends)

    k = float(rng.uniform(5, 30))
    match name:
        case "position_friction":
            return Drawn(lambda a: one((me, "d" + me), F=a, phi=phi), 0.1 * S, 0.0, 0.5 * S)
        case "speed_ripple":
            return Drawn(
                lambda a: one((me, "d" + me), A=a, wavenumber=k, phi=phi), 0.1 * S / vrms, 0.0, S / vrms
            )
        case "cross_drag":
            return Drawn(
                lambda a: one(("d" + me, "d" + them), source, D=sign * a), 0.1 * S / vrms**2, 0.0, S / vrms**2
            )
        case "saturation":
            top = 1.8 * S
            return Drawn(lambda a: one((me, "tau"), on=s, limit=top / (1 + a)), 0.2, 0.0, 1.2)
        case "dead_zone":
            return Drawn(lambda a: one((me, "tau"), on=s, width=a * S), 0.1, 0.0, 0.4)
        case "chirp":
            f0, rate = float(rng.uniform(0.2, 1.0)), float(rng.uniform(0.5, 2.0)) / T
            return Drawn(lambda a: one(("t",), A=a, f0=f0, rate=rate), 0.05 * S, 0.0, 0.4 * S)
        case "temperature_step":
            at = float(rng.uniform(0.3, 0.7)) * T
            return Drawn(
                lambda a: one(("t", "d" + me), F=sign * a, at=at), 0.1 * S / vrms, 0.0, 0.6 * S / vrms
            )
        case "cable":
            share = float(rng.uniform(0.4, 0.9)) * float(rng.choice([-1, 1]))
            x = q - share * run.q[:, source]
            q0, width = float(np.median(x)), 0.35 * float(np.std(x))
            return Drawn(
                lambda a: one((me, them), source, A=sign * a, share=share, q0=q0, width=width),
                0.1 * S,
                0.0,
                0.6 * S,
            )
        case "cubic_spring":
            q0 = float(q.mean())
            return Drawn(lambda a: one((me,), k3=sign * a, q0=q0), 0.1 * S / reach**3, 0.0, S / reach**3)
        case "soft_stop":
            q0 = float(np.quantile(q, 0.8))
            return Drawn(lambda a: one((me,), k2=a, q0=q0), 0.1 * S / reach**2, 0.0, 5 * S / reach**2)
        case "position_damping":
            return Drawn(lambda a: one((me, "d" + me), D=a, phi=phi), 0.1 * S / vrms, 0.0, 0.5 * S / vrms)
        case "cross_stiffness":
            far = float(np.abs(run.q[:, source]).max())
            return Drawn(lambda a: one((me, them), source, k=sign * a), 0.1 * S / far**2, 0.0, S / far**2)
        case "sloshing":
            f, beta = float(rng.uniform(0.5, 2.0)), float(rng.uniform(2.0, 6.0))
            return Drawn(lambda a: one(("t",), A=a, f=f, beta=beta), 0.05 * S, 0.0, 0.4 * S)
        case "damaged_tooth":
            sharp = float(rng.uniform(4, 12))
            return Drawn(
                lambda a: one((me,), A=sign * a, wavenumber=k, phi=phi, sharpness=sharp), 0.1 * S, 0.0, S
            )
        case "acceleration_friction":
            a0 = 0.3 * float(np.sqrt(np.mean(run.ddq[:, j] ** 2)))
            return Drawn(lambda a: one(("d" + me, "dd" + me), F=a, a=a0), 0.05 * S, 0.0, 0.5 * S)
        case "creeping_seal":
            lasts = float(rng.uniform(0.1, 0.5))
            return Drawn(lambda a: one(("d" + me, "t"), F=a, T=lasts), 0.1 * S, 0.0, 0.6 * S)
        case "flipping_cable":
            low, high = (float(x) for x in np.quantile(q, (0.35, 0.65)))
            return Drawn(lambda a: one((me,), F=sign * a, low=low, high=high), 0.05 * S, 0.0, 0.5 * S)
        case "clutch":
            v = float(np.quantile(np.abs(dq), rng.uniform(0.5, 0.8)))
            return Drawn(lambda a: one(("d" + me,), F=a, v=v), 0.1 * S, 0.0, 0.6 * S)
        case "leaking_balancer":
            return Drawn(lambda a: one((me, "t"), A=a, phi=phi), 0.1 * S, 0.0, 0.6 * S)
        case "bent_scale":
            return Drawn(lambda a: one(("tau",), on=s, bend=sign * a / (3 * S) ** 2), 0.1, 0.0, 0.3)
    raise KeyError(name)
