"""What a diagnosis says, in sentences made from `diagnosis.json`. Nothing is decided here."""

from collections.abc import Mapping, Sequence
from typing import Any

from ident.diagnosis.telling.deciding import PATIENCE
from ident.report.wording import joined, number, percent, with_deviation, worse_elsewhere

PLACED = ("source_joint", "recording", "from", "to", "link")  # said as a place, not as a value
SIDES = {"motor": "motor side", "link": "link side", "sensor": "torque sensor", "drive": "drive"}
NOISY = 1.5  # times its white noise, up to which what is left is called noise: as far as that may be off
AS_MUCH = 0.05  # nats: less is rounding


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
    start, stop = finding.get("from"), finding.get("to")
    window = f" from {number(start)}" if start is not None else ""
    window += f"{' to' if window else ' until'} {number(stop)}" if stop is not None else ""
    window += " s" if window else ""
    if finding.get("recording"):
        parts.append(f"in {finding['recording']}{window}")
    elif window:
        parts.append(window.strip())
    return ", ".join(parts)


def verdict(document: Mapping[str, Any]) -> str:
    """The diagnosis in a sentence or two that an engineer can act on."""
    told = [f for f in document["findings"] if _by_examination(f)]
    found = [f for f in document["findings"] if not _by_examination(f)]
    sure = [f for f in found if f.get("grade") != "partly"]
    partly = [f for f in found if f.get("grade") == "partly"]
    sentences, worse = [], worse_elsewhere(document["error_percent"]["after"])
    for fault in document.get("unsettled", ())[:1]:
        first = (
            "Correct the robot file first, in whose equations all else is told"
            if fault["robot_file"]
            else "Settle first what was recorded, as all else is told with it in the data"
        )
        where = f"{fault['recording']}: " if fault["recording"] else ""
        sentences.append(f"{first}: {where}{fault['message'].rstrip('.')}.")
    if told:
        sentences.append(f"The data are not what the study says: {_named(told)}.")
    if sure:
        sentences.append(f"The model lacks {_named(sure)}.")
    if partly:
        sentences.append(f"What is left is partly explained by {_named(partly)}.")
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
    return " ".join([*sentences, *worse])


def hint_sentence(document: Mapping[str, Any], hint: Mapping[str, Any]) -> str:
    """What may be there, and why it is not told."""
    judged = document.get("judged") or {}
    asked = judged.get("log_e_asked")
    against = "" if asked is None else f", where {number(asked, 2)} is asked"
    rivals = joined([f"{effect_name(r['effect'])} on {_where(r)}" for r in hint.get("equivalent") or ()])
    instead = f", or instead at {rivals}," if rivals else ""
    rows = rows_in_words(judged) + ("," if judged.get("apart") else "")
    return (
        f"They hint at {effect_name(hint['effect'])} on {_where(hint)}{instead} with "
        f"log E = {number(hint['log_e'], 2)}{against}; it is not told because only {hint['blocks_for']} of "
        f"{hint['blocks']} blocks of {rows} speak for it. A longer run to judge it by would tell."
    )


def _above_noise(document: Mapping[str, Any]) -> list[str]:
    """Channels of which nothing is told and whose error on the fitted runs is more than noise, the worst
    first."""
    after, white = document["error_percent"]["after"]["identify"], document.get("white_noise_percent", {})
    told = [*document["findings"], *document["unexplained"]]
    known = {"total", *(f"{item['channel']}{joint}" for item in told for joint in item["joints"])}
    above = (n for n in after if n not in known and white.get(n) and (after[n] or 0.0) > NOISY * white[n])
    return sorted(above, key=lambda n: -after[n] / white[n])


def left_in_words(document: Mapping[str, Any]) -> str:
    """What the last fit leaves of the fitted runs, against white noise where that can be read."""
    after, white = document["error_percent"]["after"]["identify"], document.get("white_noise_percent", {})
    channels = [name for name in after if name != "total" and after[name] is not None]
    seen = [name for name in channels if white.get(name)]
    if not seen:
        return (
            f"{percent(after['total'])} of the torque is left on the fitted runs; whether that is noise is "
            "not known: no noise can be read off these recordings."
        )
    if above := _above_noise(document):
        return _beyond_noise(document, above)
    if len(seen) == len(channels):
        return (
            "What is left looks like noise: no torque keeps more than 1.5 times the white noise that can be "
            "in it."
        )
    rest = joined([name for name in channels if name not in seen])
    return f"What is left of {joined(seen)} looks like noise; for {rest} no noise can be read."


