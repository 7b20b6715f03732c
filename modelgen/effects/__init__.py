"""The catalogue of effects that a rigid model lacks: one file per effect, found by being there.

A new effect is one new file here that defines EFFECT, for example wind.py:

    EFFECT = Effect(
        name="wind",                                    # the file's name
        summary="air drags at the link",                # what it is
        signature="grows with the square of the rate",  # how it shows in a residual
        source="...",                                   # who described it
        terms={"Fw": sp.Abs(SIGNALS.dq) * SIGNALS.dq},  # torque per unit of each linear parameter
        linear=(LinearParameter("Fw", "N m s^2/rad^2", 0.0, 50.0, "positive"),),
        typical={"Fw": 1.0},
    )

From then on `ident simulate --effect wind:2` hides it, `ident diagnose` looks for it, `regenerate-model
--effect wind:2` emits it as C, and the tests ask of it what they ask of every effect.
"""

import importlib
import pkgutil
from functools import cache

from modelgen.effects import catalogue as catalogue_folder
from modelgen.effects.effect import SIGNALS, Effect, EffectError

__all__ = ["SIGNALS", "Effect", "EffectError", "catalogue", "effect"]


@cache
def _discovered() -> tuple[Effect, ...]:
    found = []
    for module in sorted(m.name for m in pkgutil.iter_modules(catalogue_folder.__path__)):
        value = getattr(importlib.import_module(f"{catalogue_folder.__name__}.{module}"), "EFFECT", None)
        if isinstance(value, Effect):
            found.append(value)
    return tuple(found)


def catalogue() -> dict[str, Effect]:
    """Every effect by name: each module of this folder that defines EFFECT."""
    return {found.name: found for found in _discovered()}


def effect(name: str) -> Effect:
    """The effect of that name. Raises EffectError listing the names there are."""
    known = catalogue()
    if name not in known:
        raise EffectError(f"no effect is called {name}; there are {', '.join(sorted(known))}.")
    return known[name]
