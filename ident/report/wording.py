"""Names, rules, units and numbers as a reader of the report wants them."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ident.report.joints import named

FAR = 2.0  # from this ratio on an error is called larger than another; only words depend on it
NO_BREAK = "\u00a0"
_MEANINGS = {
    "Iam": "drive inertia (rotor and gear)",
    "Fvm": "viscous friction, motor side",
    "Fcm": "Coulomb friction, motor side",
    "Offm": "offset of motor torque",
    "Fvl": "viscous friction, link side",
    "Fcl": "Coulomb friction, link side",
    "Offl": "offset of torque sensor",
    "MX": "first moment along x",
    "MY": "first moment along y",
    "MZ": "first moment along z",
    "M": "mass",
}
_MEANINGS |= {name: f"inertia {name}, at the frame's origin" for name in ("XX", "XY", "XZ", "YY", "YZ", "ZZ")}
_BASE_NAME = re.compile(rf"({'|'.join(sorted(_MEANINGS, key=len, reverse=True))})(\d+|[A-Z]\w*?)(R?)$")


def meaning(name: str) -> str:
    """What a base parameter is: "Fvm3R" -> "viscous friction, motor side, joint 3, with others"."""
    found = _BASE_NAME.match(name)
    if not found:
        return ""
    kind, owner, regrouped = found.groups()
    if not owner.isdigit():
        place = f"payload {owner}"
    elif kind[-1] in "ml" and kind not in ("M",):
        place = f"joint {owner}"
    else:
        place = f"link {owner}"
    return f"{_MEANINGS[kind]}, {place}{', with others' if regrouped else ''}"


def readable_rule(rule: str) -> str:
    """A rule as it is written by hand: `rl3**2*(M3 + M4)` -> `rl3² (M3 + M4)`."""
    rule = re.sub(r"\*\*(\d)(?!\d)", lambda power: "⁰¹²³⁴⁵⁶⁷⁸⁹"[int(power[1])], rule)
    return rule.replace("*", NO_BREAK)


def readable_unit(unit: str) -> str:
    """`kg m^2` -> `kg m²`, never broken over two lines."""
    return unit.replace("^2", "²").replace("^3", "³").replace(" ", NO_BREAK)


def number(value: float | None, digits: int = 4) -> str:
    """Significant digits without an exponent where that stays short; a dash for nothing."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    if 1e-4 <= abs(value) < 1e6:
        decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
        return f"{value:.{decimals}f}"
    return f"{value:.{digits - 1}e}"


def percent(value: float | None) -> str:
    """9.04 -> `9.0 %`, 0.382 -> `0.38 %`."""
    return (
        "–"
        if value is None or not math.isfinite(value)
        else f"{number(value, 2 if abs(value) < 10 else 3)}{NO_BREAK}%"
    )


def holds_numbers(rows: Sequence[Sequence[str]], k: int) -> bool:
    """Whether column k of a table of texts is set flush right: not the first, which names its row."""
    return k > 0 and all(not row[k] or row[k][0].isdigit() or row[k][0] in "-+–" for row in rows)


def with_deviation(value: float, std: float, unit: str = "") -> str:
    """`3.1 ± 0.1 N m`: the value to the digit at which its standard deviation has two digits."""
    unit = "" if unit == "-" else unit
    if not (math.isfinite(std) and std > 0):
        return f"{number(value)} {readable_unit(unit)}".strip()
    decimals = max(1 - math.floor(math.log10(std)), 0)
    return f"{value:.{decimals}f} ± {std:.{decimals}f} {readable_unit(unit)}".strip()


def check_sentence(check: Mapping[str, Any], names: Mapping[str, str] | None = None) -> str:
    """An entry of `checks` as a line: `warning: run1: ...; remedy`. Names of joints (joints.py) go into the
    message; the remedy is to be copied as it is."""
    opening = "warning" if check["outcome"] == "warned" else check["outcome"]
    where = f"{check['recording']}: " if check.get("recording") else ""
    remedy = f"; {check['remedy']}" if check.get("remedy") else ""
    message = named(check["message"].rstrip("."), names or {})
    return f"{opening}: {where}{message}{remedy}"


def check_sentences(checks: Iterable[Mapping[str, Any]], names: Mapping[str, str] | None = None) -> list[str]:
    """A line for each check; what is said alike of several recordings is one."""
    alike: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for check in checks:
        alike.setdefault((check["outcome"], check["message"], check.get("remedy") or ""), []).append(check)
    out = []
    for first, *others in alike.values():
        labels = dict.fromkeys(c.get("recording") or "" for c in (first, *others))
        out.append(check_sentence({**first, "recording": "" if "" in labels else ", ".join(labels)}, names))
    return out


def joined(words: list[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}" if words else ""


def shares_rows(document: Mapping[str, Any], uses: Mapping[str, str], role: str) -> bool:
    """Whether checks found rows of a role's runs that are those of a role before it; uses: of recordings."""
    checks = document.get("checks") or ()
    return any(c["check"] == "same_rows" and uses.get(c["recording"]) == role != "identify" for c in checks)


def worse_elsewhere(errors: Mapping[str, Mapping[str, float | None]]) -> list[str]:
    """A sentence for each role whose runs have a much larger error than those that were fitted."""
    out = []
    for role, its in errors.items():
        ratio = {
            name: error / fitted
            for name, error in its.items()
            if role != "identify" and error and (fitted := errors["identify"].get(name))
        }
        far = {name: r for name, r in ratio.items() if r >= FAR}
        if not far:
            continue
        name = "total" if "total" in far else max(far, key=lambda key: far[key])
        of = "" if name == "total" else f" of {name}"
        out.append(
            f"The error{of} on {role} runs is {far[name]:.1f} times that of the fitted ones: these do not "
            "show all that the robot does there, or something is different there (a load, a day, a zero); "
            "look at what differs, and fit longer, faster or more varied motion."
        )
    return out
