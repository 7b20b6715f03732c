"""`effects:` of a study as terms of its equations, and terms as a study that says the same again.

What is decided here: which place of the effect an entry means (its own list of places is searched), which
parameters are given, started, held; whatever cannot act is refused with the entry's number and the remedy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ident.equations.columns import Columns
from ident.equations.terms import Term
from ident.errors import StudyError
from ident.recordings.study import EffectEntry, Study
from modelgen.errors import ModelgenError
from modelgen.geometry.names import ParameterName
from modelgen.geometry.place import Layout, Place

if TYPE_CHECKING:
    from modelgen.effects.effect import Effect


def layout_of(study: Study, columns: Columns, travel: Sequence[float] = ()) -> Layout:
    """What there is to place effects on; `travel` (n,): range of each joint in the recordings."""
    from modelgen.geometry.robot_file import load_robot

    robot = load_robot(study.robot_source, study.exact)
    if study.gravity is not None:
        robot = robot.with_gravity(study.gravity)
    labels = tuple(entry.label for entry in study.recordings)
    gone = [name for name in columns.model.parameters if name not in columns.parameters]
    kinds = (_kinds(names, columns.need.joints) for names in (columns.parameters, gone))
    return Layout(robot, columns.need.channels, labels, tuple(travel), *kinds)


def _kinds(parameters: Sequence[str], joints: Sequence[int]) -> tuple[frozenset[str], ...]:
    """Kinds of some parameters, joint by joint."""
    parsed = [its for name in parameters if (its := ParameterName.of(name)) and not its.payload]
    return tuple(frozenset(its.kind for its in parsed if its.label == str(label)) for label in joints)


def terms_of(study: Study, columns: Columns, layout: Layout) -> tuple[Term, ...]:
    """The terms that a study declares, at their given values. Raises StudyError."""
    terms: list[Term] = []
    for number, entry in enumerate(study.effects, 1):
        try:
            terms.append(_term(study, entry, columns, layout))
        except (ModelgenError, ValueError) as error:
            raise StudyError(str(study.file), f"effects[{number}]", str(error)) from None
    names = [_name(term, columns) for term in terms]
    counts = [names[:k].count(name) + 1 for k, name in enumerate(names)]
    labels = [name if count == 1 else f"{name}#{count}" for name, count in zip(names, counts)]
    return tuple(replace(term, label=label) for term, label in zip(terms, labels))


def known_effect(study: Study, name: str) -> Effect:
    """An effect of the catalogue, or of the study's own folder. Raises EffectError."""
    from modelgen.effects import effect

    return effect(name)


def _term(study: Study, entry: EffectEntry, columns: Columns, layout: Layout) -> Term:
    effect = known_effect(study, entry.effect)
    place = _place(effect, entry, columns, layout)
    _check_new(effect, place, columns, layout)
    linear, shape = _given(effect, place, entry)
    own = effect.parameters_of(place)
    more = tuple(p.name for p in effect.linear if p.optional and p.name in linear and p.name not in own)
    if more:
        place = replace(place, parts=(*own, *more))
    if not effect.parameters_of(place):  # all optional: all of them, unless some are given
        place = replace(place, parts=effect.linear_names)
    used = effect.parameters_of(place)
    for name in (*entry.fixed, *linear):
        if name not in shape and name not in used:
            raise ValueError(
                f"{effect.name} has no parameter {name} to hold here; it has "
                f"{', '.join((*used, *effect.nonlinear_names))}"
            )
    bounds = effect.bounds(place)
    for name, value in shape.items():
        low, high = bounds.get(name, (-math.inf, math.inf))
        if not low <= value <= high and name not in entry.fixed:
            raise ValueError(f"{name} = {value:g} is outside of {low:g} to {high:g}, where it is searched")
    return Term(
        effect.name,
        effect,
        place,
        shape,
        tuple(linear.get(name, 0.0) for name in used),
        tuple(name for name in bounds if name not in entry.fixed),
        {name: linear[name] for name in entry.fixed if name in linear},
        bounds,
    )


