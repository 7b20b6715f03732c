"""A contact: somebody leans on the arm for a while."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, NonlinearParameter, Quantity

FX, FY, FZ, fx, fy, fz, px, py, pz = sp.symbols("FX FY FZ fx fy fz px py pz", real=True)

EFFECT = Effect(
    name="external_force",
    summary="a constant force acts on the last link for part of a recording",
    signature="all joints at once through the arm's Jacobian, beginning and ending abruptly",
    source="Haddadin, De Luca, Albu-Schaeffer, Robot collisions: a survey, IEEE T-RO 33(6), 2017",
    # wrench of the robot on its surroundings, base axes, at the point (px, py, pz) of the last link's frame:
    # the drives must add J^T w
    terms=dict.fromkeys(("FX", "FY", "FZ", "NX", "NY", "NZ"), SIGNALS.gate),
    linear=(
        *(LinearParameter(name, "N", -1000.0, 1000.0) for name in ("FX", "FY", "FZ")),
        *(LinearParameter(name, "N m", -500.0, 500.0, optional=True) for name in ("NX", "NY", "NZ")),
    ),
    nonlinear=tuple(NonlinearParameter(name, "m", -0.5, 0.5, (0.0,)) for name in ("px", "py", "pz")),
    reported=(
        Quantity("force", "N", sp.sqrt(FX**2 + FY**2 + FZ**2)),
        Quantity("fx", "N", FX),
        Quantity("fy", "N", FY),
        Quantity("fz", "N", FZ),
        Quantity("px", "m", px),
        Quantity("py", "m", py),
        Quantity("pz", "m", pz),
    ),
    inverse={"FX": fx, "FY": fy, "FZ": fz, "NX": sp.Integer(0), "NY": sp.Integer(0), "NZ": sp.Integer(0)},
    kind="load",
    channel="link",
    joints="robot",
    windowed=True,
    sizes=("fx", "fy", "fz"),
    typical={"fx": 8.0, "fy": -5.0, "fz": 6.0, "px": 0.0, "py": 0.0, "pz": 0.0},
)
