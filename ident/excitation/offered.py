"""How long the motion that a diagnosis offers would have to last: a bound by random motions.

`ident excite` starts from the best of a few random feasible motions and makes it better; these alone, under
the same limits and at the noise that was measured, take a second. What it designs needs no longer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

import generated
from ident.diagnosis.diagnosis import Diagnosis
from ident.diagnosis.findings import Finding
from ident.diagnosis.requests import request_of, robot_of, separable
from ident.errors import IdentError
from ident.excitation.known import Known, as_motion, standard_of
from ident.excitation.limits import bounds_of
from ident.excitation.motion import basis_for
from ident.excitation.optimal import random_motion
from ident.excitation.separate import RATE_HZ, Projector, Separation
from ident.excitation.suspects import suspects
from modelgen.errors import ModelgenError
from modelgen.geometry.robot_file import load_robot

PERIOD = 10.0  # s, as ident excite designs unless asked otherwise
DRAWS = 6


def with_offers(diagnosis: Diagnosis) -> Diagnosis:
    """Every finding with the seconds that a motion which tells it from its rivals takes at most."""
    return replace(diagnosis, findings=tuple(_offered(f, diagnosis) for f in diagnosis.findings))


def _offered(finding: Finding, diagnosis: Diagnosis) -> Finding:
    its = {
        "effect": finding.effect,
        "joints": finding.joints,
        "parameters": finding.parameters,
        **finding.where,
    }
    rivals = [a.named for a in finding.equivalent if separable(its, a.named)]
    if not rivals:
        return finding
    last = diagnosis.last
    numbers = dict(zip(last.columns.parameters, last.estimate.chi.tolist()))
    percent = {**last.full_rate_error["identify"], **diagnosis.noise_floor_percent}
    seconds = seconds_offered(
        robot_of(last.study),
        last.study.model,
        numbers,
        {name: value for name, value in percent.items() if value},
        [request_of(named) for named in (its, *rivals)],
        last.study.exact,
    )
    return replace(finding, seconds_offered=seconds)


def seconds_offered(
    source: str,
    model: str,
    numbers: Mapping[str, float],
    noise_percent: Mapping[str, float],
    requests: Sequence[str],
    exact: bool = False,
) -> float | None:
    """s of motion that judge until the suspects of `requests` are told apart in 99 of 100; None where no
    motion was found that tells them apart.

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
        separation, found = Separation(known, basis, sigma, turn_over, terms), np.inf
        if not separation.decides(draws[0].x):
            return None
        for drawn in draws:
            asked = separation.asked(separation.each(drawn.x, warm=True))
            found = min(found, max((its.seconds for its, _ in asked), default=np.inf))
    except (IdentError, ModelgenError):  # it cannot be moved, or not be told: the command says why
        return None
    return float(found) if np.isfinite(found) else None
