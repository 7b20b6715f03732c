"""The catalogue of effects that a rigid model lacks: one file per effect, found by being there."""

import importlib
import pkgutil
from functools import cache

from modelgen.effects.effect import SIGNALS, Effect, EffectError

__all__ = ["SIGNALS", "Effect", "EffectError", "catalogue", "effect"]


@cache
def _discovered() -> tuple[Effect, ...]:
    found = []
    for module in sorted(m.name for m in pkgutil.iter_modules(__path__)):
        value = getattr(importlib.import_module(f"{__name__}.{module}"), "EFFECT", None)
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
