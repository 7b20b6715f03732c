"""A base that is not level, or hangs, or stands at a wall: gravity is not where the robot file says."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import sympy as sp

from modelgen.effects.effect import Array, NonlinearParameter, Quantity, Report
from modelgen.effects.gravity_search import directions, newly_visible
from modelgen.effects.kinds import LoadEffect
from modelgen.effects.loads import gravity_columns, tilt_of, tilt_torque, tilted, unit_weights, weights
from modelgen.effects.place import Layout, Model, Motion, Place
from modelgen.effects.truth import Truth
from modelgen.geometry.names import GRAVITY, ParameterName
from modelgen.geometry.robot import Robot

roll, pitch, g0x, g0y, g0z = sp.symbols("roll pitch g0x g0y g0z", real=True)
QUARTERS = (-np.pi / 2, 0.0, np.pi / 2, np.pi)
NEAR = 2e-3  # rad, where torques are linear in the angles
AROUND = ((1, 0), (0, 1), (1, 1), (1, -1))  # of roll and pitch; the other way round is a negative size


def _turned() -> tuple[sp.Expr, ...]:
    """Gravity in base axes, for a file whose gravity is along z: (Ry(pitch) Rx(roll))^T g."""
    Rx = sp.Matrix([[1, 0, 0], [0, sp.cos(roll), -sp.sin(roll)], [0, sp.sin(roll), sp.cos(roll)]])
    Ry = sp.Matrix([[sp.cos(pitch), 0, sp.sin(pitch)], [0, 1, 0], [-sp.sin(pitch), 0, sp.cos(pitch)]])
    return tuple((Ry * Rx).T * sp.Matrix([g0x, g0y, g0z]))


class BaseTilt(LoadEffect):
    """Gravity has another direction in the base's axes, by any angle.

    A gravity torque is linear in gravity and in the bodies, so a turned one changes the model's own columns:
    `regressor_change`, exact for any angle and linear in chi. Only `columns` of first moments that the file's
    gravity did not show (of link 1 of an upright arm) are new. `starts` finds the direction in the measured
    torque itself: small angles from a wrong gravity do not reach a quarter turn. The base stands at
    Ry(pitch) Rx(roll) from where the file has it (of a file whose gravity is not
    along z: about the axes of `loads.across`).
    """

    name = "base_tilt"
    summary = "the base is rolled and pitched, so gravity is not where the robot file puts it"
    signature = "gravity torques of the first joints: joint 1 of an upright arm carries sin and cos of q1"
    told_by = ("base_orientation",)  # checks of a recording that are this effect
    source = "gravity is an acceleration of the base: Luh, Walker, Paul, J. Dyn. Sys. Meas. Control 102, 1980"
    equation = "gravity = (Ry(pitch) Rx(roll))^T gravity of the robot file"
    remedy = "give the study the gravity that was found, `gravity: [gx, gy, gz]`, or level the base"
    nonlinear = (
        NonlinearParameter("roll", "rad", -np.pi, np.pi, QUARTERS, angle=True),
        NonlinearParameter("pitch", "rad", -np.pi, np.pi, QUARTERS, angle=True),
    )
    context = ("g0x", "g0y", "g0z")
    reported = (
        Quantity("roll", "rad", roll, angle=True),
        Quantity("pitch", "rad", pitch, angle=True),
        *(Quantity(f"g{axis}", "m/s^2", turned) for axis, turned in zip("xyz", _turned())),
    )
    sizes = ("roll", "pitch")
    proportional = False
    typical = {"roll": 0.03, "pitch": -0.04}
    changes_model = True

    def places(self, layout: Layout) -> Iterable[Place]:
        falls = file_gravity(layout.robot).any()  # without gravity none is turned
        if falls and layout.sides & {"motor", "sensor"}:
            yield layout.place(side="link", parts=newly_visible(layout.robot))

    def parameters_of(self, place: Place) -> tuple[str, ...]:
        return place.parts

    def starts(
        self,
        place: Place,
        motions: Sequence[Motion],
        residuals: Sequence[Array],
        model: Model | None = None,
    ) -> Sequence[dict[str, float]]:
        """The directions of gravity that explain the measured torque best, and small angles: noise turns that
        search by more than a base is off that is nearly level (of 2.7 mrad it told 19). Quarter turns where
        no torque is known."""
        if model is None or any(m.measured is None for m in motions):
            return super().starts(place, motions, residuals)
        file = file_gravity(model.robot)
        found = directions(model.robot, model.channels, motions, float(np.linalg.norm(file)))
        near = [(NEAR * float(a), NEAR * float(b)) for a, b in AROUND]
        angles = [*(tilt_of(file, g) for g in found), *near]
        return [{"roll": float(a), "pitch": float(b)} for a, b in angles]

    def joint_columns(self, place: Place, theta: Mapping[str, float], motion: Motion, model: Model) -> Array:
        """First moments that the turned gravity shows and the file's did not."""
        g = tilted(file_gravity(model.robot), theta["roll"], theta["pitch"])
        kind = ("unit weights", *place.parts)
        return model.once(kind, motion, lambda: unit_weights(model.robot, motion.q, place.parts)) @ g

    def regressor_change(
        self, place: Place, theta: Mapping[str, float], motion: Motion, model: Model
    ) -> dict[int, Array]:
        """Gravity's part of each first moment and mass, under the change of gravity."""
        file = file_gravity(model.robot)
        change = tilted(file, theta["roll"], theta["pitch"]) - file
        bodies = _weights(model, motion)
        columns = gravity_columns(model.robot, motion.q, change, tuple(bodies.values()))
        seen = np.array([c.side != "drive" for c in model.channels], dtype=float)
        joint = [c.joint for c in model.channels]
        return {number: columns[:, joint, k] * seen for k, number in enumerate(bodies)}

    def torque_change(
        self, place: Place, theta: Mapping[str, float], motion: Motion, model: Model, chi: Array
    ) -> Array:
        """All bodies' weights at once, under the change of gravity."""
        file = file_gravity(model.robot)
        standard: dict[str, float] = {}
        for number, name in _weights(model, motion).items():
            standard[name] = standard.get(name, 0.0) + float(chi[number])
        change = tilted(file, theta["roll"], theta["pitch"]) - file
        kind = ("weights", *standard.items())
        torque = model.once(kind, motion, lambda: weights(model.robot, motion.q, standard)) @ change
        seen = np.array([c.side != "drive" for c in model.channels], dtype=float)
        return torque[:, [c.joint for c in model.channels]] * seen

    def context_of(self, place: Place, model: Model) -> dict[str, float]:
        """The file's gravity."""
        return dict(zip(self.context, file_gravity(model.robot).tolist()))

    def report(
        self,
        values: Mapping[str, float],
        covariance: Array | None = None,
        context: Mapping[str, float] | None = None,
        place: Place | None = None,
    ) -> Report:
        """roll, pitch and the gravity to paste, of a file whose gravity has any direction."""
        told = super().report(values, covariance, context, place)
        C = None if covariance is None else np.asarray(covariance)[:2, :2]  # of the angles
        file = np.array([(context or {})[name] for name in self.context])
        angles, h = np.array([values["roll"], values["pitch"]]), 1e-6
        J = np.stack(
            [(tilted(file, *(angles + d)) - tilted(file, *(angles - d))) / (2 * h) for d in h * np.eye(2)],
            axis=1,
        )
        std = np.zeros(3) if C is None else np.sqrt(np.maximum(np.diag(J @ C @ J.T), 0.0))
        for name, value, spread in zip(("gx", "gy", "gz"), tilted(file, *angles), std):
            told[name] = {"value": float(value), "std": float(spread), "unit": "m/s^2"}
        return told

    def remedy_with(self, values: Mapping[str, float]) -> str:
        g = ", ".join(f"{values[name]:.4g}" for name in ("gx", "gy", "gz"))
        return self.remedy.replace("gx, gy, gz", g)

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        held = tilt_torque(truth.robot, truth.link[0], truth.standard, values["roll"], values["pitch"])
        return truth.with_torque(place, held)


def _weights(model: Model, motion: Motion) -> dict[int, str]:
    """{parameter number: "MX3"} of first moments and masses, a payload's under the row that carries it."""
    out = {}
    for number, name in enumerate(model.parameters):
        read = ParameterName.of(name)
        if read is None or read.kind not in GRAVITY or (read.payload and read.label != motion.payload):
            continue
        out[number] = read.kind + (str(model.robot.payload_link(read.label)) if read.payload else read.label)
    return out


def file_gravity(robot: Robot) -> Array:
    """(3,) m/s^2, base axes."""
    return np.array([float(robot.value(x)) for x in robot.gravity])


EFFECT = BaseTilt()
