"""Terms put on the rows of a study's equations: their columns pass through the decimation that the rows did.

Blocks are filtered once more (the regressor is not evaluated again), with as much motion either side as an
effect asks for; the decimated columns join the entries of the rigid model, what is known of them goes over to
Y, and the factors are made anew. Memory: the rows once more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.equations.columns import Columns
from ident.equations.fine import FineSegment
from ident.equations.fitted import FittedModel
from ident.equations.observation import (
    STACK,
    ChannelFactor,
    DecimatedSegment,
    GrowingFactor,
    RecordingSystem,
)
from ident.equations.terms import Chain, Term, places_of, tangent
from ident.recordings.recording import RecordingStream
from ident.signals.decimation import Decimator, kept_every
from ident.signals.filtering import FilterBank, FilteredBlock, LowPass, filter_stream
from ident.signals.neighbours import by_segment, first_samples, wide_blocks
from modelgen.geometry.place import Motion

Streams = Mapping[str, tuple[RecordingStream, FilterBank]]


def attach(
    systems: Sequence[RecordingSystem],
    streams: Streams,
    model: FittedModel,
    terms: Sequence[Term],
    cutoff_hz: float,
) -> tuple[RecordingSystem, ...]:
    """The systems of the rigid model with every term about its point: one pass over their recordings."""
    return tuple(_attached(system, *streams[system.label], model, terms, cutoff_hz) for system in systems)


def attach_fine(
    systems: Sequence[RecordingSystem],
    fine: Sequence[FineSegment],
    model: FittedModel,
    terms: Sequence[Term],
) -> tuple[RecordingSystem, ...]:
    """`attach` from fine signals of every stretch that has rows: fast, and nearly the same."""
    place, joint_of = places_of(model.columns, terms), model.columns.joint_of
    out, rest = [], iter(fine)
    for system in systems:
        chain, segments, entries = Chain(model, terms), [], np.zeros((0, 2), int)
        for own, its in zip(system.segments, rest):
            rows = _rows(its.motion, chain, place)
            entries, certain = rows.entries, its.certain.T
            weighted = [rows.values * certain[joint_of[entries[:, 0]]], rows.known * certain[joint_of]]
            done = its.decimate(np.vstack(weighted).T)
            segments.append(_extended(own, done.T, entries, chain.factors()[system.channel]))
        out.append(_with_entries(system, segments, entries))
    return tuple(out)


def motion_of(stream: RecordingStream, block: FilteredBlock, columns: Columns) -> Motion:
    """A filtered block as effects see it: time from the recording's first sample."""
    return Motion(
        stream.label,
        stream.payload,
        block.t - stream.survey.segments[0].start,
        block.q,
        block.dq,
        block.ddq,
        block.sign_dq,
        columns.torque(block),
        stream.rate_hz,
        block.before,
        block.path,
    )


def halo_of(terms: Sequence[Term], rate_hz: float) -> int:
    """Samples either side of a block that the terms ask for."""
    return int(np.ceil(max((term.effect.margin_s for term in terms), default=0.0) * rate_hz))


@dataclass(frozen=True, slots=True)
class _Rows:
    """What is decimated of one block: entries (E, 2) channel and column, values (E, N), known (C, N)."""

    entries: np.ndarray
    values: np.ndarray
    known: np.ndarray


def _rows(motion: Motion, chain: Chain, place: Mapping[str, slice]) -> _Rows:
    entries: list[tuple[int, int]] = []
    values: list[np.ndarray] = []
    known = np.zeros((len(motion.t), len(chain.model.channels)))
    for term in chain.terms:
        its = tangent(term, motion, chain)
        known += its.known
        for number, channel in enumerate(its.channels):
            for k in range(len(term.names)):
                entries.append((channel, place[term.label].start + k))
                values.append(its.J[:, number, k])
        for parameter, change in sorted(its.changes.items()):
            for channel in range(known.shape[1]):
                entries.append((channel, parameter))
                values.append(change[:, channel])
    chain.forget()
    return _Rows(np.array(entries, int).reshape(-1, 2), np.array(values).reshape(-1, len(motion.t)), known.T)


def _attached(
    system: RecordingSystem,
    stream: RecordingStream,
    bank: FilterBank,
    model: FittedModel,
    terms: Sequence[Term],
    cutoff_hz: float,
) -> RecordingSystem:
    place, joint_of = places_of(model.columns, terms), model.columns.joint_of
    filter, every = (
        LowPass(cutoff_hz, stream.rate_hz, bank.position.order),
        kept_every(cutoff_hz, stream.rate_hz),
    )
    kept = {segment.index: segment for segment in system.segments}
    chain, halo = Chain(model, terms), halo_of(terms, stream.rate_hz)
    segments: list[DecimatedSegment] = []
    entries = np.zeros((0, 2), int)
    for index, blocks in by_segment(first_samples(filter_stream(stream, bank), system.samples)):
        parts: list[np.ndarray] = []
        fold: Decimator | None = None
        for block, inner in wide_blocks(blocks, halo):
            rows = _rows(motion_of(stream, block, model.columns), chain, place)
            entries = rows.entries
            fold = fold or Decimator(filter, every, len(rows.values) + len(rows.known))
            certain = block.certain.T
            weighted = [rows.values * certain[joint_of[entries[:, 0]]], rows.known * certain[joint_of]]
            done = fold.push(np.vstack(weighted)[:, inner])
            if done is not None:
                parts.append(done)
        if fold is not None and index in kept:
            rows_of_terms = np.hstack([*parts, fold.finish()])
            segments.append(_extended(kept[index], rows_of_terms, entries, chain.factors()[system.channel]))
    return _with_entries(system, segments, entries)


def _with_entries(
    system: RecordingSystem, segments: Sequence[DecimatedSegment], entries: np.ndarray
) -> RecordingSystem:
    channel = np.concatenate([system.channel, entries[:, 0]])
    column = np.concatenate([system.column, entries[:, 1]])
    factors = factors_of(segments, channel, column, len(system.factors))
    return replace(system, channel=channel, column=column, segments=tuple(segments), factors=factors)


def _extended(
    segment: DecimatedSegment, rows: np.ndarray, entries: np.ndarray, factors: np.ndarray
) -> DecimatedSegment:
    """A segment with the terms' entries, what is known of them moved to the side of Y; factors (E,): what the
    terms make of the segment's own entries."""
    values, known = rows[: len(entries)], rows[len(entries) :]
    values = (values * segment.used[entries[:, 0]]).astype(segment.values.dtype)
    own = np.asarray(segment.values)
    if (factors != 1.0).any():
        own = own * factors[:, None].astype(own.dtype)
    return replace(segment, values=np.vstack([own, values]), Y=segment.Y - known * segment.used)


def factors_of(
    segments: Sequence[DecimatedSegment], channel: np.ndarray, column: np.ndarray, channels: int
) -> tuple[ChannelFactor, ...]:
    """A factor per channel from decimated rows."""
    out = []
    for j in range(channels):
        mine = np.flatnonzero(channel == j)
        factor = GrowingFactor(np.unique(column[mine]))
        for segment in segments:
            for start in range(0, len(segment.t), STACK):
                rows = slice(start, start + STACK)
                values = segment.values[mine, rows]
                factor.add_entries(column[mine], values, segment.Y[j, rows], segment.used[j, rows])
        out.append(factor.factor())
    return tuple(out)
