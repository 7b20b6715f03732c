"""A study as the diagnosis opens it: the fit's own equations, at a higher cut-off, with the fine signals
beside. It is opened again where torques come late (`Source`).

Rows go up to the study's position cut-off, or a twelfth of the slowest recording's rate; positions are then
filtered at four times that, so that the rows' own filter is what limits both sides of the equations. Of long
recordings the diagnosis takes stretches spread over them: its cost does not grow with the log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ident.diagnosis.evidence.presliding import shortest_travels, told_as_effects
from ident.diagnosis.evidence.settled import first_state, settled
from ident.diagnosis.evidence.state import Found, Problem, State
from ident.diagnosis.outcome import threshold
from ident.diagnosis.rows.room import Room, room_for
from ident.diagnosis.rows.rows import Rows, rows_of
from ident.diagnosis.rows.stretches import cut_out, cuts
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.rows.turn_over import Dry
from ident.equations.build import build
from ident.equations.fine import Cut, FineKeeper, FineSegment, bytes_of
from ident.equations.observation import RecordingSystem, stack
from ident.equations.placing import layout_of, terms_of
from ident.equations.prepared import Prepared, travel_seen
from ident.equations.terms import Term as StudyTerm
from ident.equations.terms import late_by
from ident.estimation.least_squares import channel_sigma, weighted_least_squares
from ident.progress import Progress, silent
from ident.signals.filtering import prepare
from modelgen.effects import catalogue
from modelgen.effects.place import Layout
from modelgen.geometry.names import ParameterName

DRY = ("Fcm", "Fcl")  # kinds of parameters whose columns are signs
PER_RATE = 12.0  # samples a second and Hz of cut-off, at least
PREFILTER = 4.0  # of the rows' cut-off
HIGHEST = 0.4  # of the rate
HELD = 1.5e8  # bytes of fine signals that are held; more wait on disk


@dataclass(frozen=True)
class Opened:
    """Layout of the places, and the rigid model with the study's own effects, settled."""

    layout: Layout
    state: State
    cutoff_hz: float
    thinned: bool
    room: Room


@dataclass(frozen=True)
class Source:
    """Where rows and fine signals come from: recordings with their filters, and what is looked at of them."""

    prepared: Prepared
    cutoff_hz: float
    on_disk: bool
    cuts: tuple[Cut, ...] = ()
    thinned: bool = False

    def with_late(self, seconds: Sequence[Sequence[float]]) -> Source:
        """With torques that come late by so much, of each joint; itself where they do already."""
        late = self.prepared.with_late(seconds)
        return self if late is self.prepared else replace(self, prepared=late)

    def built(self, progress: Progress = silent) -> tuple[tuple[RecordingSystem, ...], FineKeeper]:
        study, columns = self.prepared.study, self.prepared.columns
        keeper = FineKeeper(columns, self.cutoff_hz, study.filter.order, self.on_disk)
        return build(self.prepared, self.cutoff_hz, observer=keeper, progress=progress), keeper

    def looked_at(
        self, systems: Sequence[RecordingSystem], segments: Sequence[FineSegment]
    ) -> tuple[Rows, tuple[FineSegment, ...]]:
        """Rows and fine signals of the cuts, of segments one a cut."""
        if self.thinned:
            systems, segments = _seen(systems, segments, self.cuts)
        return rows_of(systems, len(self.prepared.columns.parameters)), tuple(segments)

    def read(self) -> tuple[Rows, tuple[FineSegment, ...]]:
        """Those of the recordings that decide something, opened again."""
        systems, keeper = self.built()
        return self.looked_at(systems, keeper.segments(systems, self.cuts))


def _deciding(prepared: Prepared) -> Prepared:
    """Without test runs, which decide nothing: neither by what they say nor by how they were recorded. (Of a
    KR 300 with one position in coarse steps in its test run alone, rows of another cut-off gave it another
    friction.)"""
    its = [both for both in zip(prepared.streams, prepared.banks) if both[0].role != "test"]
    streams, banks = zip(*its)
    return replace(prepared, streams=streams, banks=banks)


