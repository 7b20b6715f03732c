"""What a finding says, in sentences made from `diagnosis.json`. Nothing is decided here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ident.diagnosis.telling.deciding import PATIENCE
from ident.report.wording import joined, number, percent, with_deviation

PLACED = ("source_joint", "recording", "from", "to", "link")  # said as a place, not as a value
SIDES = {"motor": "motor side", "link": "link side", "sensor": "torque sensor", "drive": "drive"}


def effect_name(name: str) -> str:
    return name.replace("_", " ")


def place(joints: Sequence[int]) -> str:
    """`joint 4`, `joints 2 and 3`, `the whole robot`."""
    if not joints:
        return "the whole robot"
    return f"joint{'s' if len(joints) > 1 else ''} {joined([str(joint) for joint in joints])}"


def where(finding: Mapping[str, Any]) -> str:
    """`joint 6, motor side, driven by joint 5, in run2 from 12 to 15.5 s`."""
    parts = [place(finding["joints"])]
    if finding.get("side"):
        parts.append(SIDES.get(finding["side"], finding["side"]))
    if finding.get("link") is not None:
        parts.append(f"link {finding['link']}")
    if finding.get("source_joint") is not None:
        parts.append(f"from joint {finding['source_joint']}")
    window = when(finding)
    if finding.get("recording"):
        parts.append(f"in {finding['recording']}{window}")
    elif window:
        parts.append(window.strip())
    return ", ".join(parts)


def when(its: Mapping[str, Any]) -> str:
    """` from 12 to 15.5 s after its start (stamps from 41.3 to 44.8 s)`; no stamps where these begin with
    zero."""
    if its.get("from") is None and its.get("to") is None:
        return ""

    def window(offset: float) -> str:
        start, stop = (None if its.get(k) is None else number(its[k] + offset) for k in ("from", "to"))
        if start is None:
            return f"until {stop} s"
        return f"from {start}{'' if stop is None else f' to {stop}'} s"

    told, stamps = window(0.0), window(its.get("first_stamp") or 0.0)
    return f" {told}" if stamps == told else f" {told} after its start (stamps {stamps})"


def visible_in_words(document: Mapping[str, Any]) -> str:
    """What "nothing else" means: how large an effect of the catalogue must have been to be seen."""
    shares: dict[int, list[float]] = {}
    for its in document.get("smallest_visible") or ():
        shares.setdefault(its["joints"][0], []).append(100 * its["share"])
    if not shares:
        return ""
    middle = {joint: sorted(own)[len(own) // 2] for joint, own in sorted(shares.items())}
    half = joined([f"{percent(share)} (joint {joint})" for joint, share in middle.items()])
    return (
        "An effect of at least the size stated for it would have been seen in 95 of 100 such recordings: "
        f"half of the effects from {half} of the joint's torque on. The report states each one's size."
    )


def visible_size(its: Mapping[str, Any]) -> str:
    """`Fs = 0.3 N m, at vs = 0.1 rad/s`: the smallest size seen, and the shape that it was asked for."""
    values = {
        name: f"{name} = {number(v['value'], 3)} {'' if v['unit'] == '-' else v['unit']}".rstrip()
        for name, v in its["parameters"].items()
    }
    size = ", ".join(values[name] for name in its["sizes"] if name in values)
    shape = ", ".join(text for name, text in values.items() if name not in its["sizes"])
    return f"{size}, at {shape}" if size and shape else size or shape


def finding_sentence(document: Mapping[str, Any], finding: Mapping[str, Any]) -> str:
    """`Joint 4, motor side: stribeck friction, Fs = 3.1 ± 0.1; error of tau_m4 on test runs 5 % → 2 %.`"""
    grade = "partly explained by " if finding.get("grade") == "partly" else ""
    here = where(finding)
    text = f"{here[0].upper()}{here[1:]}: {grade}{effect_name(finding['effect'])}"
    values = [_value(name, its) for name, its in _told(finding["parameters"]).items()]
    text += "".join(f", {value}" for value in values) + _error_in_words(document, finding)
    if rivals := rivals_in_words(finding):
        text += f". These data cannot reject instead: {rivals}"
    return text + "." + separated_in_words(finding)


def _value(name: str, its: Mapping[str, Any]) -> str:
    if isinstance(its["value"], str):
        return f"{name} {its['value']}"
    text = f"{name} = {with_deviation(its['value'], its.get('std') or 0.0, its.get('unit') or '')}"
    return f"{text} (the end of the searched range)" if its.get("at_bound") else text


def _told(parameters: Mapping[str, Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """What is a value of its own: no place, and, where a fit measured others, nothing that it held at zero.
    (Of a joint that yields `Iam = 0 kg m²` was told: the model has that rotor already.)"""
    values = {n: p for n, p in parameters.items() if n not in PLACED or p.get("std")}
    measured = any(p.get("std") for p in values.values())
    return {n: p for n, p in values.items() if p.get("std") or p["value"] != 0 or not measured}


def rivals_in_words(finding: Mapping[str, Any]) -> str:
    """The explanations that these data cannot reject beside the finding's own, each once: one that only has
    other parameters of the same effect in the same place reads the same."""

    def words(its: Mapping[str, Any]) -> str:
        return f"{effect_name(its['effect'])} on {rival_place(its, finding.get('side'))}"

    every = dict.fromkeys(words(rival) for rival in finding.get("equivalent") or ())
    return joined([its for its in every if its != words(finding)])


def separated_in_words(finding: Mapping[str, Any]) -> str:
    """The command whose motion tells the explanations apart, and how long it takes."""
    its = finding.get("separate") or {}
    if not its.get("command"):
        return ""
    made, recorded = its.get("seconds"), its.get("seconds_as_recorded")
    here = "never, for they look the same" if recorded is None else _long(recorded)
    sure = "To tell in 99 of 100 cases, at the noise measured, takes"
    if made is None or made > PATIENCE:
        much = "no motion that was tried does" if made is None else f"up to {_long(made)} of one made for it"
        return (
            f" {sure} too long: in motion as in these recordings {here}, and {much}; wider limits, "
            f"less noise or a sensor beside the torque may tell. The search for a motion: {its['command']}"
        )
    return (
        f" {sure} at most {_long(made)} of a motion made for it to judge and as much to fit, in motion as in "
        f"these recordings {here}: {its['command']}"
    )


def _long(seconds: float) -> str:
    return f"{number(seconds / 3600, 2)} h" if seconds > PATIENCE else f"about {number(seconds, 2)} s"


def evidence_in_words(document: Mapping[str, Any], finding: Mapping[str, Any]) -> str:
    """log E, blocks and on which rows."""
    if by_examination(finding):
        return "Seen when the recordings were examined, before any fit; undone for everything that follows."
    evidence, judged = finding["evidence"], document.get("judged") or {}
    text = f"log E = {number(evidence.get('log_e'), 3)} on {rows_in_words(judged)}"
    if judged.get("log_e_asked") is not None:
        rate = percent(100 * document.get("alpha", 0.01))
        text += (
            f"; {number(judged['log_e_asked'], 2)} is asked, so that at most {rate} of studies are told wrong"
        )
    if evidence.get("blocks"):
        text += f". {evidence['blocks_for']} of {evidence['blocks']} blocks of these rows speak for it"
    return text + "."


def rows_in_words(judged: Mapping[str, Any]) -> str:
    """The rows that chose nothing."""
    names = joined(list(judged.get("recordings") or ()))
    if not names:
        return "rows that chose nothing"
    return (
        f"{names}, which chose nothing" if judged.get("apart") else f"stretches of {names} that chose nothing"
    )


def mind_in_words(finding: Mapping[str, Any]) -> str:
    """What would change our mind about a finding."""
    commands = [r["separate"] for r in finding.get("equivalent") or () if r.get("separate")]
    if by_examination(finding):
        return "A fit with the study as it was whose friction, inertia and error are no worse."
    text = "A new recording (use: validate) that the model with it does not predict better than without it"
    return (
        text
        + ("; to tell the explanations apart, the motion of " + " or ".join(commands[:2]) if commands else "")
        + "."
    )


def sides_in_words(document: Mapping[str, Any]) -> str:
    """What was fitted and what judged: whole runs, or stretches of the same ones."""
    judged = document.get("judged") or {}
    return "stretches" if judged.get("recordings") and not judged.get("apart") else "runs"


def before_and_after(document: Mapping[str, Any]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows of the error table: per channel before and after for each role, the noise floor, and
    what of it is white."""
    before, after = document["error_percent"]["before"], document["error_percent"]["after"]
    floor, white = document.get("noise_floor_percent", {}), document.get("white_noise_percent", {})
    pairs = [(role, when) for role in before for when in ("before", "after")]
    rows = []
    for channel in next(iter(before.values())):
        values = [{"before": before, "after": after}[when][role].get(channel) for role, when in pairs]
        noise = (floor.get(channel), white.get(channel))
        shown = ["" if value is None else f"{value:.2f}" for value in (*values, *noise)]
        rows.append((channel, *shown))
    return ("channel", *(f"{role} {when}" for role, when in pairs), "noise floor", "white"), rows


