"""The digital twin: true torques of a robot that moves, with the effects it hides.

The gear's output follows the planned motion g(t). From there, joint by joint:

    link      q_l = g + deflection of a backlash                            (what the inertia follows)
    tau_link  = M(q_l) ddq_l + H(q_l, dq_l) + tau_fl + link effects           eq. (2), what a sensor sees
    motor     q_m = g + tau_link / k where the joint is elastic              (what the encoder records)
    tau_motor = tau_link + Iam ddq_m + tau_fm(dq_m) + motor effects          eq. (1), (4)

An elastic joint is so solved exactly and without iteration: the motion of the link is given and that of the
motor follows (the robot is differentially flat in its link positions). The torque in q_m is taken through a
Gaussian of 6 ms and without the link side's Coulomb step, which a damped gear would not pass on either.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

import generated
from ident.errors import IdentError
from ident.simulate.requests import EffectRequest
from ident.simulate.sensors import delayed, smooth
from ident.simulate.trajectories import State
from modelgen.effects.loads import force_columns, gate, tilt_torque
from modelgen.effects.motions import derivatives
from modelgen.geometry.robot import Robot

Array = np.ndarray
GEAR_S = 0.006  # s, see above
PAYLOAD = "L"


class SimulationError(IdentError):
    """The twin cannot do what was asked."""


@dataclass(frozen=True)
class ActiveEffect:
    """A request with all its numbers: linear and nonlinear parameters as the catalogue defines them."""

    request: EffectRequest
    linear: Mapping[str, float]
    nonlinear: Mapping[str, float]
    reported: Mapping[str, float]  # what a diagnosis ought to find
    visible: float = float("nan")  # rms share of the joint's torque that the study's model cannot absorb

    @property
    def name(self) -> str:
        return self.request.effect.name

    def acts_in(self, recording: str) -> bool:
        return self.request.recording in (None, recording)


@dataclass(frozen=True)
class Twin:
    """A robot with its standard parameters, ready to be moved."""

    robot: Robot
    source: str  # what `generated.load` takes
    standard: Mapping[str, float]
    link: generated.Model = field(repr=False)  # model B with the payload's ten columns
    drive: generated.Model = field(repr=False)  # model D

    @property
    def n(self) -> int:
        return self.robot.n


@dataclass(frozen=True, slots=True)
class TrueRun:
    """What happens in one recording, before any sensor: arrays (N, n)."""

    t: Array
    q: Array  # of the motor, joint side
    q_link: Array
    tau_m: Array
    tau_l: Array


def make_twin(robot: Robot, source: str, standard: Mapping[str, float]) -> Twin:
    """Load the link-side and drive models. Raises GeneratedError where a model cannot be derived."""
    return Twin(
        robot=robot,
        source=source,
        standard=standard,
        link=generated.load(source, "B", payload=PAYLOAD),
        drive=generated.load(source, "D"),
    )


def run_twin(
    twin: Twin,
    t: Array,
    motion: State,
    effects: tuple[ActiveEffect, ...] = (),
    payload: Mapping[str, float] | None = None,
    model: str = "A",
    recording: str = "",
) -> TrueRun:
    """Move the twin along `motion` (q, dq, ddq at uniform instants t) and give its true torques.

    `payload` holds ten parameters under bare names (M, MX, ...). `model` is that of the study, which decides
    where an effect of "any" channel shows. Effects bound to another recording do nothing.
    """
    effects = tuple(e for e in effects if e.acts_in(recording))
    dt = float(t[1] - t[0])
    carried = _chi(twin.link, twin.standard, payload)
    link_state = _behind_backlash(motion, effects, dt)
    tau_link = twin.link.torque(*link_state, carried)
    extra = _link_effects(twin, t, link_state, tau_link, effects, payload or {})
    for e in effects:
        if terms := e.request.effect.torque_terms:  # what an open gap does not pass on
            extra[:, e.request.joint] += _column_torque(e, t, motion, tau_link + extra, terms)
    tau_link += extra
    motor_state = motion
    elastic = [e for e in effects if e.name == "joint_elasticity"]
    if elastic:
        passed = twin.link.torque(*link_state, carried, sign=np.zeros_like(motion[0])) + extra
        motor_state = _before_elasticity(motion, passed, elastic, dt)
    drive = _chi(twin.drive, twin.standard, None)
    tau_motor = tau_link + twin.drive.torque(*motor_state, drive)
    for e in effects:
        if e.request.effect.kind == "column" and channels_of(e.request, model) == ("tau_m",):
            tau_motor[:, e.request.joint] += _column_torque(e, t, motor_state, tau_link)
    tau = {"tau_m": tau_motor, "tau_l": tau_link.copy()}
    for e in effects:
        if e.request.effect.kind == "column" and channels_of(e.request, model) == ("tau_l",):
            tau["tau_l"][:, e.request.joint] += _column_torque(e, t, link_state, tau_link)
    tau = _measurement_effects(tau, t, effects, model)
    return TrueRun(t, motor_state[0], link_state[0], tau["tau_m"], tau["tau_l"])


def channels_of(request: EffectRequest, model: str) -> tuple[str, ...]:
    """Measured channels that carry an effect in a study of `model`.

    A motor effect shows in tau_m alone; where only the sensor is recorded (B) it stands for the same thing on
    the link side. Raises SimulationError for an effect that the model's channels cannot show.
    """
    effect = request.effect
    if effect.channel == "link":
        if model == "D":
            raise SimulationError(
                f"{effect.name} acts beyond the gear, where model D (tau_m - tau_l) is blind; use A, B or C."
            )
        return ("tau_m", "tau_l")
    if effect.channel == "sensor":
        if model == "A":
            raise SimulationError(
                f"{effect.name} is of a joint torque sensor, and model A records none; use --model B, C or D."
            )
        return ("tau_l",)
    if effect.shared and request.joint is None:
        return ("tau_m", "tau_l")
    return ("tau_l",) if model == "B" else ("tau_m",)


def _chi(model: generated.Model, standard: Mapping[str, float], payload: Mapping[str, float] | None) -> Array:
    known = set(model.standard_parameters)
    values = {name: value for name, value in standard.items() if name in known}
    if payload:
        values |= {f"{name}{PAYLOAD}": value for name, value in payload.items()}
    return model.regroup(values)


def _behind_backlash(motion: State, effects: tuple[ActiveEffect, ...], dt: float) -> State:
    state = motion
    for e in effects:
        if e.name != "backlash":
            continue
        signals = {"q": motion[0][:, e.request.joint], "tau_link": np.zeros(len(motion[0]))}
        lag = e.request.effect.numpy_columns(signals, e.nonlinear)[:, 0] * e.linear["gap"]
        state = _moved(state, e.request.joint, smooth(lag, dt, GEAR_S), dt)
    return state


def _before_elasticity(motion: State, passed: Array, elastic: list[ActiveEffect], dt: float) -> State:
    state = motion
    for e in elastic:
        j = e.request.joint
        wind_up = smooth(passed[:, j], dt, GEAR_S) * e.linear["compliance"]
        state = _moved(state, j, wind_up, dt)
    return state


def _moved(state: State, joint: int | None, by: Array, dt: float) -> State:
    assert joint is not None
    q, dq, ddq = (part.copy() for part in state)
    rate, acceleration = derivatives(by, dt)
    q[:, joint] += by
    dq[:, joint] += rate
    ddq[:, joint] += acceleration
    return q, dq, ddq


def _column_torque(
    e: ActiveEffect, t: Array, state: State, tau_link: Array, terms: tuple[str, ...] | None = None
) -> Array:
    """(N,) torque that a column effect adds to its joint; of some of its terms where they are named."""
    q, dq, ddq = state
    j, source = e.request.joint, e.request.source_joint
    signals = {"t": t - t[0], "q": q[:, j], "dq": dq[:, j], "ddq": ddq[:, j], "tau_link": tau_link[:, j]}
    if source is not None:
        signals |= {"dq_source": dq[:, source], "ddq_source": ddq[:, source]}
    columns = e.request.effect.numpy_columns(signals, e.nonlinear)
    names = e.request.effect.linear_names
    return columns @ np.array([e.linear[name] * (terms is None or name in terms) for name in names])


def _link_effects(
    twin: Twin,
    t: Array,
    state: State,
    tau_link: Array,
    effects: tuple[ActiveEffect, ...],
    payload: Mapping[str, float],
) -> Array:
    """(N, n) torques of effects beyond the gear: springs, loads, contacts, tilted gravity, open gaps."""
    row = twin.robot.payload_link(PAYLOAD)
    heavy = dict(twin.standard)
    for name in ("M", "MX", "MY", "MZ"):
        heavy[f"{name}{row}"] = heavy.get(f"{name}{row}", 0.0) + payload.get(name, 0.0)
    extra = np.zeros((len(t), twin.n))
    for e in effects:
        effect, request = e.request.effect, e.request
        inside = gate(t - t[0], request.start, request.stop)[:, None]
        if effect.kind == "column" and effect.channel == "link":
            extra[:, request.joint] += _column_torque(e, t, state, tau_link)
        elif effect.name == "payload_change":
            chi = _chi(twin.link, {}, e.linear)
            extra += inside * twin.link.torque(*state, chi)
        elif effect.name == "external_force":
            wrench = np.array([e.linear[name] for name in ("FX", "FY", "FZ", "NX", "NY", "NZ")])
            point = (e.nonlinear["px"], e.nonlinear["py"], e.nonlinear["pz"])
            extra += inside * (force_columns(twin.robot, state[0], point=point) @ wrench)
        elif effect.name == "base_tilt":
            extra += tilt_torque(twin.robot, state[0], heavy, e.linear["roll"], e.linear["pitch"])
    return extra


def _measurement_effects(
    tau: dict[str, Array], t: Array, effects: tuple[ActiveEffect, ...], model: str
) -> dict[str, Array]:
    """What the recorder does to the true torques: crosstalk, then gains, then delay."""
    true = {name: value.copy() for name, value in tau.items()}
    for e in effects:
        if e.name == "sensor_crosstalk":
            assert e.request.source_joint is not None
            tau["tau_l"][:, e.request.joint] += e.linear["gain"] * true["tau_l"][:, e.request.source_joint]
    for e in effects:
        if e.name == "drive_gain_error":
            for channel in channels_of(e.request, model):
                tau[channel][:, e.request.joint] *= 1.0 + e.linear["excess"]
    for e in effects:
        if e.name == "time_delay":
            lag = np.zeros(next(iter(tau.values())).shape[1])
            lag[slice(None) if e.request.joint is None else e.request.joint] = e.linear["delay"]
            for channel in channels_of(e.request, model):
                tau[channel] = delayed(tau[channel], t, lag)
    return tau
