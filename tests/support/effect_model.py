"""A small arm as the model that an effect may ask and the truth that it acts on: standard parameters, NumPy.

Nothing is derived or compiled: torques are the standard regressor's columns times numbers written here.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from modelgen.effects import effect
from modelgen.effects.effect import Effect
from modelgen.effects.gravity_search import standard_columns
from modelgen.effects.place import Layout, Motion, Place, torque_slopes
from modelgen.effects.truth import STAGES, Truth, played
from modelgen.geometry.names import INERTIAL, Channel
from modelgen.geometry.robot import Robot
from modelgen.geometry.robot_file import parse_robot

ARM = """
name: small
convention: mdh
gravity: [0, 0, -9.81]
links:
  - {joint: revolute,  antecedent: 0, alpha: 0,     d: 0,   theta: q1, r: 0}
  - {joint: revolute,  antecedent: 1, alpha: pi/2,  d: 0,   theta: q2, r: 0}
  - {joint: revolute,  antecedent: 2, alpha: 0,     d: 0.4, theta: q3, r: 0.1}
  - {joint: revolute,  antecedent: 3, alpha: -pi/2, d: 0.3, theta: q4, r: 0.1}
"""
SLIDE = """
name: slide
convention: mdh
gravity: [0, 0, -9.81]
links:
  - {joint: revolute,  antecedent: 0, alpha: 0,    d: 0, theta: q1, r: 0}
  - {joint: prismatic, antecedent: 1, alpha: pi/2, d: 0, theta: 0,  r: q2 + 0.3}
"""
DRIVE = {"Iam": 0.8, "Fvm": 2.0, "Fcm": 3.0, "Offm": 0.2}
LINK = {"Fvl": 0.3, "Fcl": 0.5, "Offl": -0.1}


def bodies(robot: Robot) -> dict[str, float]:
    """Balls of falling mass beside their frames' origins: each a body that can exist."""
    out = {}
    for row in range(1, len(robot.links) + 1):
        m, c = 6.0 / row, np.array([0.15, 0.05 * (-1) ** row, 0.08])
        inertia = 0.02 * np.eye(3) + m * (c @ c * np.eye(3) - np.outer(c, c))
        values = [*inertia[np.triu_indices(3)], *(m * c), m]
        out |= {f"{kind}{row}": float(v) for kind, v in zip(INERTIAL, values)}
    return out


@dataclass(frozen=True)
class ArmModel:
    """The protocol that `modelgen.effects.place.Model` asks for, by the standard regressor."""

    robot: Robot
    channels: tuple[Channel, ...]
    standard: Mapping[str, float]
    found: np.ndarray | None = None  # (N, C) torque of effects found before

    @property
    def parameters(self) -> tuple[str, ...]:
        return tuple(self.standard)

    def regressor(self, motion: Motion, q=None, dq=None, ddq=None) -> np.ndarray:
        q, dq, ddq = (a if b is None else b for a, b in zip((motion.q, motion.dq, motion.ddq), (q, dq, ddq)))
        rigid = standard_columns(self.robot, q, dq, ddq)
        names = [f"{kind}{row}" for row in range(1, len(self.robot.links) + 1) for kind in INERTIAL]
        signal = {"I": ddq, "Fv": dq, "Fc": motion.sign_dq, "Of": np.ones_like(q)}
        W = np.zeros((len(q), len(self.channels), len(self.standard)))
        for k, name in enumerate(self.standard):
            for c, channel in enumerate(self.channels):
                if name in names:
                    W[:, c, k] = rigid[:, channel.joint, names.index(name)] * (channel.side != "drive")
                elif int(name[-1]) == channel.joint + 1:
                    behind = name[:-1] in LINK
                    seen = channel.side == "motor" or (channel.side == "sensor") == behind
                    part = next(v for key, v in signal.items() if name.startswith(key))
                    W[:, c, k] = part[:, channel.joint] * seen
        return W

    def torque(self, motion: Motion, q=None, dq=None, ddq=None) -> np.ndarray:
        return self.regressor(motion, q, dq, ddq) @ np.array(list(self.standard.values()))

    def slopes(self, motion: Motion, joint: int) -> np.ndarray:
        return torque_slopes(self.torque, motion, joint)

    def once(self, kind: tuple[Hashable, ...], motion: Motion, make: Callable[[], np.ndarray]) -> np.ndarray:
        return make()

    def total(self, motion: Motion) -> np.ndarray:
        return self.torque(motion) + (0 if self.found is None else self.found)

    def link_torque(self, motion: Motion) -> np.ndarray:
        sensors = tuple(Channel(j, "sensor") for j in range(self.robot.n))
        return replace(self, channels=sensors, found=None).torque(motion)

    def bodies(self) -> dict[str, float]:
        return {k: v for k, v in self.standard.items() if k.rstrip("0123456789") in INERTIAL}

    def drive_inertia(self, joint: int) -> float:
        return self.standard.get(f"Iam{joint + 1}", 0.0)

    def number(self, kind: str, joint: int) -> float | None:
        return self.standard.get(f"{kind}{joint + 1}")