def _beyond_noise(document: Mapping[str, Any], above: Sequence[str]) -> str:
    """What is left of channels (`_above_noise`) that nothing is told of."""
    after, white = document["error_percent"]["after"]["identify"], document["white_noise_percent"]
    worst, *others = above
    beyond = (after[worst] ** 2 - white[worst] ** 2) ** 0.5
    more = f", and more than 1.5 times its own in {joined(others)}" if others else ""
    return (
        f"{percent(after[worst])} of {worst} is left on the fitted runs where white noise alone would leave "
        f"{percent(white[worst])}: {percent(beyond)} of the torque is beyond it{more}, slow noise or what "
        "these motions do not tell from it."
    )


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
    values = [_value(name, its) for name, its in finding["parameters"].items() if not _placed(name, its)]
    text += "".join(f", {value}" for value in values) + _error_in_words(document, finding)
    if rivals := rivals_in_words(finding):
        text += f". These data cannot reject instead: {rivals}"
    return text + "." + separated_in_words(finding)


def _value(name: str, its: Mapping[str, Any]) -> str:
    if isinstance(its["value"], str):
        return f"{name} {its['value']}"
    text = f"{name} = {with_deviation(its['value'], its.get('std') or 0.0, its.get('unit') or '')}"
    return f"{text} (the end of the searched range)" if its.get("at_bound") else text


def _placed(name: str, its: Mapping[str, Any]) -> bool:
    return name in PLACED and not its.get("std")


def rivals_in_words(finding: Mapping[str, Any]) -> str:
    """The explanations that these data cannot reject beside the finding's own."""
    return joined([f"{effect_name(r['effect'])} on {_where(r)}" for r in finding.get("equivalent") or ()])


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
    if _by_examination(finding):
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
    if _by_examination(finding):
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


def unexplained_sentence(item: Mapping[str, Any], sides: str = "runs") -> str:
    """Signals, share, nearest effect and what speaks against it; that it does not carry over."""
    text = f"{place(item['joints']).capitalize()}, {item['channel']}: "
    near = item.get("nearest")
    if near is not None and (item.get("parameters_change_times_noise") or _of_its_kind(item)) is not None:
        return text + _among_changes(item, near, sides)
    if near is not None and item.get("nearest_by_chance") is not None:
        return text + _too_poorly_told(item, near, item["nearest_by_chance"], sides)
    if near is not None and item.get("error_percent_with_nearest") is not None:
        return text + _worse_with_it(item, near, item["error_percent_with_nearest"], sides)
    if near is not None and not item["depends_on"]:
        return (
            f"{text}{_as_nearest(item, near, sides)}, but fitted to these recordings it is not possible (a "
            "mass that is negative, a shape that ends where its search does): something is there, and it "
            "is not this."
        )
    if not item["depends_on"]:
        share = item["share_of_residual_percent"]
        if share < 100:
            return (
                f"{text}{percent(share)} of what is left on the judged {sides} is not in the fitted ones, "
                "and nothing known explains it; fit longer, faster or more varied motion."
            )
        return f"{text}on some run the model predicts it worse than none would; nothing known explains it."
    if item.get("recording") is not None:
        return (
            f"{text}{percent(item['share_of_residual_percent'])} of what the model leaves on the fitted "
            f"{sides} is of {item['recording']} from {number(item['from'], 3)} to {number(item['to'], 3)} s "
            "alone, and no load or contact of the catalogue explains it: something happened there; look at "
            "that stretch, or leave it out."
        )
    if item["depends_on"] == ["t"] and item.get("carries_over") is False:
        return (
            f"{text}{percent(item['share_of_residual_percent'])} of what the model leaves there "
            "oscillates: its past foretells it, and no function of the robot's signals was found that does "
            "(a vibration, a slosh, or a law that is none of these)."
        )
    alike = list(item.get("or_on") or ())
    shape = (
        f"or on {', '.join(alike)}, which move alike in these recordings: these do not show on which."
        if alike
        else "and no effect of the catalogue has that shape."
    )
    text += f"{_depends(item)}, {shape}"
    if item.get("judged_could_show_it") is False:
        text += f" It is in the fitted {sides}; the judged {sides} do not go where it acts, or hardly."
    elif item.get("carries_over") is False:
        text += f" It is in the fitted {sides} and does not carry over to the judged {sides}."
    if near is not None and item.get("carries_over") is False:
        text += (
            f" {effect_name(near['effect']).capitalize()} on {place(near['joints'])} says something of the "
            f"judged {sides} (log E {number(near['log_e'], 3)}), and not enough beside this to be named."
        )
    elif near is not None:
        own, its, against = item.get("log_e"), near.get("log_e"), ""
        if own is not None and its is not None:
            against = f" (log E {number(its, 3)}, {_against(own - its)}{_on_fitted(item, sides)})"
        text += f" Nearest is {effect_name(near['effect'])} on {place(near['joints'])}{against}."
    return text


