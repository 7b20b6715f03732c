"""What is known of a robot before it moves: its parameters, the noise of its torques, effects at usual sizes.

Parameters come from a file (those of `ident simulate`, or a fit.json), from the URDF, from the package; what
nobody states is that of a plausible robot of the same size, and `assumed` says so. Noise is told as a
standard deviation of each channel at ROWS_HZ independent rows a second, as of a signal filtered at 10 Hz.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

import generated
from ident.equations.terms import Term, torque_of
from ident.errors import IdentError
from ident.excitation.holding import Holding
from ident.excitation.limits import Bounds, ExcitationError
from ident.excitation.obstacles import KeepOut
from ident.excitation.self_collision import SelfCollision
from ident.twin.parameters import random_parameters, read_parameters, standard_name, twin_parameters
from ident.twin.requests import parse_effect
from ident.twin.twin import placed
from modelgen.effects.effect import Effect
from modelgen.effects.place import Layout, Motion, Place, torque_slopes
from modelgen.effects.scaling import metres_per_radian, radian_power
from modelgen.geometry.names import Channel
from modelgen.geometry.robot import Robot

Array = np.ndarray
ROWS_HZ = 20.0
NOISE_PERCENT = 1.0
FLOOR = 0.01  # N m
DRIVE = ("Ia", "Fv", "Fc", "Off")  # what the names of a drive's parameters begin with


@dataclass(frozen=True)
class Known:
    """A robot with numbers: `standard` parameters, and which model's channels are recorded.

    It answers what an effect may ask of a model (modelgen.effects.place.Model)."""

    robot: Robot
    source: str
    model: generated.Model
    standard: Mapping[str, float]
    assumed: str = ""  # what had to be assumed, in a clause
    exact: bool = False  # a URDF's numbers as they are written

    @cached_property
    def chi(self) -> Array:
        return self._chi(self.model)

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        return tuple(Channel.of(name, self.robot.joint_labels) for name in self.model.channels)

    @property
    def parameters(self) -> tuple[str, ...]:
        return self.model.parameters

    def torque(
        self, motion: Motion, q: Array | None = None, dq: Array | None = None, ddq: Array | None = None
    ) -> Array:
        states = [a if b is None else b for a, b in zip((motion.q, motion.dq, motion.ddq), (q, dq, ddq))]
        q, dq, ddq = states
        return self.model.torque(q, dq, ddq, self.chi, sign=motion.sign_dq)

    def slopes(self, motion: Motion, joint: int) -> Array:
        return torque_slopes(self.torque, motion, joint)

    def once(self, kind: tuple[Hashable, ...], motion: Motion, make: Callable[[], Array]) -> Array:
        return make()

    def total(self, motion: Motion) -> Array:
        return self.torque(motion)

    def link_torque(self, motion: Motion) -> Array:
        link = generated.load(self.source, "B", exact=self.exact)
        return link.torque(motion.q, motion.dq, motion.ddq, self._chi(link), sign=motion.sign_dq)

    def regressor(self, motion: Motion) -> Array:
        return self.model.regressor(motion.q, motion.dq, motion.ddq, sign=motion.sign_dq)

    def bodies(self) -> Mapping[str, float]:
        return {k: v for k, v in self.standard.items() if not k.startswith(DRIVE)}

    @property
    def of_bodies(self) -> Array:
        """(b,) whether a base parameter is named after one of a body: no friction, rotor or offset."""
        return np.array([not name.startswith(DRIVE) for name in self.parameters])

    def drive_inertia(self, joint: int) -> float:
        return self.number("Iam", joint) or 0.0

    def number(self, kind: str, joint: int) -> float | None:
        return self.standard.get(f"{kind}{self.robot.joint_labels[joint]}")

    def friction(self, place: Place) -> dict[str, float]:
        """{"Fc": ..., "Fv": ...} of the place's joint, both sides of the gear; 1 for none."""
        if place.joint is None:
            return {}
        j = place.joint
        return {k: sum(self.number(f"{k}{side}", j) or 0.0 for side in "ml") or 1.0 for k in ("Fc", "Fv")}

    def context(self, effect: Effect, place: Place) -> dict[str, float]:
        """What reported values of an effect are relative to."""
        gravity = zip(("g0x", "g0y", "g0z"), (float(self.robot.value(x)) for x in self.robot.gravity))
        known = {**self.friction(place), **dict(gravity)}
        return {name: known.get(name, 1.0) for name in effect.context}

    def _chi(self, model: generated.Model) -> Array:
        return model.regroup({k: v for k, v in self.standard.items() if k in model.standard_parameters})

    def holding(
        self, bounds: Bounds, keep_out: KeepOut | None = None, bodies: SelfCollision | None = None
    ) -> Holding:
        """Limits with the motor torques of these parameters, and what is in the way."""
        motor = generated.load(self.source, "A", exact=self.exact)
        joints = range(self.robot.n)
        dry = np.array([sum(abs(self.number(k, j) or 0.0) for k in ("Fcm", "Fcl")) for j in joints])
        return Holding(bounds, motor, self._chi(motor), dry, self.robot, keep_out, bodies)

    def sigma(self, motion: Motion, percent: Mapping[str, float] | float = NOISE_PERCENT) -> Array:
        """(C,) noise of each channel, N m: per cent of its rms torque over the motion; measured, or assumed
        and then at least FLOOR."""
        rms = np.sqrt(np.mean(self.torque(motion) ** 2, axis=0))
        measured = percent if isinstance(percent, Mapping) else {}
        usual = NOISE_PERCENT if isinstance(percent, Mapping) else percent
        share = np.array([measured.get(name, usual) for name in self.model.channels]) / 100
        least = np.array([1e-9 if name in measured else FLOOR for name in self.model.channels])
        return np.maximum(share * rms, least)


