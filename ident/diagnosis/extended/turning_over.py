"""How dry friction turns over in the model that is handed over."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ident.diagnosis.evidence.state import State
from ident.diagnosis.extended.on_judging_runs import judged_error, spoilt
from ident.estimation.fit import Examined, FitResult, fit_study
from ident.progress import Progress
from ident.recordings.study import Study
from ident.signals.filtering import STEEPNESS, prepare


def turned_as_found(last: FitResult, state: State, known: Examined, progress: Progress) -> FitResult:
    """The same with dry friction turning over as the loop found it, on the joints whose error that lowers
    on the rows that chose nothing."""
    keys = _dry_keys(state, last)
    if not keys:
        return last

    def fitted(keys: Mapping[str, tuple[float, ...]]) -> FitResult:
        turned = last.study.with_(**keys)
        return fit_study(turned, progress=progress, known=known.again(turned))

    trial = fitted(keys)
    before, after = judged_error(last), judged_error(trial)
    helped = np.zeros(len(next(iter(keys.values()))), bool)
    for name, channel in zip(last.columns.channels, last.columns.need.channels):
        helped[channel.joint] |= after[name] < before[name]
    if helped.all():
        return last if spoilt(trial, last) else trial
    kept = {key: tuple(v if h else 0.0 for v, h in zip(values, helped)) for key, values in keys.items()}
    kept = {key: values for key, values in kept.items() if any(values)}
    trial = fitted(kept) if kept else last
    return last if spoilt(trial, last) else trial


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


def _dry_keys(state: State, base: FitResult) -> dict[str, tuple[float, ...]]:
    """How dry friction turns over, as keys of a study; 0: the fit's own sign. No faster than that one: the
    rows of the diagnosis leave rest out, where a sharp sign of a noisy rate is noise."""
    own = [prepare(stream, base.study.filter).vs for stream in base.recordings]
    fastest = np.max([vs for vs in own if vs is not None], axis=0) / STEEPNESS
    rates, travels = np.zeros(len(fastest)), np.zeros(len(fastest))
    for j, turn in state.turns.items():
        travels[j] = turn.travel
        if turn.travel > 0 or turn.rate > fastest[j]:
            rates[j] = max(turn.rate, fastest[j])
    out = {"turn_over": tuple(map(float, rates)), "presliding": tuple(map(float, travels))}
    return {key: values for key, values in out.items() if any(values)}
