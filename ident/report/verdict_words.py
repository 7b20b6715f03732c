"""What a diagnosis says first: what is found, what stands against it, what is left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ident.report.finding_words import (
    by_examination,
    effect_name,
    finding_sentence,
    place,
    rival_place,
    rows_in_words,
    sides_in_words,
)
from ident.report.unexplained_words import unexplained_sentence
from ident.report.wording import joined, number, percent, worse_elsewhere


def verdict(document: Mapping[str, Any]) -> str:
    """The diagnosis in a sentence or two that an engineer can act on."""
    told = [f for f in document["findings"] if by_examination(f)]
    found = [f for f in document["findings"] if not by_examination(f)]
    sure = [f for f in found if f.get("grade") != "partly"]
    partly = [f for f in found if f.get("grade") == "partly"]
    sentences, worse = [], worse_elsewhere(document["error_percent"]["after"])
    for fault in document.get("unsettled", ())[:1]:
        first = (
            "Correct the robot file first, in whose equations all else is told"
            if fault["robot_file"]
            else "Settle this first, as all else is told with it in the data"
        )
        sentences.append(f"{first}: {_fault(fault)}")
    for fault in document.get("assumed", ())[:1]:
        sentences.append(
            "Settle first which of these is so, as all else is told as if the first one were: "
            + _fault(fault)
        )
    if not sentences:
        sentences += [f"Nothing found explains this: {_fault(x)}" for x in document.get("unanswered", ())[:1]]
    if told:
        sentences.append(f"The data are not what the study says: {_named(told)}.")
    if sure:
        sentences.append(f"The model lacks {_named(sure)}.")
    if partly:
        sentences.append(f"What is left is partly explained by {_named(partly)}.")
    sentences += [f"{text[0].upper()}{text[1:]}." for text in document.get("repeats", ())]
    if unexplained := document["unexplained"]:
        places = joined(list(dict.fromkeys(f"{place(u['joints'])} ({u['channel']})" for u in unexplained)))
        opening = "Structure is left that" if sentences else "There is structure in the residual that"
        sentences.append(f"{opening} no known effect explains, on {places}.")
    if not sentences:
        hints = [hint_sentence(document, hint) for hint in document.get("hints") or ()]
        nothing = "The model lacks nothing that these recordings show."
        unsure = "These recordings do not confirm that the model lacks anything, nor that it lacks nothing."
        quiet = not (hints or _above_noise(document) or worse)
        sentences = [nothing if quiet else unsure, *hints, left_in_words(document)]
    elif above := _above_noise(document):
        sentences.append(_beyond_noise(document, above))
    elif resting := _mostly_at_rest(document):
        sentences.append(resting)
    return " ".join([*sentences, *worse])


def _fault(fault: Mapping[str, Any]) -> str:
    where = f"{fault['recording']}: " if fault["recording"] else ""
    return f"{where}{fault['message'].rstrip('.')}."


def hint_sentence(document: Mapping[str, Any], hint: Mapping[str, Any]) -> str:
    """What may be there, and why it is not told."""
    judged = document.get("judged") or {}
    asked = judged.get("log_e_asked")
    against = "" if asked is None else f", where {number(asked, 2)} is asked"
    rivals = joined([f"{effect_name(r['effect'])} on {rival_place(r)}" for r in hint.get("equivalent") or ()])
    instead = f", or instead at {rivals}," if rivals else ""
    rows = rows_in_words(judged) + ("," if judged.get("apart") else "")
    return (
        f"They hint at {effect_name(hint['effect'])} on {rival_place(hint)}{instead} with "
        f"log E = {number(hint['log_e'], 2)}{against}; it is not told because only {hint['blocks_for']} of "
        f"{hint['blocks']} blocks of {rows} speak for it. A longer run to judge it by would tell."
    )


def _left(document: Mapping[str, Any]) -> dict[str, float]:
    """{channel: percent} that the last fit leaves of the fitted runs where joints move: the noise floor of
    what nothing is told of. Friction at rest is anything, which no model foretells."""
    after, floor = document["error_percent"]["after"]["identify"], document.get("noise_floor_percent", {})
    return {name: floor.get(name) or value for name, value in after.items() if value is not None}


def _told_of(document: Mapping[str, Any]) -> set[str]:
    """Channels of which something is told."""
    told = [*document["findings"], *document["unexplained"]]
    return {f"{item['channel']}{joint}" for item in told for joint in item["joints"]}


def _above_noise(document: Mapping[str, Any]) -> list[str]:
    """Channels of which nothing is told and that keep more than noise on the fitted runs, the worst first."""
    left, white = _left(document), document.get("white_noise_percent", {})
    known = {"total", *_told_of(document)}
    above = (n for n in left if n not in known and white.get(n) and left[n] > NOISY * white[n])
    return sorted(above, key=lambda n: -left[n] / white[n])


def left_in_words(document: Mapping[str, Any]) -> str:
    """What the last fit leaves of the fitted runs, against white noise where that can be read."""
    left, white = _left(document), document.get("white_noise_percent", {})
    channels = [name for name in left if name != "total"]
    seen = [name for name in channels if white.get(name)]
    if not seen:
        return (
            f"{percent(left['total'])} of the torque is left on the fitted runs; whether that is noise is "
            "not known: no noise can be read off these recordings."
        )
    if above := _above_noise(document):
        return _beyond_noise(document, above)
    resting = _with_rests(document, seen)
    if len(seen) == len(channels):
        return (
            "What is left looks like noise: no torque keeps more than 1.5 times the white noise that can be "
            f"in it{resting}."
        )
    rest = joined([name for name in channels if name not in seen])
    return f"What is left of {joined(seen)} looks like noise{resting}; for {rest} no noise can be read."


def _mostly_at_rest(document: Mapping[str, Any]) -> str:
    """That the errors are those of samples left out of the equations, of the worst channel of which no more
    is left than that; nothing where they are not."""
    after, left = document["error_percent"]["after"]["identify"], _left(document)
    more = [*document["unexplained"], *(f for f in document["findings"] if f.get("grade") == "partly")]
    lacking = {"total", *(f"{item['channel']}{joint}" for item in more for joint in item["joints"])}
    worst = _most_at_rest(after, left, [n for n in left if n not in lacking])
    if worst is None:
        return ""
    return (
        "The errors count samples that no equation does, as those at rest, where friction is anything: with "
        f"them {percent(after[worst])} of {worst} is left on the fitted runs, without {percent(left[worst])}."
    )


def _most_at_rest(
    after: Mapping[str, float], left: Mapping[str, float], channels: Sequence[str]
) -> str | None:
    """Of the channels of which far more is left with the samples at rest that with most of it."""
    more = [n for n in channels if after[n] > NOISY * left[n]]
    return max(more, key=lambda n: after[n] / left[n], default=None)


def _with_rests(document: Mapping[str, Any], channels: Sequence[str]) -> str:
    """That more is left with the samples at rest, where it is; the worst of the channels."""
    after, left = document["error_percent"]["after"]["identify"], _left(document)
    told = _told_of(document)
    worst = _most_at_rest(after, left, [n for n in channels if n not in told])
    if worst is None:
        return ""
    return (
        f", where its joint moves (with the samples at rest, where friction is anything, "
        f"{percent(after[worst])} of {worst} is left)"
    )


def _beyond_noise(document: Mapping[str, Any], above: Sequence[str]) -> str:
    """What is left of channels (`_above_noise`) that nothing is told of."""
    left, white = _left(document), document["white_noise_percent"]
    worst, *others = above
    beyond = (left[worst] ** 2 - white[worst] ** 2) ** 0.5
    more = f", and more than 1.5 times its own in {joined(others)}" if others else ""
    return (
        f"{percent(left[worst])} of {worst} is left on the fitted runs{_with_rests(document, above)} where "
        f"white noise alone would leave {percent(white[worst])}: {percent(beyond)} of the torque is beyond "
        f"it{more}, slow noise or what these motions do not tell from it."
    )


def _named(findings: Sequence[Mapping[str, Any]], most: int = 3) -> str:
    """The effects, strongest first, each with all its joints; no more than `most` of them by name."""
    joints: dict[str, list[int]] = {}
    for item in findings:
        joints.setdefault(item["effect"], []).extend(item["joints"])
    named = [f"{effect_name(name)} on {place(sorted(set(numbers)))}" for name, numbers in joints.items()]
    if len(named) > most:
        more = len(named) - most
        named = [*named[:most], f"{more} more effects" if more > 1 else "one more effect"]
    return joined(named)


def told(document: Mapping[str, Any]) -> list[str]:
    """A sentence for each finding, then for each unexplained structure."""
    return [finding_sentence(document, finding) for finding in document["findings"]] + [
        unexplained_sentence(item, sides_in_words(document)) for item in document["unexplained"]
    ]


NOISY = 1.5  # times its white noise, up to which what is left is called noise: as far as that may be off
