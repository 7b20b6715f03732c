"""A contact: somebody leans on the arm for a while."""

from collections.abc import Mapping, Sequence

import numpy as np
import sympy as sp

from modelgen.effects.effect import SIGNALS, Array, LinearParameter, NonlinearParameter, Quantity
from modelgen.effects.kinds import LoadEffect
from modelgen.effects.loads import force_columns
from modelgen.effects.place import Model, Motion, Place
from modelgen.effects.truth import Truth

FX, FY, FZ, fx, fy, fz, px, py, pz = sp.symbols("FX FY FZ fx fy fz px py pz", real=True)
WRENCH = ("FX", "FY", "FZ", "NX", "NY", "NZ")


class ExternalForce(LoadEffect):
    """A constant force in base axes on a link, for part of a recording.

    terms: wrench of the robot on its surroundings at the point (px, py, pz) of the link's frame; the drives
    must add J^T w. A payload carried only then adds to the same joints; its torque turns with the link's
    pose.
    """

    name = "external_force"
    summary = "a constant force acts on the last link for part of a recording"
    signature = "all joints at once through the arm's Jacobian, beginning and ending abruptly"
    source = "Haddadin, De Luca, Albu-Schaeffer, Robot collisions: a survey, IEEE T-RO 33(6), 2017"
    equation = "tau += J(q)^T (force at a point of a link) between two moments of a recording"
    remedy = "leave that stretch of the recording out, or record it again without contact"
    terms = dict.fromkeys(WRENCH, SIGNALS.gate)
    linear = (
        *(LinearParameter(name, "N", -1000.0, 1000.0) for name in ("FX", "FY", "FZ")),
        *(LinearParameter(name, "N m", -500.0, 500.0, optional=True) for name in ("NX", "NY", "NZ")),
    )
    nonlinear = tuple(NonlinearParameter(name, "m", -0.5, 0.5, (0.0,)) for name in ("px", "py", "pz"))
    reported = (
        Quantity("force", "N", sp.sqrt(FX**2 + FY**2 + FZ**2)),
        Quantity("fx", "N", FX),
        Quantity("fy", "N", FY),
        Quantity("fz", "N", FZ),
        Quantity("px", "m", px),
        Quantity("py", "m", py),
        Quantity("pz", "m", pz),
    )
    inverse = {"FX": fx, "FY": fy, "FZ": fz, "NX": sp.Integer(0), "NY": sp.Integer(0), "NZ": sp.Integer(0)}
    windowed = True
    transient = True
    on_link = True
    sizes = ("fx", "fy", "fz")
    size_aliases = ("force",)
    typical = {"fx": 8.0, "fy": -5.0, "fz": 6.0, "px": 0.0, "py": 0.0, "pz": 0.0}
    window = (0.4, 0.6)  # of the recording, where a simulator puts it

    def starts(
        self,
        place: Place,
        motions: Sequence[Motion],
        residuals: Sequence[Array],
        model: Model | None = None,
    ) -> Sequence[dict[str, float]]:
        """At the origin of the link's frame."""
        return [{"px": 0.0, "py": 0.0, "pz": 0.0}]

    def physical(self, values: Mapping[str, float], model: Model | None = None) -> str | None:
        """Nor is a contact stronger than those of its kind: parts that cancel each other are none. (Of a
        UR10e whose positions came 5 ms late 3 and -3 kN were told beside half a metre from the last link.)"""
        if any(abs(values.get(p.name, 0.0)) > p.high for p in self.linear):
            return "no contact is as strong"
        return super().physical(values, model)

    def joint_columns(self, place: Place, theta: Mapping[str, float], motion: Motion, model: Model) -> Array:
        """J^T of a unit wrench at the point of the link (the last one, where the place names none)."""
        row = (place.link or model.robot.payload_link("L")) - 1
        point = (theta["px"], theta["py"], theta["pz"])
        columns = force_columns(model.robot, motion.q, row, point)
        return columns[:, :, [WRENCH.index(name) for name in self.parameters_of(place)]]

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        point = (values["px"], values["py"], values["pz"])
        row = None if place.link is None else place.link - 1
        columns = force_columns(truth.robot, truth.link[0], row, point=point)
        wrench = np.array([values.get(name, 0.0) for name in WRENCH])
        gate = place.gate(truth.recording, truth.t - truth.t[0])[:, None]
        return truth.with_torque(place, gate * (columns @ wrench))

    def usual(self, given: Mapping[str, float], own: Mapping[str, float]) -> dict[str, float]:
        """`force` alone has the usual direction."""
        given = dict(given)
        if "force" in given:
            usual = np.array([self.typical[name] for name in self.sizes])
            usual *= given.pop("force") / np.linalg.norm(usual)
            given |= dict(zip(self.sizes, usual.tolist()))
        return super().usual(given, own)


EFFECT = ExternalForce()
