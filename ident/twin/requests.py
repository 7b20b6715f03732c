"""What a user asks the twin to hide: `NAME:JOINT[:param=value,...]`, read and checked.

stribeck_friction:4                     joint 4, size chosen so that it is clearly there
torque_ripple:3:A=1.5,wavenumber=20     reported parameters of contract 7; the others keep usual values
joint_coupling:6:source_joint=5         pairs name the other joint (the neighbour if left out)
payload_change::m=2,recording=run2,from=20
payload_change::m=2,link=3              on the body of row 3 of the robot file
base_tilt                               acts on the whole robot, so no joint
"""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass

from ident.errors import IdentError
from modelgen.effects import Effect, catalogue
from modelgen.geometry.robot import Robot


class EffectRequestError(IdentError):
    """An --effect that cannot be simulated."""


@dataclass(frozen=True, slots=True)
class EffectRequest:
    """One effect to hide. `joint`, `source_joint` count moving joints from 0; None: the whole robot."""

    effect: Effect
    joint: int | None
    source_joint: int | None
    values: Mapping[str, float]  # reported parameters that the user fixed
    recording: str | None = None
    start: float | None = None  # s
    stop: float | None = None
    link: int | None = None  # row of the robot file


def parse_effect(text: str, robot: Robot) -> EffectRequest:
    """Read one request. Raises EffectRequestError: what is wrong and what would be right."""
    name, _, rest = text.partition(":")
    joint_text, _, values_text = rest.partition(":")
    if "=" in joint_text and not values_text:  # base_tilt:roll=0.02
        joint_text, values_text = "", joint_text
    known = catalogue()
    if name not in known:
        close = difflib.get_close_matches(name, known, n=1, cutoff=0.4)
        hint = f"did you mean {close[0]}?" if close else f"the effects are {', '.join(known)}."
        raise EffectRequestError(f"--effect {text}: no effect is called {name!r}; {hint}")
    effect = known[name]
    given = _values(text, values_text)
    source_text = given.pop("source_joint", None)
    recording = given.pop("recording", None) if effect.windowed else None
    window = {key: given.pop(key) for key in ("from", "to") if effect.windowed and key in given}
    link = given.pop("link", None) if effect.on_link else None
    allowed = [quantity.name for quantity in effect.quantities]
    for key in given:
        if key not in allowed:
            extra = ["recording", "from", "to"] if effect.windowed else []
            extra += ["link"] if effect.on_link else []
            extra += ["source_joint"] if effect.joints == "pair" else []
            raise EffectRequestError(
                f"--effect {text}: {name} has no parameter {key!r}; it has {', '.join(allowed + extra)}."
            )
    return EffectRequest(
        effect=effect,
        joint=_joint(text, effect, joint_text, robot),
        source_joint=_source(text, effect, joint_text, source_text, robot),
        values={key: _number(text, key, value) for key, value in given.items()},
        recording=recording,
        start=_number(text, "from", window["from"]) if "from" in window else None,
        stop=_number(text, "to", window["to"]) if "to" in window else None,
        link=_link(text, link, robot) if link is not None else None,
    )


def _link(text: str, link: str, robot: Robot) -> int:
    if not link.isdigit() or not 1 <= int(link) <= len(robot.links):
        raise EffectRequestError(
            f"--effect {text}: link={link} is no row of {robot.name}; write 1 to {len(robot.links)}."
        )
    return int(link)


def _values(text: str, values: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for part in filter(None, values.split(",")):
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not key or not value:
            raise EffectRequestError(
                f"--effect {text}: {part!r} is not param=value; write for example k=3000."
            )
        found[key] = value
    return found


def _number(text: str, key: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = float("nan")
    if not abs(number) < 1e12:
        raise EffectRequestError(
            f"--effect {text}: {key}={value} is not a number; use SI units, such as {key}=0.1."
        )
    return number


def _joint(text: str, effect: Effect, joint: str, robot: Robot) -> int | None:
    labels = robot.joint_labels
    if effect.joints == "robot":
        if joint:
            raise EffectRequestError(
                f"--effect {text}: {effect.name} acts on the whole robot; write {effect.name}::..."
            )
        return None
    if not joint:
        if effect.shared:
            return None
        raise EffectRequestError(f"--effect {text}: say which joint, for example {effect.name}:{labels[0]}.")
    if joint not in labels:
        raise EffectRequestError(
            f"--effect {text}: {robot.name} has no joint {joint}; its joints are {', '.join(labels)}."
        )
    return labels.index(joint)


def _source(text: str, effect: Effect, joint: str, source: str | None, robot: Robot) -> int | None:
    if effect.joints != "pair":
        if source is not None:
            raise EffectRequestError(f"--effect {text}: {effect.name} has no source_joint; leave it out.")
        return None
    labels = robot.joint_labels
    here = labels.index(joint)
    if source is None:
        return here - 1 if here > 0 else here + 1
    if source not in labels or source == joint:
        others = ", ".join(label for label in labels if label != joint)
        raise EffectRequestError(
            f"--effect {text}: source_joint={source} is not another joint; choose {others}."
        )
    return labels.index(source)
