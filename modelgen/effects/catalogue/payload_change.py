"""A mass in the gripper that the study does not declare: in one run, or from a moment on."""

import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter, Quantity

M, MX, MY, MZ = sp.symbols("M MX MY MZ", real=True)
m, mx, my, mz = sp.symbols("m mx my mz", real=True)
RADIUS = sp.Rational(6, 100)  # m, of the solid ball that a simulated payload is
ball = sp.Rational(2, 5) * m * RADIUS**2

_INERTIA = ("XX", "XY", "XZ", "YY", "YZ", "ZZ")

EFFECT = Effect(
    name="payload_change",
    summary="a body fixed to the last link is carried that the study does not declare",
    signature="all joints at once, with the columns of a payload, inside one recording or from one moment on",
    source="Khalil, Gautier, Lemoine, Identification of the payload inertial parameters of industrial "
    "manipulators, ICRA 2007",
    terms=dict.fromkeys(("M", "MX", "MY", "MZ", *_INERTIA), SIGNALS.gate),
    linear=(
        LinearParameter("M", "kg", 0.0, 500.0, "positive"),
        *(LinearParameter(name, "kg m", -200.0, 200.0) for name in ("MX", "MY", "MZ")),
        *(LinearParameter(name, "kg m^2", -100.0, 100.0, optional=True) for name in _INERTIA),
    ),
    reported=(
        Quantity("m", "kg", M),
        Quantity("mx", "kg m", MX),
        Quantity("my", "kg m", MY),
        Quantity("mz", "kg m", MZ),
    ),
    inverse={
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
    },
    kind="load",
    channel="link",
    joints="robot",
    windowed=True,
    sizes=("m", "mx", "my", "mz"),
    typical={"m": 1.5, "mx": 0.03, "my": -0.02, "mz": 0.12},
)