def _place(effect: Effect, entry: EffectEntry, columns: Columns, layout: Layout) -> Place:
    """The place that an entry means, of those where the effect may stand."""
    joints = columns.need.joints
    joint, source = (
        None if number is None else _position(number, joints) for number in (entry.joint, entry.source_joint)
    )
    places = list(effect.places(layout))
    if not places:
        raise ValueError(f"{effect.name} does not show in the torques of this study")
    found = [p for p in places if p.joint == joint and p.source == source]
    if not found:
        takes = "source_joint: beside joint:" if effect.joints == "pair" else "joint:"
        without = "no joint: and no source_joint:" if all(p.joint is None for p in places) else takes
        raise ValueError(f"{effect.name} cannot stand there; it takes {without}")
    if entry.side is not None:
        sides = sorted({p.side for p in found if p.side})
        found = [p for p in found if p.side == entry.side]
        if not found:
            raise ValueError(f"{effect.name} has no side {entry.side} here; its sides are {', '.join(sides)}")
    window = {"recording": entry.recording, "start": entry.from_s, "stop": entry.to_s}
    if any(value is not None for value in window.values()) and not effect.windowed:
        raise ValueError(f"{effect.name} does not come and go; leave recording:, from: and to: out")
    if effect.all_along and (entry.from_s is not None or entry.to_s is not None):
        raise ValueError(f"{effect.name} is there all along a recording; leave from: and to: out")
    if effect.windowed and entry.recording is not None:
        found = [replace(p, recording=entry.recording) for p in found]
    elif effect.windowed:
        found = [replace(p, recording=None) for p in found]
    if entry.link is not None:
        found = [p for p in found if p.link == entry.link] or [
            replace(p, link=entry.link) for p in found if p.link is not None
        ]
        if not found:
            raise ValueError(f"{effect.name} is of no link; leave link: out")
    widest = max(found, key=lambda p: len(p.parts))  # what does not act is cancelled by the F-test
    return replace(widest, start=entry.from_s, stop=entry.to_s)


def _position(number: int, joints: Sequence[int]) -> int:
    if number not in joints:
        raise ValueError(f"the robot has no joint {number}; its joints are {', '.join(map(str, joints))}")
    return list(joints).index(number)


def _check_new(effect: Effect, place: Place, columns: Columns, layout: Layout) -> None:
    """Refuse a term that the model has already: friction that `without` did not take away."""
    if layout.covers(place.joint, effect.replaces):
        label = None if place.joint is None else columns.need.joints[place.joint]
        raise ValueError(
            f"{effect.name}:{label} is in the model already; remove it here, or add without: "
            f"[{effect.name}:{label}]"
        )


def _given(effect: Effect, place: Place, entry: EffectEntry) -> tuple[dict[str, float], dict[str, float]]:
    """Linear and shape parameters that an entry gives, under their own names (of a tilted base's first link
    those of the model, where the file's gravity hides them) or the reported ones."""
    given = entry.given
    sizes = {*effect.linear_names, *effect.parameters_of(place)}
    own = {*sizes, *effect.nonlinear_names}
    reported = {name: value for name, value in given.items() if name not in own}
    values = {name: value for name, value in given.items() if name in own}
    if reported:
        told = [q.name for q in effect.quantities]
        if unknown := sorted(set(reported) - set(told)):
            names = ", ".join(dict.fromkeys((*told, *effect.linear_names, *effect.nonlinear_names)))
            raise ValueError(f"{effect.name} has no parameter {unknown[0]}; it has {names}")
        linear, shape = effect.values_from_reported({n: v for n, v in given.items() if n in told})
        values = {**linear, **shape, **values}
    return (
        {name: float(v) for name, v in values.items() if name in sizes},
        {name: float(v) for name, v in values.items() if name in effect.nonlinear_names},
    )


def _name(term: Term, columns: Columns) -> str:
    """stribeck_friction:2, joint_coupling:6:5, payload_change@run2."""
    place, joints = term.place, columns.need.joints
    parts = [term.effect.name, *(str(joints[j]) for j in (place.joint, place.source) if j is not None)]
    return ":".join(parts) + (f"@{place.recording}" if place.recording else "")


def entry_of(term: Term, joints: Sequence[int]) -> dict[str, Any]:
    """A term as an entry of `effects:`, its values as starts; held ones are listed in `fixed`."""
    place = term.place
    held = [n for n in (*term.linear, *term.effect.nonlinear_names) if n in term.known or n in term.theta]
    held = [name for name in held if name not in term.free and name not in term.unknown]
    where = {
        "joint": None if place.joint is None else joints[place.joint],
        "source_joint": None if place.source is None else joints[place.source],
        "side": place.side,
        "recording": place.recording,
        "from": place.start,
        "to": place.stop,
        "link": place.link,
    }
    values = {name: float(value) for name, value in (*zip(term.linear, term.size), *term.theta.items())}
    out = {"effect": term.effect.name, **{key: value for key, value in where.items() if value is not None}}
    return {**out, **values, **({"fixed": held} if held else {})}


def study_with(study: Study, terms: Sequence[Term], joints: Sequence[int]) -> dict[str, Any]:
    """A study's keys as plain values with these terms as its `effects`: what extended_study.yaml holds."""
    data = study.model_dump(mode="json", by_alias=True, exclude_defaults=True, fallback=str)
    data.pop("effects", None)
    out = {"robot": study.robot, "model": study.model, **data}
    return out | ({"effects": [entry_of(term, joints) for term in terms]} if terms else {})