def arm_model(sides: tuple[str, ...] = ("motor",), text: str = ARM, dry: bool = True) -> ArmModel:
    """The small arm measured on these sides; `dry` False: without dry friction, which jumps."""
    robot = parse_robot(text.encode(), "arm.yaml")
    kinds = {**DRIVE, **LINK}
    drives = {f"{k}{j}": v for j in range(1, robot.n + 1) for k, v in kinds.items() if dry or k[:2] != "Fc"}
    channels = tuple(Channel(j, side) for side in sides for j in range(robot.n))
    return ArmModel(robot, channels, {**bodies(robot), **drives})


def layout(model: ArmModel, recordings: tuple[str, ...] = ("run1",)) -> Layout:
    return Layout(model.robot, model.channels, recordings, (4.0,) * model.robot.n)


def motion(model: ArmModel, seconds: float = 6.0, rate: float = 500.0, seed: int = 1, pace: float = 1.0):
    """Sums of three sines a joint, exact in all derivatives, up to about 2 rad/s."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    n = model.robot.n
    amplitude, phase = rng.uniform(0.2, 0.5, (3, n)), rng.uniform(0, 6, (3, n))
    w = pace * (np.array([0.7, 1.7, 2.9])[:, None] + rng.uniform(-0.2, 0.2, (3, n)))
    angle = w[:, None] * t[:, None] + phase[:, None]
    q = np.sum(amplitude[:, None] * np.sin(angle), axis=0)
    dq = np.sum((amplitude * w)[:, None] * np.cos(angle), axis=0)
    ddq = -np.sum((amplitude * w**2)[:, None] * np.sin(angle), axis=0)
    return Motion("run1", None, t, q, dq, ddq, np.sign(dq), None, rate)


def values_of(
    e: Effect, context: Mapping[str, float] | None = None, /, **reported: float
) -> dict[str, float]:
    """Linear and nonlinear parameters of a usual case, or of these reported values."""
    linear, nonlinear = e.values_from_reported({**e.typical, **reported}, context or {})
    return {**linear, **nonlinear}


def simulated(
    model: ArmModel, m: Motion, e: Effect | None, place: Place, values: Mapping[str, float]
) -> Truth:
    """The truth of a recording whose motor follows `m`, played through all stages."""
    state, zero = (m.q, m.dq, m.ddq), np.zeros_like(m.q)
    sensors = replace(model, channels=tuple(Channel(j, "sensor") for j in range(model.robot.n)))
    drives = replace(model, channels=tuple(Channel(j, "drive") for j in range(model.robot.n)))

    def link(moved, dry):
        sign = np.sign(moved[1]) if dry else zero
        return sensors.torque(replace(m, q=moved[0], dq=moved[1], ddq=moved[2], sign_dq=sign))

    def drive(moved):
        return drives.torque(replace(m, q=moved[0], dq=moved[1], ddq=moved[2], sign_dq=np.sign(moved[1])))

    start = Truth(STAGES[0], model.robot, m.recording, m.t, state, state, zero, zero, {}, model.bodies())
    return played(start, [(e, place, values)] if e else [], link, drive)


def recorded(model: ArmModel, truth: Truth) -> np.ndarray:
    """(N, C) what the model's channels record."""
    parts = {**truth.torque, "drive": truth.torque["motor"] - truth.torque["sensor"]}
    return np.stack([parts[c.side][:, c.joint] for c in model.channels], axis=1)