def _against(short: float) -> str:
    """By how many nats an effect falls short of what was said, as far as these are told apart."""
    if abs(short) < AS_MUCH:
        return "as much as that"
    return f"{number(short, 3)} short of it" if short > 0 else f"{number(-short, 3)} more than that"


def _on_fitted(item: Mapping[str, Any], sides: str) -> str:
    """What keeps an effect away that the judged rows alone would let pass."""
    nats = item.get("on_fitted_runs")
    if nats is None:
        return ""
    short = _against(nats["functions"] - nats["nearest"])
    return f"; on the fitted {sides} {number(nats['nearest'], 3)}, {short}"


def _depends(item: Mapping[str, Any]) -> str:
    share = item["share_of_residual_percent"]
    part = "a part too small to show" if share < 0.05 else percent(share)
    return f"{part} of what the model leaves there depends on {joined(list(item['depends_on']))}"


def _as_nearest(item: Mapping[str, Any], near: Mapping[str, Any], sides: str) -> str:
    """What the nearest effect says of it."""
    name = f"{effect_name(near['effect'])} on {place(near['joints'])}"
    log_e = f"(log E {number(near['log_e'], 3)})"
    if not item["depends_on"]:
        return f"{name} says something of the judged {sides} {log_e}"
    return f"{_depends(item)}, as {name} would have it {log_e}"


def _too_poorly_told(item: Mapping[str, Any], near: Mapping[str, Any], chance: float, sides: str) -> str:
    """What the stretches of the recordings do not tell from nothing."""
    return (
        f"{_as_nearest(item, near, sides)}; but between stretches of the recordings its size changes so much "
        f"that a fit does not tell it from zero (p {number(chance, 2)}); longer or more varied motion would."
    )


def _worse_with_it(
    item: Mapping[str, Any], near: Mapping[str, Any], errors: Mapping[str, float], sides: str
) -> str:
    """What explains slow parts of the torque and no instants."""
    return (
        f"{_as_nearest(item, near, sides)}; but fitted whole it predicts the judged {sides} no better "
        f"({percent(errors['without'])} without it, {percent(errors['with'])} with it): something is there, "
        "and it is not this, or these recordings do not tell when it acts."
    )


def _of_its_kind(item: Mapping[str, Any]) -> float | None:
    return item.get("its_kind_changes_times_noise")


def _among_changes(item: Mapping[str, Any], near: Mapping[str, Any], sides: str) -> str:
    """What is no more than what the model gets wrong from one run to the next."""
    times = item.get("parameters_change_times_noise") or _of_its_kind(item)
    what = "the model's own parameters" if _of_its_kind(item) is None else "others of its kind"
    return (
        f"{_as_nearest(item, near, sides)}; but from the fitted to the judged {sides} {what} change "
        f"{number(times, 2)} times as much as noise makes them (squares), and beside such changes that is "
        "not enough to name it."
    )


def told(document: Mapping[str, Any]) -> list[str]:
    """A sentence for each finding, then for each unexplained structure."""
    return [finding_sentence(document, finding) for finding in document["findings"]] + [
        unexplained_sentence(item, sides_in_words(document)) for item in document["unexplained"]
    ]


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


def _by_examination(finding: Mapping[str, Any]) -> bool:
    """Told by a check of the data: no fit weighed it."""
    return "log_e" in finding["evidence"] and finding["evidence"]["log_e"] is None


def _where(rival: Mapping[str, Any]) -> str:
    """ "joint 2", or "link 3" of a load; in which recording, where that is another one."""
    body = rival.get("link") and not rival["joints"]
    here = f"link {rival['link']}" if body else place(rival["joints"])
    return here + (f" in {rival['recording']}" if rival.get("recording") else "")


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


def _error_in_words(document: Mapping[str, Any], finding: Mapping[str, Any]) -> str:
    """Error of the finding's own channel on the runs that were used least, all findings in; of what is in a
    run that judges, on that run, whose rows its size was found on."""
    errors, role = document["error_percent"], held_out(document)
    where = f"{role} runs"
    judged, run = document.get("judged") or {}, str(finding.get("recording"))
    if judged.get("apart") and run in (judged.get("recordings") or ()):
        errors, role, where = document["error_percent_by_recording"], run, f"{run}, which told its size,"
    before, after = errors["before"], errors["after"]
    channel = f"{finding['channel']}{finding['joints'][0]}" if finding["joints"] else "total"
    if before[role].get(channel) is None or after[role].get(channel) is None:
        return ""
    name = "all channels" if channel == "total" else channel
    text = f"; error of {name} on {where} {percent(before[role][channel])} → {percent(after[role][channel])}"
    floor = document.get("noise_floor_percent", {}).get(channel)
    where = "" if role == "identify" else " of the fitted runs"
    return text if floor is None else f"{text}, noise floor{where} {percent(floor)}"