def known_robot(
    robot: Robot, source: str, model: str = "A", parameters: Path | None = None, exact: bool = False
) -> Known:
    """Raises IdentError where the file of parameters cannot be used."""
    found = generated.load(source, model, exact=exact)
    if parameters is not None:
        return Known(robot, source, found, _from_file(parameters, robot), exact=exact)
    usual = twin_parameters(robot, None, 0)
    if usual.source != "random":
        return Known(robot, source, found, usual.standard, exact=exact)
    if found.standard_values:
        rest = random_parameters(robot, np.random.default_rng([0, 77])).standard
        drive = {k: v for k, v in rest.items() if k.startswith(DRIVE)}
        told = "friction and rotors are those of a plausible robot of this size"
        return Known(robot, source, found, {**drive, **found.standard_values}, told, exact)
    told = "masses, friction and rotors are those of a plausible robot of this size"
    return Known(robot, source, found, usual.standard, told, exact)


def _from_file(file: Path, robot: Robot) -> Mapping[str, float]:
    file = file / "fit.json" if file.is_dir() else file
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise ExcitationError(f"{file}: cannot be read; give a file of parameters or a fit.json.") from None
    if file.suffix == ".json":
        try:
            numbers = {row["name"]: float(row["value"]) for row in json.loads(text)["parameters"]}
        except (ValueError, KeyError, TypeError):
            raise ExcitationError(f"{file}: is no fit.json; give one that ident fit wrote.") from None
        return standard_of(numbers, robot, str(file))
    return read_parameters(text, robot, str(file)).standard


def standard_of(numbers: Mapping[str, float], robot: Robot, source: str = "a fit") -> Mapping[str, float]:
    """Standard parameters of a fit's base parameters; those of effects and payloads are left out."""
    lines = (
        f"{name}: {value!r}\n" for name, value in numbers.items() if standard_name(name, robot) is not None
    )
    return read_parameters("".join(lines), robot, source).standard


def as_motion(states: Sequence[Array], t: Array, turn_over: Array | None = None) -> Motion:
    """Planned states (q, dq, ddq) as effects take them; turn_over (n,): of a smooth sign of the rates."""
    q, dq, ddq = states[:3]
    sign = np.sign(dq) if turn_over is None else np.tanh(dq / turn_over)
    rate = 1.0 / (t[1] - t[0])
    return Motion("", None, t, q, dq, ddq, sign, None, float(rate))


def term_of(known: Known, text: str, bounds: Bounds, motion: Motion, option: str = "--separate") -> Term:
    """NAME:JOINT[:param=value,...] at usual values, as large as the effect's share of the joint's torque.

    Raises IdentError for what is no effect, or what the recorded torques do not show.
    """
    try:
        request = parse_effect(text, known.robot)
        place = placed(request, known.robot, known.model.model)
    except IdentError as error:
        raise ExcitationError(
            str(error).replace("--effect", option).replace("--model", "--model of excite,")
        ) from None
    with np.errstate(all="ignore"):  # what comes of a value that divides by zero is looked at by who asks
        return usual_term(known, request.effect, place, bounds, motion, request.values)


def sized(known: Known, text: str) -> bool:
    """Whether a request states the size of its effect."""
    request = parse_effect(text, known.robot)
    return bool(set(request.values) & {*request.effect.size_names, *request.effect.size_aliases})


def usual_term(
    known: Known,
    effect: Effect,
    place: Place,
    bounds: Bounds,
    motion: Motion,
    given: Mapping[str, float] | None = None,
) -> Term:
    """A term at a place with given reported values, usual ones for the rest."""
    given = given or {}
    layout = Layout(known.robot, known.channels, travel=tuple((2 * bounds.half).tolist()))
    place = layout.with_travel(place)
    own = known.friction(place)
    context = known.context(effect, place)
    values, scale = effect.usual(given, own), metres_per_radian(place)
    for quantity in effect.quantities:
        if quantity.name in values and quantity.name not in given and not quantity.angle:
            values[quantity.name] *= scale ** radian_power(quantity.unit)
    linear, theta = effect.values_from_reported(values, context)
    used = effect.parameters_of(place) or tuple(name for name in effect.linear_names if linear[name])
    place = replace(place, parts=used)
    size = tuple(linear[name] for name in used)
    label = ":".join(
        [effect.name, *(known.robot.joint_labels[j] for j in (place.joint, place.source) if j is not None)]
    )
    term = Term(label, effect, place, theta, size, effect.nonlinear_names, {}, effect.bounds(place))
    if set(given) & {*effect.size_names, *effect.size_aliases} or not effect.proportional:
        return term
    added = torque_of(term, motion, known, {})  # type: ignore[arg-type]
    rms = np.sqrt(np.mean(known.torque(motion) ** 2, axis=0))
    share = float(np.max(np.sqrt(np.mean(added**2, axis=0)) / np.maximum(rms, FLOOR)))
    return replace(term, size=tuple(s * effect.share / share for s in size)) if share > 0 else term
