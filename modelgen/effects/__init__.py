"""The catalogue of effects that a rigid model lacks: one class a file, found by being there.

A new effect is one file, of the catalogue or of a user's own folder, for example wind.py:

    class Wind(Effect):
        name = "wind"                                    # the file's name
        summary = "air drags at the link"                # what it is
        signature = "grows with the square of the rate"  # how it shows in a residual
        source = "..."                                   # who described it
        remedy = "..."                                   # what a person does about it
        terms = {"Fw": sp.Abs(SIGNALS.dq) * SIGNALS.dq}  # torque per unit of each linear parameter
        linear = (LinearParameter("Fw", "N m s^2/rad^2", 0.0, 50.0, "positive"),)
        typical = {"Fw": 1.0}

    EFFECT = Wind()

From then on `ident simulate --effect wind:2` hides it, `ident diagnose` looks for it, `regenerate-model
--effect wind:2` emits it as C, and the tests ask of it what they ask of every effect. `register(Wind)` or
`register_folder("my_effects")` make a user's own effects known without touching the package.
"""

from modelgen.effects.effect import (
    SIGNALS,
    Effect,
    EffectError,
    Layout,
    LinearParameter,
    Model,
    Motion,
    NonlinearParameter,
    Place,
    Quantity,
    State,
)
from modelgen.effects.registry import catalogue, effect, fingerprint, register, register_folder

__all__ = [
    "SIGNALS",
    "Effect",
    "EffectError",
    "Layout",
    "LinearParameter",
    "Model",
    "Motion",
    "NonlinearParameter",
    "Place",
    "Quantity",
    "State",
    "catalogue",
    "effect",
    "fingerprint",
    "register",
    "register_folder",
]