def added(model: ArmModel, m: Motion, e: Effect, place: Place, values: Mapping[str, float]) -> np.ndarray:
    """(N, C) what the effect changes in the recorded torques."""
    return recorded(model, simulated(model, m, e, place, values)) - recorded(
        model, simulated(model, m, None, place, {})
    )


def contribution(
    e: Effect, place: Place, values: Mapping[str, float], m: Motion, model: ArmModel, memory=None
):
    """(N, C) columns @ size, at the effect's own size."""
    size = np.array([values[name] for name in e.parameters_of(place)])
    theta = {name: values[name] for name in e.nonlinear_names}
    columns = e.columns(place, theta, size, m, model, memory)
    out = np.zeros((len(m.t), len(model.channels)))
    for c, part in columns.items():
        out[:, c] = part @ size
    return out


def first_place(e: Effect, model: ArmModel, joint: int | None = 1, source: int | None = None) -> Place:
    """The first place of that joint."""
    return next(
        p for p in e.places(layout(model)) if p.joint == joint and (source is None or p.source == source)
    )


def check_report(name: str, context: Mapping[str, float] | None = None, rel: float = 0.15) -> None:
    """The told standard deviations are those of 400 draws with the covariance (3.5 % one sigma)."""
    e = effect(name)
    values = values_of(e, context)
    centre = np.array(list(values.values()))
    rng = np.random.default_rng(4)
    size = 1e-4 * np.maximum(np.abs(centre), 1e-3 * np.abs(centre).max())
    mix = rng.normal(size=(len(centre), len(centre))) * size[:, None]
    told = e.report(values, mix @ mix.T, context)
    draws = centre + rng.normal(size=(400, len(centre))) @ mix.T
    seen = [
        [q["value"] for q in e.report(dict(zip(values, x)), mix @ mix.T, context).values()] for x in draws
    ]
    for (key, value), spread in zip(told.items(), np.std(seen, axis=0)):
        assert abs(value["std"] - spread) <= rel * spread + 1e-15, key


def split_agrees(e: Effect, place: Place, values: Mapping[str, float], m: Motion, model: ArmModel) -> float:
    """Largest difference between columns of the whole stretch and of two blocks of it with one memory."""
    whole, memory = contribution(e, place, values, m, model, {}), {}
    k, parts = len(m.t) // 3, []
    for rows in (slice(0, k), slice(k, None)):
        arrays = {n: getattr(m, n)[rows] for n in ("t", "q", "dq", "ddq", "sign_dq")}
        parts.append(contribution(e, place, values, replace(m, **arrays), model, memory))
    return float(np.abs(np.concatenate(parts) - whole).max())


def as_recorded_by(e: Effect, model: ArmModel, m: Motion, place: Place, values: Mapping[str, float]):
    """(motion that the encoder records, torque recorded less the rigid model there)."""
    truth = simulated(model, m, e, place, values)
    q, dq, ddq = truth.motor
    if truth.encoder is not None and not np.array_equal(truth.encoder, q):
        q, dt = truth.encoder, m.t[1] - m.t[0]
        dq = np.gradient(q, dt, axis=0)
        ddq = np.gradient(dq, dt, axis=0)
    seen = replace(m, q=q, dq=dq, ddq=ddq, sign_dq=np.sign(dq))
    return seen, recorded(model, truth) - model.torque(seen)
