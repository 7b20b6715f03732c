"""Which effects there are: the catalogue's, found by being there, and a user's own, registered or from a
folder.

A user's effect is known for the rest of the process; nothing is written into the package. Its content is
part of the key of every cached model that uses it (:func:`fingerprint`), so an edited effect is derived anew.
"""

import hashlib
import importlib
import importlib.util
import pkgutil
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import sympy as sp

from modelgen.effects import catalogue as catalogue_folder
from modelgen.effects.effect import Effect, EffectError

_own: dict[str, Effect] = {}


@cache
def _built_in() -> dict[str, Effect]:
    found = {}
    for module in sorted(m.name for m in pkgutil.iter_modules(catalogue_folder.__path__)):
        value = getattr(importlib.import_module(f"{catalogue_folder.__name__}.{module}"), "EFFECT", None)
        if isinstance(value, Effect):
            found[value.name] = value
    return found


def catalogue() -> dict[str, Effect]:
    """Every effect by name: each module of the catalogue that defines EFFECT, then the registered ones."""
    return {**_built_in(), **_own}


def effect(name: str) -> Effect:
    """The effect of that name. Raises EffectError listing the names there are."""
    known = catalogue()
    if name not in known:
        raise EffectError(f"no effect is called {name}; there are {', '.join(sorted(known))}.")
    return known[name]


def register(new: Effect | type[Effect], where: str = "") -> Effect:
    """Make a user's effect known, as an instance or a class; registering it again replaces it.

    Raises EffectError where it is incomplete or takes the name of an effect of the catalogue.
    """
    made = new() if isinstance(new, type) and issubclass(new, Effect) else new
    at = f"{where}: " if where else ""
    if not isinstance(made, Effect):
        raise EffectError(
            f"{at}{new!r} is no effect; subclass modelgen.effects.Effect or make an Effect(...)."
        )
    for attribute in ("name", "summary", "signature", "source"):
        if not isinstance(getattr(made, attribute, None), str):
            raise EffectError(f"{at}the effect has no {attribute}; give it one, a text.")
    if made.name in _built_in():
        raise EffectError(f"{at}{made.name} is an effect of the catalogue; choose another name.")
    if not made.name.isidentifier():
        raise EffectError(f"{at}{made.name!r} is no name; use letters, digits and _.")
    names = (*made.linear_names, *made.nonlinear_names)
    if len(set(names)) < len(names):
        raise EffectError(f"{at}two parameters of {made.name} have one name; rename one.")
    if made.terms and set(made.terms) != set(made.linear_names):
        told = ", ".join(made.linear_names)
        raise EffectError(
            f"{at}terms of {made.name} are not those of its parameters {told}; name them alike."
        )
    _own[made.name] = made
    return made


def register_folder(folder: str | Path) -> tuple[Effect, ...]:
    """Register every effect of a folder: one in each *.py that is not called _something.

    The file defines EFFECT, or one subclass of Effect. Raises EffectError naming file and remedy.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise EffectError(f"{folder} is no folder of effects; name one that holds files such as wind.py.")
    return tuple(
        register(_from_file(file), str(file))
        for file in sorted(folder.glob("*.py"))
        if not file.name.startswith("_")
    )


def _from_file(file: Path) -> Effect | type[Effect]:
    key = hashlib.sha256(str(file.resolve()).encode()).hexdigest()[:12]
    spec = importlib.util.spec_from_file_location(f"own_effect_{file.stem}_{key}", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except EffectError:
        raise
    except Exception as error:  # whatever the user's file does
        raise EffectError(f"{file}: {type(error).__name__}: {error}; mend the file.") from error
    if hasattr(module, "EFFECT"):
        return module.EFFECT
    own = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Effect) and value.__module__ == module.__name__
    ]
    if len(own) != 1:
        raise EffectError(f"{file}: defines {len(own)} effects; define one, or name it: EFFECT = MyEffect().")
    return own[0]


def fingerprint(requests: Sequence[str]) -> str:
    """Content of the registered effects that NAME:JOINT requests use; "" of those of the catalogue."""
    names = sorted({request.partition(":")[0] for request in requests} & set(_own))
    parts = []
    for name in names:
        e = _own[name]
        terms = {key: sp.srepr(term) for key, term in sorted(e.terms.items())}
        state = sp.srepr(e.state.update) if e.state else ""
        parts.append(repr((name, terms, state, e.linear, e.nonlinear, e.kind, e.channel, e.joints)))
    return hashlib.sha256("\n".join(parts).encode()).hexdigest() if parts else ""