def held_out(document: Mapping[str, Any]) -> str:
    """The role whose runs were used least."""
    before = document["error_percent"]["before"]
    return next((role for role in ("test", "validate") if role in before), "identify")


def by_examination(finding: Mapping[str, Any]) -> bool:
    """Told by a check of the data: no fit weighed it."""
    return "log_e" in finding["evidence"] and finding["evidence"]["log_e"] is None


def errors_about(
    document: Mapping[str, Any], item: Mapping[str, Any], key: str = "error_percent"
) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """Errors before and after what is found; faults that checks undid stand before all else. (Of two currents
    exchanged a friction was told to take 39 % to 8: without them it was 8 to 8.)"""
    before, after = document[key]["before"], document[key]["after"]
    undone = (document.get("faults_undone") or {}).get(key)
    if undone is None:
        return before, after
    return (before, undone) if "evidence" in item and by_examination(item) else (undone, after)


def rival_place(rival: Mapping[str, Any], side: str | None = None) -> str:
    """ "joint 2", or "link 3" of a load; on which side, where that is not the finding's `side`; in which
    recording, where that is another one."""
    body = rival.get("link") and not rival["joints"]
    here = f"link {rival['link']}" if body else place(rival["joints"])
    its = rival.get("side")
    steady = its == "link" and not rival["joints"]  # a load: all that it can be on
    if its not in (None, side) and not steady:
        here += f", {SIDES.get(its, its)}"
    return here + (f" in {rival['recording']}" if rival.get("recording") else "")