def diagnosis_cutoff(prepared: Prepared) -> float:
    """Hz of the rows that the diagnosis looks at: no more than what is known of every position's motion."""
    slowest = min(stream.rate_hz for stream in prepared.streams)
    known = (hz for bank in prepared.banks for hz in bank.lowest)
    return min(prepared.study.filter.position_cutoff_hz, float(slowest / PER_RATE), *known)


def opened(
    prepared: Prepared,
    progress: Progress = silent,
    memory: float | None = None,
    fitted: Sequence[StudyTerm] | None = None,
) -> Opened:
    """Rows, fine signals, layout, first state. Pure but for reading the recordings.

    memory [bytes]: what the process may take; None: half of what is free. fitted: the study's own effects
    where its fit has them, None: where they begin. (About a delay of zero, one of 17 ms is no delay, and what
    is left of it was told as structure.) Raises MemoryLimitError."""
    prepared = _deciding(prepared)
    study, columns = prepared.study, prepared.columns
    cutoff = diagnosis_cutoff(prepared)
    slowest = min(stream.rate_hz for stream in prepared.streams)
    settings = study.filter.model_copy(
        update={"position_cutoff_hz": min(PREFILTER * cutoff, HIGHEST * slowest), "path": "position"}
    )
    room = room_for(prepared, cutoff, memory)
    banks = tuple(
        prepare(stream, settings, study.turn_overs, lowest=its.lowest)
        for stream, its in zip(prepared.streams, prepared.banks)
    )
    ahead = replace(prepared, banks=banks).with_late(late_by(columns, fitted or ()))
    source = Source(ahead, cutoff, bytes_of(prepared, cutoff) > HELD)
    systems, keeper = source.built(progress)
    chosen = cuts(systems, room.rows, partial(_left, systems, prepared))
    thinned = sum(cut.stop - cut.start for cut in chosen) < sum(len(p.t) for s in systems for p in s.segments)
    source = replace(source, cuts=tuple(chosen), thinned=thinned)
    rows, segments = source.looked_at(systems, keeper.segments(systems, chosen))
    del keeper, systems
    n = len(columns.need.joints)
    layout = layout_of(study, columns, travel_seen(prepared.streams))
    layout = replace(layout, recordings=rows.names)
    asked = sum(1 for effect in catalogue().values() for _ in effect.places(layout))
    problem = Problem(layout.robot, columns, _dry(columns.parameters, layout, rows, n), asked, source)
    state = told_as_effects(first_state(problem, rows, segments), threshold(study.alpha))
    declared = [
        Term(term.effect, term.place, dict(term.theta), tuple(term.size) or None)
        for term in (terms_of(study, columns, layout) if fitted is None else fitted)
    ]
    for term in declared:
        made = state.scene.columns(term)
        if made:
            p = next(iter(made.values())).shape[1]
            state = state.plus(Found(term.beside({t.key for t in state.terms}), made, np.zeros(p)))
    return Opened(layout, settled(state, 2) if declared else state, cutoff, thinned, room)


def _dry(parameters: Sequence[str], layout: Layout, rows: Rows, n: int) -> tuple[Dry, ...]:
    """Where the joints' dry friction stands in the model's columns."""
    shorter = shortest_travels(catalogue().values(), layout)
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
            out.append(Dry(j, places, shorter=shorter.get(j, np.inf)))
    return tuple(out)


def _left(systems: Sequence[RecordingSystem], prepared: Prepared) -> list[list[np.ndarray]]:
    """What the rigid model leaves of every row, fitted to the identify recordings: (C, m) a segment."""
    factors = stack([system for system in systems if system.role == "identify"])
    chi = weighted_least_squares(factors, channel_sigma(factors), prepared.columns.parameters).chi
    return [system.residuals(chi) for system in systems]


def _seen(
    systems: Sequence[RecordingSystem], segments: Sequence[FineSegment], chosen: Sequence[Cut]
) -> tuple[tuple[RecordingSystem, ...], tuple[FineSegment, ...]]:
    """The recordings of which something is looked at, with that alone."""
    left = sorted({cut.system for cut in chosen})
    out = tuple(cut_out(systems[k], [cut for cut in chosen if cut.system == k]) for k in left)
    return out, tuple(replace(s, recording=left.index(s.recording)) for s in segments)
