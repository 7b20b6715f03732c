"""How long the motion that a diagnosis offers would have to last: a bound by random motions.

`ident excite` starts from the best of a few random feasible motions and makes it better; these alone, under
the same limits and at the noise that was measured, take a second. What it designs needs no longer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import generated
from ident.cores import one_blas_thread
from ident.diagnosis.diagnosis import Diagnosis
from ident.diagnosis.telling.findings import Finding
from ident.diagnosis.telling.requests import request_of, robot_of, separable
from ident.errors import IdentError
from ident.excitation.known import Known, as_motion, standard_of
from ident.excitation.limits import bounds_of
from ident.excitation.motion import basis_for
from ident.excitation.optimal import random_motion
from ident.excitation.seen import Recordings, Seen, label_of, seen
from ident.excitation.separate import RATE_HZ, Imitation, Projector, Separation
from ident.excitation.so_far import so_far as read
from ident.excitation.so_far import written
from ident.excitation.suspects import suspects
from modelgen.errors import ModelgenError
from modelgen.geometry.robot_file import load_robot

PERIOD = 10.0  # s, as ident excite designs unless asked otherwise
DRAWS = 6


def with_offers(diagnosis: Diagnosis) -> Diagnosis:
    """Every finding with the seconds that a motion which tells it from its rivals takes at most."""
    with one_blas_thread():
        return replace(diagnosis, findings=tuple(_offered(f, diagnosis) for f in diagnosis.findings))


def _offered(finding: Finding, diagnosis: Diagnosis) -> Finding:
    its = {
        "effect": finding.effect,
        "joints": finding.joints,
        "parameters": finding.parameters,
        **finding.where,
    }
    if not any(separable(its, a.named) for a in finding.equivalent):
        return finding
    said = _seen(finding, diagnosis)
    if said is not None:  # rivals are told apart at the sizes that the recordings give them
        sized = (
            replace(a, parameters=said.parameters.get(label_of(a.named), {})) for a in finding.equivalent
        )
        finding = replace(finding, equivalent=tuple(sized))
    rivals = [a.named for a in finding.equivalent if separable(its, a.named)]
    last = diagnosis.last
    numbers = dict(zip(last.columns.parameters, last.estimate.chi.tolist()))
    percent = {**last.full_rate_error["identify"], **diagnosis.noise_floor_percent}
    seconds, so_far = seconds_offered(
        robot_of(last.study),
        last.study.model,
        numbers,
        {name: value for name, value in percent.items() if value > 0},
        [request_of(named) for named in (its, *rivals)],
        last.study.exact,
        said,
    )
    return replace(finding, seconds_offered=seconds, so_far=so_far)


def _seen(finding: Finding, diagnosis: Diagnosis) -> Seen | None:
    """What the recordings say of the finding and its rivals."""
    outcome = diagnosis.outcome
    steps = outcome.steps if outcome is not None else ()
    by_loop = (s for s in steps if s.term.effect.name == finding.effect)
    step = next((s for s in by_loop if float(s.evidence.log_e) == finding.log_e), None)
    if outcome is None or step is None:
        return None
    own = {"effect": finding.effect, "joints": finding.joints, **finding.where}
    term = next((t for t in outcome.last.terms if t.key == step.term.key), step.term)
    rivals = {label_of(a.named): e.term for a, e in zip(finding.equivalent, step.equivalent)}
    return seen(outcome.last, {label_of(own): term, **rivals})


def seconds_offered(
    source: str,
    model: str,
    numbers: Mapping[str, float],
    noise_percent: Mapping[str, float],
    requests: Sequence[str],
    exact: bool = False,
    seen: Seen | None = None,
) -> tuple[float | None, tuple[Mapping[str, Any], ...]]:
    """s of motion that judge until the suspects of `requests` are told apart in 99 of 100, None where no
    motion was found that tells them apart; and what the recordings say beside it, for diagnosis.json.

    numbers: {base parameter: value}; noise_percent: {channel: per cent of its rms torque}."""
    try:
        robot = load_robot(source, exact)
        bounds = bounds_of(robot)
        known = Known(robot, source, generated.load(source, model, exact=exact), standard_of(numbers, robot))
        holding, basis, rng = known.holding(bounds), basis_for(PERIOD), np.random.default_rng([0, 13])
        rest = holding.rest(None, rng)
        draws = [random_motion(holding, basis, rest, PERIOD, rng, False) for _ in range(DRAWS)]
        t, turn_over = np.arange(0.0, basis.period, 1 / RATE_HZ), 0.02 * bounds.dq
        motion = as_motion(draws[0].states(t), t, turn_over)
        sigma = known.sigma(motion, noise_percent)
        terms = suspects(known, requests, bounds, Projector(known, motion, sigma))
        separation = Separation(known, basis, sigma, turn_over, terms)
        if not separation.decides(draws[0].x):
            return None, ()
        tried = [(drawn, separation.each(drawn.x, warm=True)) for drawn in draws]
        best, each = min(tried, key=lambda its: separation.seconds(its[1]))
        so_far = _beside(seen, separation, Projector(known, separation.motion(best.x), sigma), each)
        found = separation.seconds(each, partial(read, so_far))
    except (IdentError, ModelgenError):  # it cannot be moved, or not be told: the command says why
        return None, ()
    return float(found) if np.isfinite(found) else None, so_far


def _beside(
    seen: Seen | None, separation: Separation, designed: Projector, each: Sequence[Imitation]
) -> tuple[Mapping[str, Any], ...]:
    if seen is None or not seen.ahead:
        return ()
    recordings, out = Recordings(designed.known, seen.motions, designed.sigma), []
    for at in range(0, len(each), 2):
        a, b = separation.pairs[at]
        ahead = seen.ahead.get((a.label, b.label))
        if ahead is not None:
            said = recordings.beside(designed, (a, b), each[at : at + 2])
            out.append(written(a.label, b.label, replace(said, ahead=ahead)))
    return tuple(out)