def _error_in_words(document: Mapping[str, Any], finding: Mapping[str, Any]) -> str:
    """Error of the finding's own channel on the runs that were used least, all findings in; of what is in a
    run that judges, on that run, whose rows its size was found on."""
    key, role = "error_percent", held_out(document)
    where = f"{role} runs"
    judged, run = document.get("judged") or {}, str(finding.get("recording"))
    if judged.get("apart") and run in (judged.get("recordings") or ()):
        key, role, where = "error_percent_by_recording", run, f"{run}, which told its size,"
    before, after = errors_about(document, finding, key)
    channel = f"{finding['channel']}{finding['joints'][0]}" if finding["joints"] else "total"
    if before[role].get(channel) is None or after[role].get(channel) is None:
        return ""
    name = "all channels" if channel == "total" else channel
    text = f"; error of {name} on {where} {percent(before[role][channel])} → {percent(after[role][channel])}"
    text += _where_it_counts(document, channel, after[role][channel] - before[role][channel])
    floor = document.get("noise_floor_percent", {}).get(channel)
    where = "" if role == "identify" else " of the fitted runs"
    return text if floor is None else f"{text}, noise floor{where} {percent(floor)}"


def _where_it_counts(document: Mapping[str, Any], channel: str, more: float) -> str:
    """The errors of the samples alone that the equations count, where those of all are no smaller with what
    is found: at rest friction is anything, and so is the place of a gear in its play."""
    both = [
        document.get("error_percent_counted", {}).get(when, {}).get(channel) for when in ("before", "after")
    ]
    if more < 0 or None in both or not both[1] < both[0]:
        return ""
    return f" with the samples at rest, {percent(both[0])} → {percent(both[1])} of those that equations count"
