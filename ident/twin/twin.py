"""The digital twin: true torques of a robot that moves, with the effects it hides.

The gear's output follows the planned motion g(t). From there, joint by joint (modelgen.effects.truth):

    link      q_l = g + what leaves it, as free play                        (what the inertia follows)
    tau_link  = M(q_l) ddq_l + H(q_l, dq_l) + tau_fl + link effects           eq. (2), what a sensor sees
    motor     q_m = g + tau_link / k where the joint is elastic              (what the encoder records)
    tau_motor = tau_link + Iam ddq_m + tau_fm(dq_m) + motor effects          eq. (1), (4)

An elastic joint is so solved exactly and without iteration: the motion of the link is given and that of the
motor follows (the robot is differentially flat in its link positions). The torque in q_m is taken through a
Gaussian of 6 ms and without the link side's Coulomb step, which a damped gear would not pass on either.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

import generated
from ident.errors import IdentError
from ident.twin.requests import EffectRequest
from ident.twin.trajectories import State
from modelgen.dynamics.models import MODELS
from modelgen.effects.place import Layout, Place
from modelgen.effects.truth import STAGES, Truth, played
from modelgen.geometry.names import Channel
from modelgen.geometry.robot import Robot

Array = np.ndarray
PAYLOAD = "L"


class SimulationError(IdentError):
    """The twin cannot do what was asked."""


@dataclass(frozen=True)
class ActiveEffect:
    """A request with all its numbers: linear and nonlinear parameters as the catalogue defines them."""

    request: EffectRequest
    place: Place
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
    exact: bool = False  # a URDF's numbers as they are written

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


def make_twin(robot: Robot, source: str, standard: Mapping[str, float], exact: bool = False) -> Twin:
    """Load the link-side and drive models. Raises GeneratedError where a model cannot be derived."""
    return Twin(
        robot=robot,
        source=source,
        standard=standard,
        link=generated.load(source, "B", payload=PAYLOAD, exact=exact),
        drive=generated.load(source, "D", exact=exact),
        exact=exact,
    )


def run_twin(
    twin: Twin,
    t: Array,
    motion: State,
    effects: tuple[ActiveEffect, ...] = (),
    payload: Mapping[str, float] | None = None,
    recording: str = "",
) -> TrueRun:
    """Move the twin along `motion` (q, dq, ddq at uniform instants t) and give its true torques.

    `payload`: ten parameters under bare names (M, MX, ...). Effects bound to another recording do nothing.
    """
    nothing = np.zeros_like(motion[0])
    row, heavy = twin.robot.payload_link(PAYLOAD), dict(twin.standard)
    for name, value in (payload or {}).items():
        heavy[f"{name}{row}"] = heavy.get(f"{name}{row}", 0.0) + value
    carried, drive = _chi(twin.link, twin.standard, payload), _chi(twin.drive, twin.standard, None)
    truth = played(
        Truth(STAGES[0], twin.robot, recording, t, motion, motion, nothing, nothing, {}, heavy),
        [(e.request.effect, e.place, {**e.linear, **e.nonlinear}) for e in effects],
        lambda link, dry: twin.link.torque(*link, carried, sign=None if dry else nothing),
        lambda motor: twin.drive.torque(*motor, drive),
    )
    assert truth.encoder is not None
    return TrueRun(t, truth.encoder, truth.link[0], truth.torque["motor"], truth.torque["sensor"])


def placed(request: EffectRequest, robot: Robot, model: str) -> Place:
    """Where a requested effect stands in a study of `model`: the first of its places on that joint.

    Raises SimulationError for an effect that the model's channels cannot show.
    """
    place = _first_place(request, _layout(robot, model))
    if place is None:
        others = [name for name in MODELS if _first_place(request, _layout(robot, name)) is not None]
        raise SimulationError(
            f"{request.effect.name} does not show in the torques of model {model}; "
            f"use --model {' or '.join(others)}."
        )
    return replace(place, recording=request.recording, start=request.start, stop=request.stop)


def _layout(robot: Robot, model: str) -> Layout:
    names = MODELS[model].channels(robot)
    return Layout(robot, tuple(Channel.of(name, robot.joint_labels) for name in names), ("",))


def _first_place(request: EffectRequest, layout: Layout) -> Place | None:
    for place in request.effect.places(layout):
        if (place.joint, place.source) == (request.joint, request.source_joint):
            return replace(place, link=request.link, parts=())
    return None


def _chi(model: generated.Model, standard: Mapping[str, float], payload: Mapping[str, float] | None) -> Array:
    known = set(model.standard_parameters)
    values = {name: value for name, value in standard.items() if name in known}
    if payload:
        values |= {f"{name}{PAYLOAD}": value for name, value in payload.items()}
    return model.regroup(values)
