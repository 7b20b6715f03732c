"""An effect as a line says it, in a study's `effects:` and behind `--effect`: NAME:JOINT[:key=value,...]."""

from __future__ import annotations

from typing import Any


def keys_of(text: str) -> dict[str, Any]:
    """ "torque_ripple:4:wavenumber=200,fixed=wavenumber" -> its mapping. `fixed` joins several with +.

    Raises ValueError: what is wrong with which part."""
    name, _, rest = text.partition(":")
    joint, _, options = rest.partition(":")
    if "=" in joint and not options:  # base_tilt:roll=0.02
        joint, options = "", joint
    out: dict[str, Any] = {"effect": name}
    if joint:
        out["joint"] = _whole(joint)
    for option in filter(None, options.split(",")):
        key, equals, value = option.partition("=")
        if not equals or key in out:
            raise ValueError(f"{text!r}: {option!r} is not KEY=VALUE, or the key is there twice")
        if key == "fixed":
            out[key] = tuple(value.split("+"))
        elif key in ("side", "recording"):
            out[key] = value
        elif key in ("source_joint", "link"):
            out[key] = _whole(value)
        else:
            try:
                out[key] = float(value)
            except ValueError:
                raise ValueError(f"{text!r}: {value!r} is no number; write {key}=NUMBER") from None
    return out


def _whole(text: str) -> int | str:
    """What is no number is told by who knows the robot."""
    return int(text) if text.isdigit() else text
