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
from typing import Any

from ident.errors import IdentError
from ident.recordings.effect_text import keys_of
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


def parse_effect(asked: str | Mapping[str, Any], robot: Robot) -> EffectRequest:
    """Read one request, a line or a mapping as in a study. Raises EffectRequestError: what is wrong and what
    would be right."""
    try:
        given = keys_of(asked) if isinstance(asked, str) else dict(asked)
    except ValueError as error:
        raise EffectRequestError(f"--effect {error}") from None
    text, name, known = asked if isinstance(asked, str) else str(given), str(given.pop("effect")), catalogue()
    if name not in known:
        close = difflib.get_close_matches(name, known, n=1, cutoff=0.4)
        hint = f"did you mean {close[0]}?" if close else f"the effects are {', '.join(known)}."
        raise EffectRequestError(f"--effect {text}: no effect is called {name!r}; {hint}")
    effect = known[name]
    joint, source = given.pop("joint", ""), given.pop("source_joint", None)
    beside = [
        *(["recording"] if effect.windowed else []),
        *(["from", "to"] if effect.windowed and not effect.all_along else []),
        *(["link"] if effect.on_link else []),
    ]
    window = {key: given.pop(key) for key in beside if key in given}
    allowed = [quantity.name for quantity in effect.quantities]
    for key in given:
        if key not in allowed:
            more = [*beside, *(["source_joint"] if effect.joints == "pair" else [])]
            raise EffectRequestError(
                f"--effect {text}: {name} has no parameter {key!r}; it has {', '.join(allowed + more)}."
            )
    return EffectRequest(
        effect=effect,
        joint=_joint(text, effect, str(joint), robot),
        source_joint=_source(text, effect, str(joint), None if source is None else str(source), robot),
        values={key: _number(text, key, value) for key, value in given.items()},
        recording=window.get("recording"),
        start=_number(text, "from", window["from"]) if "from" in window else None,
        stop=_number(text, "to", window["to"]) if "to" in window else None,
        link=_link(text, str(window["link"]), robot) if "link" in window else None,
    )


def _link(text: str, link: str, robot: Robot) -> int:
    if not link.isdigit() or not 1 <= int(link) <= len(robot.links):
        raise EffectRequestError(
            f"--effect {text}: link={link} is no row of {robot.name}; write 1 to {len(robot.links)}."
        )
    return int(link)


def _number(text: str, key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e12:
        raise EffectRequestError(f"--effect {text}: {key}={value} is no number; use SI units, as {key}=0.1.")
    return float(value)


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
