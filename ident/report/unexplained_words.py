"""Structure that no known effect explains, in a sentence: what it depends on, and what was nearest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ident.report.finding_words import effect_name, place, when
from ident.report.wording import joined, number, percent

PAST = {"memory": "where its joint came from"}  # signals that are none of a recording


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
            f"{sides} is of {item['recording']}{when(item)} "
            "alone, and no load or contact of the catalogue explains it: something happened there, or it "
            "alone shows what the model lacks; look at that stretch."
        )
    if item.get("oscillates"):
        at = f" at about {hz:.2g} Hz" if (hz := item.get("oscillates_hz")) else ""
        return (
            f"{text}{percent(item['share_of_residual_percent'])} of what the model leaves there "
            f"oscillates{at}: its past foretells it, and no function of the robot's signals was found that "
            "does (a vibration, a hum, a slosh, or a law that is none of these)."
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
    signals = joined([PAST.get(name, name) for name in item["depends_on"]])
    return f"{part} of what the model leaves there depends on {signals}"


def _as_nearest(item: Mapping[str, Any], near: Mapping[str, Any], sides: str) -> str:
    """What the nearest effect says of it."""
    name = f"{effect_name(near['effect'])} on {place(near['joints'])}"
    log_e = f"(log E {number(near['log_e'], 3)})"
    if not item["depends_on"]:
        return f"{name} says something of the judged {sides} {log_e}"
    return f"{_depends(item)}, as {name} would have it {log_e}"


def _too_poorly_told(item: Mapping[str, Any], near: Mapping[str, Any], chance: float, sides: str) -> str:
    """What the stretches of the recordings, or their bands, do not tell from nothing."""
    return (
        f"{_as_nearest(item, near, sides)}; but between stretches of the recordings, or bands of frequency, "
        f"its size changes so much that a fit does not tell it from zero (p {number(chance, 2)}); longer or "
        "more varied motion would."
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


AS_MUCH = 0.05  # nats: less is rounding
