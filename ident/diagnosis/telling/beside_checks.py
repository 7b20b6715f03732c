"""Findings and what the examination says of the same recordings: each is told once, and neither against the
other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ident.diagnosis.extended.unanswered import read
from ident.diagnosis.telling.findings import ESTABLISHED, PARTLY, Alternative, Finding
from ident.examination.check import Check
from ident.examination.undone import undoing
from ident.recordings.study import Study
from modelgen.effects import catalogue
from modelgen.effects.effect import Effect


def beside_faults(findings: Sequence[Finding], standing: Sequence[Check]) -> tuple[Finding, ...]:
    """Beside a fault that nothing undid no effect explains what it seems to, but the one that the fault is
    told as. (Of a TX40 one of whose clocks is wrong 2.2 kg were told on a link in another run, of a Barrett
    with two rows of its file exchanged a base that is tilted by 40 degrees.)"""
    if not standing:
        return tuple(findings)
    return tuple(
        f if any(_told_of(f, check) for check in standing) else replace(f, grade=PARTLY) for f in findings
    )


def assumed(checks: Iterable[Check]) -> tuple[Check, ...]:
    """Of several causes that the recordings do not tell apart the first is undone: all else is told as if it
    were there. (An LWR4+ whose third joint was homed 90 degrees off was read with joints 3 and 6 exchanged,
    and its verdict was structure in joint 6; that of a rokae whose seventh torque is turned, or its position,
    that the torque is.)"""
    return tuple(c for c in checks if c.open and not c.hint and undoing(c) is not None)


def beside_doubts(
    findings: Sequence[Finding], doubts: Sequence[Check], fitted: Iterable[str]
) -> tuple[Finding, ...]:
    """What acts on torques in doubt (`unanswered`), or on the whole robot, explains a part at most; so does
    all that is found beside such torques of a run that is fitted, as the parameters of all torques answer to
    them. (Of a Franka whose fourth torque is 0.7 times as large late in the fitted run its seventh joint had
    hysteresis, which was kept away where the fourth is as it was.)"""
    in_doubt = {read(name) for check in doubts for name in check.signals}
    fit_in_doubt = of_fitted(doubts, fitted)

    def shaken(f: Finding) -> bool:
        return fit_in_doubt or (bool(in_doubt) and (not f.joints or bool(in_doubt & _signals_of(f))))

    return tuple(replace(f, grade=PARTLY) if shaken(f) else f for f in findings)


def of_fitted(doubts: Iterable[Check], fitted: Iterable[str]) -> bool:
    """Whether checks are of a run that is fitted, or of all."""
    return not {"", *fitted}.isdisjoint(check.recording for check in doubts)


def not_found(checks: Sequence[Check], findings: Sequence[Finding]) -> tuple[Check, ...]:
    """Checks that tell an effect, which nothing undid and which no finding is: these stand. (A rokae's third
    torque is 0.05 s late, said a check, and "fitted where judging runs show it": they did not.)"""
    told = (c for c in checks if _effects_of(c) and c.outcome == "warned" and not c.hint)
    return tuple(c for c in told if undoing(c) is None and not any(_told_of(f, c) for f in findings))


def told_by_checks(study: Study, mended: Study | None, checks: Sequence[Check]) -> tuple[Finding, ...]:
    """Faults that the examination undid, as findings: the effect that declares to be told by such a check."""
    if mended is None:
        return ()
    out = []
    for check in checks:
        effect = next(iter(_effects_of(check)), None)
        if effect is None or check.hint or undoing(check) is None:
            continue
        values: dict[str, dict[str, Any]] = {}
        if mended.gravity is not None and mended.gravity != study.gravity and not check.signals:
            values = {
                f"g{axis}": {"value": float(g), "std": None, "unit": "m/s^2", "at_bound": False}
                for axis, g in zip("xyz", mended.gravity)
            }
        if len(check.signals) == len(effect.reported) == 1:  # recorded: a number times what is there
            maps = [_map_of(its, check.signals[0], check.recording) for its in (study, mended)]
            before, after = (1.0 if its is None else its.scale for its in maps)
            gain = before / after
            if gain != 1.0:
                its = effect.reported[0]
                std = None if check.spread is None else gain * check.spread
                values[its.name] = {"value": gain, "std": std, "unit": its.unit, "at_bound": False}
        signals = [read(name) for name in check.signals]
        joints = tuple(joint for _, joint in signals)
        side = "tau_l" if any(its == "tau_l" for its, _ in signals) else "tau_m"
        where = {"recording": check.recording} if check.recording else {}
        out.append(
            Finding(
                effect.name, joints, side, where, values, 0.0, float("inf"), float("inf"), 0.0, (),
                check.remedy or effect.remedy, ESTABLISHED, check.message,
            )
        )  # fmt: skip
    return tuple(out)


def told_once(by_checks: Sequence[Finding], found: Sequence[Finding]) -> tuple[Finding, ...]:
    """What checks undid, then what was found; of one torque's factor that a check undid, and of which a
    remainder was found, the whole. (A gain of 1.09 was told as one of 1.1 and another of 0.990.)"""
    effects, left, out = catalogue(), list(found), []
    for f in by_checks:
        its = effects[f.effect]
        factor = len(f.parameters) == len(its.linear) == 1 and its.factor(np.ones(1)) != 1.0
        rest = next((r for r in left if factor and _of_one_torque(f, r)), None)
        if rest is not None:
            left.remove(rest)
            (name,) = f.parameters
            undone, remaining = f.parameters[name]["value"], rest.parameters[name]
            std = None if remaining["std"] is None else undone * remaining["std"]
            whole = {**remaining, "value": undone * remaining["value"], "std": std}
            f = replace(f, parameters={name: whole}, equivalent=rest.equivalent, picture=rest.picture)
        out.append(f)
    return (*out, *left)


def _of_one_torque(a: Finding, b: Finding) -> bool:
    """Whether two findings are the same effect on the same torque, in the same recordings."""
    return (a.effect, a.joints, a.channel, a.where.get("recording")) == (
        b.effect,
        b.joints,
        b.channel,
        b.where.get("recording"),
    )


def _map_of(study: Study, signal: str, recording: str) -> Any:
    """The column map of a signal: a recording's own, or the study's."""
    own = [e.columns[signal] for e in study.recordings if e.label == recording and signal in e.columns]
    return own[0] if own else study.columns.get(signal)


def in_doubt(findings: Sequence[Finding], checks: Sequence[Check]) -> tuple[Finding, ...]:
    """With the other signals where a check that tells the same effect leaves open of which signal it is. (Of
    two joints one torque is five times too large, or the other five times too small.)"""
    asked, out = [check for check in checks if check.open], []
    for f in findings:
        told_of = {its for check in asked if f.joints for its in _told_of(f, check)}
        others = told_of - _signals_of(f)
        told = (Alternative(f.effect, (joint,), None, None) for _, joint in sorted(others))
        out.append(replace(f, equivalent=(*f.equivalent, *told)))
    return tuple(out)


def _told_of(f: Finding, check: Check) -> set[tuple[str, int]]:
    """The signals of a check that tells a finding's effect, of one of its own or of all, too; of other checks
    none."""
    signals = {read(name) for name in check.signals}
    of_it = not f.joints or bool(signals & _signals_of(f))
    return signals if of_it and check.check in catalogue()[f.effect].told_by else set()


def _effects_of(check: Check) -> list[Effect]:
    """Those that are told by such a check."""
    return [effect for effect in catalogue().values() if check.check in effect.told_by]


def _signals_of(f: Finding) -> set[tuple[str, int]]:
    """Side and joint of each torque, and the positions of the joints."""
    return {(kind, joint) for joint in f.joints for kind in (f.channel, "q")}
