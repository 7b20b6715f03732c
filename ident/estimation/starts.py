"""Where the search for the parameters inside effects begins: each effect's own starts, screened linearly.

A start is judged by what its columns leave of the weighted residual when everything linear is fitted with
them. Columns are made on strided fine signals (fine.py), one pass over the recordings for all of them. The
best start need not lie in the valley of the best fit: several are handed over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ident.equations.attaching import Streams, factors_of
from ident.equations.columns import Columns
from ident.equations.fine import FineKeeper, FineSegment
from ident.equations.fitted import FittedModel
from ident.equations.observation import RecordingSystem, stack
from ident.equations.prepared import Prepared
from ident.equations.terms import Term, plain, with_terms
from ident.estimation.least_squares import weighted_factor
from ident.estimation.solving import estimate_all
from ident.recordings.study import Study
from ident.signals.decimation import FINE_HZ
from ident.signals.filtering import filter_stream
from ident.signals.neighbours import first_samples
from modelgen.geometry.place import Motion

PER_CUTOFF = 25.0  # fine samples a second and Hz of cut-off
CANDIDATES = 48  # starts that are screened together
SEVERAL = 5  # starts of an effect that are handed over


def fine_signals(
    prepared: Prepared, fitted: Sequence[RecordingSystem], streams: Streams, cutoff_hz: float
) -> tuple[FineSegment, ...]:
    """One a stretch that has rows, in the order of the systems, of as much of each as its system holds."""
    least = max(FINE_HZ, PER_CUTOFF * cutoff_hz)
    keeper = FineKeeper(prepared.columns, cutoff_hz, prepared.study.filter.order, least_hz=least)
    for system in fitted:
        stream, bank = streams[system.label]
        for index, block in first_samples(filter_stream(stream, bank), system.samples):
            keeper(stream, index, block)
    return keeper.segments(fitted)


def started(
    study: Study,
    fitted: Sequence[RecordingSystem],
    fine: Sequence[FineSegment],
    model: FittedModel,
    terms: Sequence[Term],
) -> list[tuple[Term, ...]]:
    """Terms with a start for every shape: given ones as they are, the others the best of the effect's own
    starts, one term after the other, on fine signals of the identify recordings. Behind them the same terms
    with another start in the place of one."""
    motions = [(segment, segment.motion) for segment in fine]
    residuals = [segment.measured - model.torque(motion) for segment, motion in motions]
    systems = tuple(fitted)
    out: list[Term] = []
    others: list[tuple[int, Term]] = []
    columns = model.columns
    for number, term in enumerate(terms):
        before = systems, columns
        trials = [term]
        if set(term.effect.nonlinear_names) - set(term.theta):
            trials = _best_starts(study, term, motions, residuals, model, systems, columns)
        placed, systems, columns = _placed(study, trials[0], motions, model, *before)
        for k, (_, motion) in enumerate(motions):
            for channel, found in _columns(placed, motion, model).items():
                residuals[k][:, channel] -= found @ np.array(placed.size)
        out.append(trials[0] if plain(term) else replace(trials[0], size=placed.size))
        for trial in trials[1:]:
            size = trial.size if plain(term) else _placed(study, trial, motions, model, *before)[0].size
            others.append((number, replace(trial, size=size)))
    return [tuple(out), *((*out[:k], term, *out[k + 1 :]) for k, term in others)]


def _placed(
    study: Study,
    term: Term,
    motions: Sequence[tuple[FineSegment, Motion]],
    model: FittedModel,
    systems: Sequence[RecordingSystem],
    columns: Columns,
) -> tuple[Term, tuple[RecordingSystem, ...], Columns]:
    """A term at the sizes that fit best at its shapes, with the systems and columns that have it."""
    systems, columns = _joined_term(systems, columns, term, motions, model)
    estimate, _ = estimate_all(systems, study, columns)
    size = estimate.chi[-len(term.unknown) :] if term.unknown else np.zeros(0)
    placed = term.moved(np.array([*size, *(term.theta[name] for name in term.free)]))
    return placed, systems, columns


def _columns(term: Term, motion: Motion, model: FittedModel) -> dict[int, np.ndarray]:
    return term.effect.columns(term.place, term.theta, np.array(term.size), motion, model, {})


def _best_starts(
    study: Study,
    term: Term,
    motions: Sequence[tuple[FineSegment, Motion]],
    residuals: Sequence[np.ndarray],
    model: FittedModel,
    systems: Sequence[RecordingSystem],
    columns: Columns,
) -> list[Term]:
    """The term at the starts that leave least of the weighted residual, the best one first, no two of which
    have a shape in common: neighbours lead to one place."""
    channel = next(iter(term.place.rows(model.channels)), 0)
    joint = model.columns.joint_of[channel]
    shown = [
        np.where(segment.certain[:, joint] > 0.5, rho[:, channel], np.nan)
        for (segment, _), rho in zip(motions, residuals)
    ]
    found = term.effect.starts(term.place, [motion for _, motion in motions], shown, model)
    points = {tuple(sorted({**start, **term.theta}.items())): None for start in found}
    points.setdefault(tuple(sorted(term.effect.complete(term.theta).items())))
    tries = [replace(term, theta=dict(point)) for point in points]
    losses: list[float] = []
    for first in range(0, len(tries), CANDIDATES):
        losses += _losses(study, tries[first : first + CANDIDATES], motions, model, systems, columns)
    out: list[Term] = []
    for k in np.argsort(losses, kind="stable"):
        own = set(tries[k].theta.items()) - set(term.theta.items())
        if len(out) < SEVERAL and not any(own & set(other.theta.items()) for other in out):
            out.append(tries[k])
    return out


def _losses(
    study: Study,
    tries: Sequence[Term],
    motions: Sequence[tuple[FineSegment, Motion]],
    model: FittedModel,
    systems: Sequence[RecordingSystem],
    columns: Columns,
) -> list[float]:
    """Weighted residual that each of them alone would leave."""
    b, p = len(columns.parameters), len(tries[0].linear)
    wide = systems
    for number, term in enumerate(tries):
        wide = _with_entries(wide, term, motions, model, b + number * p)
    wide = [replace(s, factors=factors_of(s.segments, s.channel, s.column, len(s.factors))) for s in wide]
    estimate, _ = estimate_all(systems, study, columns)
    R = weighted_factor(stack(wide), estimate.sigma, b + len(tries) * p)
    out = []
    for number in range(len(tries)):
        own = np.arange(b + number * p, b + (number + 1) * p)
        use = np.concatenate([np.append(estimate.active, np.zeros(len(tries) * p, bool)).nonzero()[0], own])
        part = R[:, [*use, -1]]
        scale = np.maximum(np.linalg.norm(part[:, :-1], axis=0), 1e-300)
        solution = np.linalg.lstsq(part[:, :-1] / scale, part[:, -1], rcond=1e-9)[0]
        out.append(float(np.sum((part[:, -1] - part[:, :-1] / scale @ solution) ** 2)))
    return out


def _joined_term(
    systems: Sequence[RecordingSystem],
    columns: Columns,
    term: Term,
    motions: Sequence[tuple[FineSegment, Motion]],
    model: FittedModel,
) -> tuple[tuple[RecordingSystem, ...], Columns]:
    """Systems and columns with the unknown sizes of one more term."""
    wide = with_terms(columns, [replace(term, free=())])
    found = _with_entries(systems, term, motions, model, len(columns.parameters))
    factors = [factors_of(s.segments, s.channel, s.column, len(s.factors)) for s in found]
    return tuple(replace(s, factors=f) for s, f in zip(found, factors)), wide


def _with_entries(
    systems: Sequence[RecordingSystem],
    term: Term,
    motions: Sequence[tuple[FineSegment, Motion]],
    model: FittedModel,
    first: int,
) -> list[RecordingSystem]:
    """Systems whose rows have the columns of a term's sizes from number `first` on, with the old factors."""
    rest = iter(motions)
    use = [k for k, name in enumerate(term.linear) if name in term.unknown]
    out = []
    for system in systems:
        segments, places = [], []
        for part, (segment, motion) in zip(system.segments, rest):
            found = _columns(term, motion, model)
            places = [(channel, first + k) for channel in sorted(found) for k in range(len(use))]
            values = [
                segment.decimate(found[c][:, use], int(model.columns.joint_of[c])).T * part.used[c]
                for c in sorted(found)
            ]
            segments.append(replace(part, values=np.vstack([part.values, *values]).astype(part.values.dtype)))
        new = np.array(places, int).reshape(-1, 2)
        out.append(
            replace(
                system,
                channel=np.concatenate([system.channel, new[:, 0]]),
                column=np.concatenate([system.column, new[:, 1]]),
                segments=tuple(segments),
            )
        )
    return out
