"""Marks of one answer: a diagnosis document (contract 6) against the truth of its case."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

JOINTLESS = {"payload_change", "external_force", "base_tilt"}
# contract 7 has no such row, but a catalogue may be extended: these answers name what was put in
EQUIVALENT = {
    "position_friction": {"position_dependent_friction"},
    "cubic_spring": {"counterbalance"},
    "temperature_step": {"thermal_friction"},
    "saturation": {"current_saturation"},
    "cable": {"cable_coupling"},
    "damaged_tooth": {"gear_ripple"},
}
RATIOS = {
    *("Fc", "Fv", "off", "Ia", "Fs", "vs", "Fv3", "Fva", "mu", "a", "T", "sigma", "A", "wavenumber", "k"),
    *("gain", "delay", "gap", "m", "force", "slope", "roll", "pitch"),
}


@dataclass(slots=True)
class Mark:
    """What one case earned; counts are over findings, shares over parameters."""

    first_right: bool | None = None  # single: first finding is the effect on its joint
    first_effect_right: bool | None = None
    in_alternatives: bool = False  # the truth is among the first finding's alternatives
    named: int = 0  # effects put in that were named
    each: bool = False  # as many findings as effects put in, by effect
    put_in: int = 0
    false: list[str] = field(default_factory=list)
    silent: bool = False  # nothing named
    unexplained_right: bool | None = None
    equivalent_named: bool = False
    parameter_errors: list[tuple[str, float]] = field(default_factory=list)  # name, |error| / |truth|
    covered: list[tuple[str, bool]] = field(default_factory=list)
    answer: str = ""


def _joint_matches(effect: dict[str, Any], finding: dict[str, Any]) -> bool:
    joints = finding.get("joints") or []
    if effect["effect"] in JOINTLESS:
        return True
    if not effect["joints"]:  # a delay shared by all
        return not joints or len(joints) > 1
    return bool(set(effect["joints"]) & set(joints))


def _matches(effect: dict[str, Any], finding: dict[str, Any]) -> bool:
    same = effect["effect"] == finding.get("effect")
    same = same or finding.get("effect") in EQUIVALENT.get(effect["effect"], ())
    if effect["effect"] == "torque_ripple" and finding.get("effect") == "gear_ripple":
        same = True
    return same and _joint_matches(effect, finding)


def _flat(parameters: dict[str, float]) -> dict[str, float]:
    p = dict(parameters)
    if "fx" in p:
        p["force"] = float(np.sqrt(p.pop("fx") ** 2 + p.pop("fy") ** 2 + p.pop("fz") ** 2))
    return p


def _parameters(effect: dict[str, Any], finding: dict[str, Any], mark: Mark) -> None:
    truth, told = _flat(effect["parameters"]), finding.get("parameters") or {}
    for name, value in truth.items():
        entry = told.get(name)
        if not isinstance(entry, dict) or not isinstance(entry.get("value"), int | float):
            continue
        if name not in RATIOS or abs(value) < 1e-12:
            continue
        label = f"{effect['effect']}.{name}"
        mark.parameter_errors.append((label, abs(entry["value"] - value) / abs(value)))
        std = entry.get("std")
        if std is not None:
            mark.covered.append((label, abs(entry["value"] - value) <= 1.96 * std))


def describe(finding: dict[str, Any]) -> str:
    joints = ",".join(map(str, finding.get("joints") or []))
    return f"{finding.get('effect')}:{joints}"


def score(truth: dict[str, Any], document: dict[str, Any]) -> Mark:
    """Compare by the rules of the issue: first finding, further findings, unexplained joints, parameters."""
    findings, effects = document.get("findings") or [], truth["effects"]
    listed = [e for e in effects if e["listed"]]
    mark = Mark(silent=not findings, put_in=len({e["effect"] for e in listed}))
    unexplained = document.get("unexplained") or []
    mark.answer = "; ".join(describe(f) for f in findings) or document.get("verdict", "?")
    if unexplained:
        mark.answer += " | unexplained " + " ".join(
            "/".join(map(str, u.get("joints") or [])) + "(" + ",".join(u.get("depends_on") or []) + ")"
            for u in unexplained
        )
    for f in findings:
        if not any(_matches(e, f) for e in effects):
            mark.false.append(describe(f))
    mark.named = len({e["effect"] for e in listed if any(_matches(e, f) for f in findings)})
    told = Counter(f.get("effect") for f in findings if any(_matches(e, f) for e in effects))
    mark.each = all(told[name] >= k for name, k in Counter(e["effect"] for e in listed).items())
    if listed and findings:
        first = findings[0]
        mark.first_right = any(_matches(e, first) for e in listed)
        mark.first_effect_right = first.get("effect") in {e["effect"] for e in listed}
        mark.in_alternatives = any(
            _matches(e, a) for e in listed for a in first.get("alternatives") or [] if isinstance(a, dict)
        )
    elif listed:
        mark.first_right = mark.first_effect_right = False
    for e in listed:
        for f in findings:
            if _matches(e, f) and e["effect"] == f.get("effect"):
                same_joint = not e["joints"] or e["joints"] == (f.get("joints") or [])
                if same_joint or e["effect"] in JOINTLESS:
                    _parameters(e, f, mark)
                    break
    outside = [e for e in effects if not e["listed"]]
    if outside:
        mark.equivalent_named = any(_matches(e, f) for e in outside for f in findings)
        joints = set(outside[0]["joints"])
        there = any(joints & set(u.get("joints") or []) for u in unexplained)
        mark.unexplained_right = (there and not mark.false) or (mark.equivalent_named and not mark.false)
    return mark
