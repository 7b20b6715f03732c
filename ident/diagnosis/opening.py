"""A study as the diagnosis opens it: the fit's own equations, at a higher cut-off, with the fine signals
beside.

Rows go up to the study's position cut-off, or a twelfth of the slowest recording's rate; positions are then
filtered at four times that, so that the rows' own filter is what limits both sides of the equations. Of long
recordings the diagnosis takes stretches spread over them: its cost does not grow with the log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.fine import FineKeeper, FineSegment
from ident.diagnosis.rows import Rows, rows_of
from ident.diagnosis.state import Found, Problem, State, first_state, settled
from ident.diagnosis.terms import Term
from ident.diagnosis.turn_over import Dry
from ident.equations.build import build
from ident.equations.observation import DecimatedSegment, RecordingSystem
from ident.equations.placing import layout_of, terms_of
from ident.equations.prepared import Prepared
from ident.progress import Progress, silent
from ident.signals.filtering import prepare
from modelgen.effects.place import Layout
from modelgen.geometry.names import ParameterName

DRY = ("Fcm", "Fcl")  # kinds of parameters whose columns are signs
PER_RATE = 12.0  # samples a second and Hz of cut-off, at least
PREFILTER = 4.0  # of the rows' cut-off
HIGHEST = 0.4  # of the rate
ROWS_A_SIDE = 7000  # rows of the fitted, and of the judged recordings; more are thinned by stretches
STRETCH_S = 20.0  # s


@dataclass(frozen=True)
class Opened:
    """Layout of the places, and the rigid model with the study's own effects, settled."""

    layout: Layout
    state: State
    cutoff_hz: float
    thinned: bool


def diagnosis_cutoff(prepared: Prepared) -> float:
    """Hz of the rows that the diagnosis looks at."""
    slowest = min(stream.rate_hz for stream in prepared.streams)
    return min(prepared.study.filter.position_cutoff_hz, slowest / PER_RATE)


def opened(prepared: Prepared, progress: Progress = silent) -> Opened:
    """Rows, fine signals, layout, first state. Pure but for reading the recordings."""
    study, columns = prepared.study, prepared.columns
    cutoff = diagnosis_cutoff(prepared)
    slowest = min(stream.rate_hz for stream in prepared.streams)
    settings = study.filter.model_copy(
        update={"position_cutoff_hz": min(PREFILTER * cutoff, HIGHEST * slowest)}
    )
    banks = tuple(prepare(stream, settings) for stream in prepared.streams)
    keeper = FineKeeper(columns, cutoff, study.filter.order)
    systems = build(replace(prepared, banks=banks), cutoff, observer=keeper, progress=progress)
    segments = keeper.segments([system.label for system in systems])
    systems, segments, thinned = _thinned(systems, segments)
    rows = rows_of(systems, len(columns.parameters))
    n = len(columns.need.joints)
    low = np.min([s.q.min(axis=0) for s in segments], axis=0)
    high = np.max([s.q.max(axis=0) for s in segments], axis=0)
    layout = layout_of(study, columns, tuple(float(x) for x in high - low))
    problem = Problem(layout.robot, columns, _dry(columns.parameters, layout, rows, n))
    state = first_state(problem, rows, segments)
    declared = [
        Term(term.effect, term.place, dict(term.theta), tuple(term.size) or None)
        for term in terms_of(study, columns, layout)
    ]
    for term in declared:
        made = state.scene.columns(term)
        if made:
            p = next(iter(made.values())).shape[1]
            state = replace(state, found=(*state.found, Found(term, made, np.zeros(p))))
    return Opened(layout, settled(state, 2) if declared else state, cutoff, thinned)


def _dry(parameters: Sequence[str], layout: Layout, rows: Rows, n: int) -> tuple[Dry, ...]:
    """Where the joints' dry friction stands in the model's columns."""
    names = [ParameterName.of(name) for name in parameters]
    out = []
    for j, label in enumerate(layout.robot.joint_labels):
        places = tuple(
            (c, int(k))
            for c, channel in enumerate(layout.channels)
            if channel.joint == j
            for k in rows.base[c][0]
            if (name := names[k]) is not None and name.label == label and name.kind in DRY
        )
        if places:
            out.append(Dry(j, places))
    return tuple(out)


def _thinned(
    systems: Sequence[RecordingSystem], segments: Sequence[FineSegment]
) -> tuple[tuple[RecordingSystem, ...], tuple[FineSegment, ...], bool]:
    """Stretches of STRETCH_S spread evenly where a role has more than ROWS_A_SIDE rows."""
    total: dict[str, int] = {}
    for system in systems:
        total[system.role] = total.get(system.role, 0) + sum(len(s.t) for s in system.segments)
    if max(total.values()) <= ROWS_A_SIDE:
        return tuple(systems), tuple(segments), False
    out_systems, out_segments, at = [], [], 0
    for system in systems:
        share = min(1.0, ROWS_A_SIDE / total[system.role])
        kept: list[DecimatedSegment] = []
        for part in system.segments:
            fine = segments[at]
            at += 1
            for rows in _stretches(len(part.t), part.t, share):
                kept.append(
                    replace(
                        part,
                        t=part.t[rows],
                        values=part.values[:, rows],
                        Y=part.Y[:, rows],
                        weight=part.weight[:, rows],
                    )
                )
                out_segments.append(_cut(fine, rows))
        out_systems.append(replace(system, segments=tuple(kept)))
    return tuple(out_systems), tuple(out_segments), True


def _stretches(count: int, t: np.ndarray, share: float) -> list[slice]:
    if share >= 1.0 or count < 4:
        return [slice(0, count)]
    length = max(4, round(STRETCH_S / float(np.median(np.diff(t)))))
    period = length / share
    number = max(1, round(count / period))
    starts = np.linspace(0, max(count - length, 0), number).astype(int)
    return [slice(int(a), int(min(a + length, count))) for a in starts]


def _cut(fine: FineSegment, rows: slice) -> FineSegment:
    pick = slice(rows.start * fine.every, rows.stop * fine.every)
    arrays = ("t", "q", "dq", "ddq", "sign_dq", "speed", "certain", "measured")
    return replace(fine, **{name: getattr(fine, name)[pick].copy() for name in arrays})
