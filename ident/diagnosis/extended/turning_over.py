"""How dry friction turns over in the model that is handed over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ident.diagnosis.evidence.state import State
from ident.diagnosis.extended.on_judging_runs import judged_error, spoilt
from ident.estimation.fit import Examined, FitResult, fit_study
from ident.progress import Progress
from ident.recordings.study import Study
from ident.signals.dry_friction import TurnOver
from ident.signals.filtering import STEEPNESS, prepare


def turned_as_found(last: FitResult, state: State, known: Examined, progress: Progress) -> FitResult:
    """The same with dry friction turning over as the loop found it, on the joints whose error that lowers
    on the rows that chose nothing."""
    found = _turns(state, last)

    def fitted(turns: Sequence[TurnOver]) -> FitResult:
        if not any(turn.rate or turn.travel for turn in turns):
            return last
        turned = last.study.with_(**_keys(turns))
        return fit_study(turned, progress=progress, known=known.again(turned))

    trial = fitted(found)
    if trial is last:
        return last
    before, after = judged_error(last), judged_error(trial)
    helped = np.zeros(len(found), bool)
    for name, channel in zip(last.columns.channels, last.columns.need.channels):
        helped[channel.joint] |= after[name] < before[name]
    if not helped.all():
        trial = fitted([turn if h else TurnOver() for turn, h in zip(found, helped)])
    return last if trial is last or spoilt(trial, last) else trial


def turning_over(study: Study, last: FitResult) -> list[str]:
    """A note on the widths that the last fit took from the loop."""
    turns, prismatic = last.study.turn_overs, {str(j) for j in getattr(last.columns.model, "prismatic", ())}
    if turns == study.turn_overs:
        return []
    each = []
    for joint, turn in zip(last.columns.need.joints, turns):
        unit = "m" if str(joint) in prismatic else "rad"
        widths = [f"{turn.rate:.2g} {unit}/s"] * (turn.rate > 0) + [f"{turn.travel:.2g} {unit}"] * (
            turn.travel > 0
        )
        each += [f"{' and '.join(widths)} (joint {joint})"] if widths else []
    return [
        f"dry friction changes its sign within {', '.join(each)} in the model that is handed over: "
        "`turn_over` and `presliding` of the extended study"
    ]


def _turns(state: State, base: FitResult) -> list[TurnOver]:
    """How each joint's dry friction turns over; 0: the fit's own sign. No faster than that one: the rows of
    the diagnosis leave rest out, where a sharp sign of a noisy rate is noise."""
    own = [prepare(stream, base.study.filter).vs for stream in base.recordings]
    fastest = np.max([vs for vs in own if vs is not None], axis=0) / STEEPNESS
    found = [state.turns.get(j, TurnOver()) for j in range(len(fastest))]
    slower = [turn.travel > 0 or turn.rate > least for turn, least in zip(found, fastest)]
    return [
        replace(turn, rate=float(max(turn.rate, least))) if slow else TurnOver()
        for turn, least, slow in zip(found, fastest, slower)
    ]


def _keys(turns: Sequence[TurnOver]) -> dict[str, tuple[float, ...] | tuple[bool, ...]]:
    """As a study has them."""
    rates, travels, instant = zip(*((turn.rate, turn.travel, turn.instant) for turn in turns))
    keys = {"turn_over": rates, "presliding": travels, "instant_sign": instant}
    return {key: values for key, values in keys.items() if any(values)}
