"""A mass that the study does not declare: in one run, or from a moment on, in the gripper or on any link."""

from collections.abc import Iterable, Mapping

import numpy as np
import sympy as sp

from modelgen.effects.effect import SIGNALS, Array, LinearParameter, Quantity
from modelgen.effects.kinds import LoadEffect
from modelgen.effects.loads import arm_length, body_columns, independent, some_motion
from modelgen.effects.place import Layout, Model, Motion, Place
from modelgen.effects.truth import Truth
from modelgen.geometry.robot import Robot

M, MX, MY, MZ = sp.symbols("M MX MY MZ", real=True)
m, mx, my, mz = sp.symbols("m mx my mz", real=True)
REACH = 1.0  # m from a link's frame to the centre of what it carries, where the arm is shorter
RADIUS = sp.Rational(6, 100)  # m, of the solid ball that a simulated payload is
ball = sp.Rational(2, 5) * m * RADIUS**2

WEIGHT = ("M", "MX", "MY", "MZ")
INERTIA = ("XX", "XY", "XZ", "YY", "YZ", "ZZ")


class PayloadChange(LoadEffect):
    """A body fixed to a link, with the columns of the link's own inertial parameters.

    On a link whose motion is poor (the first ones of an arm) some of the ten columns are combinations of
    others: `places` then asks only for independent ones, and a parameter is told only where its column is no
    combination of the other nine. A mass that the motion cannot show gets no number.
    """

    name = "payload_change"
    summary = "a body fixed to a link is carried that the study does not declare"
    signature = "all joints at once, as a payload's columns, inside one recording or from one moment on"
    source = (
        "Khalil, Gautier, Lemoine, Identification of the payload inertial parameters of industrial "
        "manipulators, ICRA 2007"
    )
    agreement = "the centre of mass has to be within the arm's length of the link's frame"
    equation = "tau += columns of a body (M, MX .. ZZ) on a link, from a moment on or in a recording"
    remedy = "declare the load: `payload: LABEL` in the recordings that carry it"
    terms = dict.fromkeys((*WEIGHT, *INERTIA), SIGNALS.gate)
    linear = (
        LinearParameter("M", "kg", 0.0, 500.0, "positive"),
        *(LinearParameter(name, "kg m", -200.0, 200.0) for name in ("MX", "MY", "MZ")),
        *(
            LinearParameter(name, "kg m^2", -100.0, 100.0, optional=True)
            for name in ("XX", "XY", "XZ", "YY", "YZ", "ZZ")
        ),
    )
    reported = (
        Quantity("m", "kg", M),
        Quantity("mx", "kg m", MX),
        Quantity("my", "kg m", MY),
        Quantity("mz", "kg m", MZ),
    )
    inverse = {
        "M": m,
        "MX": mx,
        "MY": my,
        "MZ": mz,
        "XX": (my**2 + mz**2) / m + ball,
        "YY": (mx**2 + mz**2) / m + ball,
        "ZZ": (mx**2 + my**2) / m + ball,
        "XY": -mx * my / m,
        "XZ": -mx * mz / m,
        "YZ": -my * mz / m,
    }
    windowed = True
    on_link = True
    sizes = ("m", "mx", "my", "mz")
    typical = {"m": 1.5, "mx": 0.03, "my": -0.02, "mz": 0.12}
    window = (0.4, None)  # of the recording, where a simulator puts it

    def places(self, layout: Layout) -> Iterable[Place]:
        """Each recording and each body that moves, the outermost first; of bodies fixed together, one."""
        if not layout.sides & {"motor", "sensor"}:
            return
        robot = layout.robot
        rows, outer = [], robot.payload_link("L")
        taken = set()
        for row in [outer, *(j for j in reversed(range(1, len(robot.links) + 1)) if j != outer)]:
            body = _moving(robot, row)
            if body and body not in taken:
                taken.add(body)
                rows.append(row)
        for row in rows:
            shown, full = visible(robot, row)
            light = WEIGHT if set(WEIGHT) <= set(shown) else tuple(k for k in WEIGHT if k in full)
            for parts in (
                dict.fromkeys((light, full)) if light else (full,)
            ):  # what it weighs with, and all of it
                for recording in layout.recordings if full else ():
                    yield layout.place(side="link", recording=recording, link=row, parts=parts)

    def physical(self, values: Mapping[str, float], model: Model | None = None) -> str | None:
        """Nor does a mass that a fit holds at zero, while other things of the body are not, belong to one.
        (Of a clean arm in a random walk of its torque a body of 0.000 +- 0.016 kg was told.)"""
        if values.get("M", 1.0) == 0.0 and any(values.values()):
            return "a body has a mass"
        return super().physical(values, model)

    def beyond(self, values: Mapping[str, float], covariance: Array, place: Place, robot: Robot) -> float:
        """A first moment is a mass times where its centre is, which is no further from the link's frame than
        the arm is long, nor than a metre: f . u <= R m, f the first moments that the motion shows, u where it
        shows them best. Where it does not show the mass nothing is asked. (A UR10e whose third joint counted
        from another zero in one run was told to carry 0.000 kg with 0.395 kg m. Inertias are not asked: of
        what gives way less of them shows.)"""
        names = self.parameters_of(place)
        row = place.link or robot.payload_link("L")
        told = [k for k in WEIGHT[1:] if k in values and k in visible(robot, row)[0]]
        if "M" not in values or not told:
            return 0.0
        f = np.array([values[k] for k in told])
        at, mass = [names.index(k) for k in told], names.index("M")
        along = np.linalg.lstsq(covariance[np.ix_(at, at)], f, rcond=1e-12)[0]
        along /= max(float(np.linalg.norm(along)), 1e-300)
        reach = max(REACH, arm_length(robot))
        over = np.zeros(len(names))
        over[at], over[mass] = along, -reach
        deviation = float(np.sqrt(max(over @ covariance @ over, 1e-300)))
        return max(0.0, (float(along @ f) - reach * values["M"]) / deviation)

    def joint_columns(self, place: Place, theta: Mapping[str, float], motion: Motion, model: Model) -> Array:
        row = place.link or model.robot.payload_link("L")
        return body_columns(model.robot, motion.q, motion.dq, motion.ddq, row, self.parameters_of(place))

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        row = place.link or truth.robot.payload_link("L")
        kinds = (*WEIGHT, *INERTIA)
        columns = body_columns(truth.robot, *truth.link, row, kinds)
        gate = place.gate(truth.recording, truth.t - truth.t[0])[:, None]
        return truth.with_torque(place, gate * (columns @ np.array([values.get(k, 0.0) for k in kinds])))

    def usual(self, given: Mapping[str, float], own: Mapping[str, float]) -> dict[str, float]:
        """`m` alone lies at the usual place."""
        values = super().usual(given, own)
        if "m" in given:
            scale = given["m"] / self.typical["m"]
            values |= {k: self.typical[k] * scale for k in ("mx", "my", "mz") if k not in given}
        return values


def _moving(robot: Robot, row: int) -> int:
    """The moving row that a body on `row` is fixed to; 0: the base."""
    while row and robot.link(row).sigma == 2:
        row = robot.link(row).antecedent
    return row


def visible(robot: Robot, row: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """(parameters of a body on `row` whose columns are no combination of the other nine, an independent set
    that spans all ten: these first, then inertias)."""
    kinds = (*WEIGHT, *INERTIA)
    columns = body_columns(robot, *some_motion(robot), row, kinds)
    W = columns.reshape(-1, len(kinds))
    shown = [
        k for k in range(len(kinds)) if 9 in independent(W[:, [*(i for i in range(len(kinds)) if i != k), k]])
    ]
    order = [*shown, *(k for k in (4, 5, 6, 7, 8, 9, 1, 2, 3, 0) if k not in shown)]
    kept = [order[i] for i in independent(W[:, order])]
    return tuple(kinds[k] for k in shown), tuple(kinds[k] for k in sorted(kept))


EFFECT = PayloadChange()
