"""Samples of recordings: the motion's, filtered and thinned, what the model makes of it, and the torques.

Most hypotheses take a recording otherwise (a position times a number, a torque at another time): each is one
method of a sample, which gives another.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ident.equations.columns import Columns
from ident.recordings.recording import RecordingStream
from ident.signals.filtering import FilterBank, FilteredBlock, filter_stream
from ident.signals.neighbours import first_samples, joined, picked
from modelgen.geometry.names import ParameterName

ROWS = 1500  # samples of all recordings of a role together
HELD = 6e7  # bytes of their columns: fewer samples of a robot of very many joints
LEAST = 60  # rows of all recordings of a role, below which they are not asked
FIRST = 98_304  # rows of a recording that they are taken from
RAIL = 0.05  # of a clipped torque's range: where the filter rounds the edges
SMOOTHED = 7  # samples that a cubic is taken through, at least
LAG_S = (0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0)
LAGS = tuple(sign * s for s in LAG_S for sign in (1, -1))


@dataclass(frozen=True, slots=True)
class Sample:
    """Samples of one recording, thinned: the motion's, filtered, Y (N, C) N m, weight (N, C), W (C, N, b)
    column after column; late (L, N, C): the torques that are recorded LAGS after their instants; weightless:
    channels whose torques are taken without gravity."""

    label: str
    role: str
    payload: str | None
    thin: FilteredBlock
    Y: np.ndarray
    weight: np.ndarray
    W: np.ndarray
    late: np.ndarray
    weightless: frozenset[int] = frozenset()

    def unclipped(self, channels: Sequence[int]) -> Sample:
        """Without the rows in which these torques are near an end of their range."""
        weight = self.weight.copy()
        for c in channels:
            low, high = self.Y[:, c].min(), self.Y[:, c].max()
            near = RAIL * (high - low)
            weight[:, c] *= (self.Y[:, c] > low + near) & (self.Y[:, c] < high - near)
        return replace(self, weight=weight)

    def without(self, channels: Sequence[int]) -> Sample:
        """Without these torques: as if nothing of them were seen."""
        if not channels:
            return self
        weight = self.weight.copy()
        weight[:, list(channels)] = 0.0
        return replace(self, weight=weight)

    @property
    def t(self) -> np.ndarray:
        return self.thin.t

    @property
    def q(self) -> np.ndarray:
        return self.thin.q

    @property
    def dq(self) -> np.ndarray:
        return self.thin.dq

    @property
    def ddq(self) -> np.ndarray:
        return self.thin.ddq

    def is_summed_as(self, other: Sample) -> bool:
        """Whether its `Normal` is that of the other."""
        return self.W is other.W and self.Y is other.Y and self.weight is other.weight

    def rows(self, pick: slice | np.ndarray) -> Sample:
        """Some of its rows."""
        thin = picked(self.thin, np.arange(len(self.t))[pick])
        Y, weight, late = self.Y[pick], self.weight[pick], self.late[:, pick]
        W = np.ascontiguousarray(self.W.swapaxes(1, 2)[:, :, pick]).swapaxes(1, 2)
        return replace(self, thin=thin, Y=Y, weight=weight, W=W, late=late)

    def beside(self, more: np.ndarray) -> Sample:
        """With more columns (C, N, p) behind the model's."""
        return replace(self, W=np.concatenate([self.W, more], axis=2))

    def predicted(self, chi: np.ndarray) -> np.ndarray:
        """(N, C) N m of parameters chi (b,)."""
        return np.stack([W @ chi for W in self.W], axis=1)

    def _along(self, columns: Columns, thin: FilteredBlock) -> Sample:
        """The same torques along another motion."""
        return replace(self, thin=thin, W=_observation(columns, self.payload, thin, self.weightless))

    def moved(
        self, columns: Columns, order: Sequence[int] | None = None, factor: Any = 1.0, offset: Any = 0.0
    ) -> Sample:
        """The same torques along other positions: joint j with that of joint order[j], times its factor (n,),
        from another zero (n,)."""
        its, joints = self.thin, slice(None) if order is None else list(order)
        q, dq, ddq = (x[:, joints] * factor for x in (its.q, its.dq, its.ddq))
        sign = its.sign_dq[:, joints] * np.sign(factor)
        thin = replace(its, q=q + offset, dq=dq, ddq=ddq, sign_dq=sign)
        return self._along(columns, thin)

    def smoothed(self, columns: Columns, joint: int, seconds: float) -> Sample | None:
        """With one position by cubics over so many seconds about each sample; None: these hold too few."""
        its = self.thin
        step = float(np.median(np.diff(its.t))) if len(its.t) > 1 else np.inf
        width = int(seconds / step) | 1
        gaps = np.flatnonzero(np.abs(np.diff(its.t) - step) > 0.5 * step) + 1
        if width < SMOOTHED or min(len(part) for part in np.split(its.t, gaps)) < width:
            return None
        q, dq, ddq = (x.copy() for x in (its.q, its.dq, its.ddq))
        own = [_cubics(x, width, step) for x in np.split(its.q[:, joint], gaps)]
        q[:, joint], dq[:, joint], ddq[:, joint] = np.concatenate(own, axis=1)
        sign = its.sign_dq.copy()
        sign[:, joint] = np.sign(dq[:, joint])
        thin = replace(its, q=q, dq=dq, ddq=ddq, sign_dq=sign)
        return self._along(columns, thin)

    def timed(self, columns: Columns, factor: float) -> Sample:
        """The same with stamps times a factor."""
        its = self.thin
        thin = replace(its, t=factor * its.t, dq=its.dq / factor, ddq=its.ddq / factor**2)
        return self._along(columns, thin)

    def later(self, seconds: Any) -> np.ndarray:
        """(N, C) torques that are recorded so much after their instants, a number or (N,), within LAGS."""
        order = np.argsort((*LAGS, 0.0))
        lags, Y = np.array((*LAGS, 0.0))[order], np.concatenate([self.late, self.Y[None]])[order]
        place = np.interp(np.broadcast_to(seconds, len(self.t)), lags, np.arange(len(lags)))
        low = np.minimum(place.astype(int), len(lags) - 2)
        share, rows = (place - low)[:, None], np.arange(len(self.t))
        return np.asarray((1 - share) * Y[low, rows] + share * Y[low + 1, rows])

    def read(self, order: Sequence[int], factor: Any) -> Sample:
        """With recorded torque k taken as that of order[k], times its factor (C,)."""
        which = list(order)
        return replace(self, Y=self.Y[:, which] * factor, late=self.late[:, :, which] * factor)

    def without_gravity(self, columns: Columns, channels: Iterable[int]) -> Sample:
        """The same torques taken without gravity in these channels, too."""
        more = sorted(set(channels) - self.weightless)
        W = self.W.copy()
        W[more] -= at_rest(columns, self.payload, self.thin.q)[more]
        return replace(self, W=W, weightless=self.weightless.union(more))

    def partly(self, other: Sample, channels: Iterable[int]) -> Sample:
        """With what the other has of the model in some channels."""
        which = sorted(channels)
        W = self.W.copy()
        W[which] = other.W[which]
        weightless = (self.weightless - {*which}) | (other.weightless & {*which})
        return replace(self, W=W, weightless=weightless)

    def lacking(self, which: np.ndarray, channels: Sequence[int] | None = None) -> Sample:
        """Without parameters which (b,) bool in these channels, or in all."""
        W, rows = self.W.copy(), slice(None) if channels is None else list(channels)
        W[rows] *= ~which
        return replace(self, W=W)

    def mixed(self, columns: Columns, positions: np.ndarray, torques: np.ndarray) -> Sample:
        """Along positions (n, n) times those recorded, with recorded torques times (C, C)."""
        its = self.thin
        q, dq, ddq = (x @ positions.T for x in (its.q, its.dq, its.ddq))
        plain = (positions == np.eye(len(positions))).all(axis=1)
        thin = replace(its, q=q, dq=dq, ddq=ddq, sign_dq=np.where(plain, its.sign_dq, np.sign(dq)))
        return replace(self._along(columns, thin), Y=self.Y @ torques, late=self.late @ torques)


def _cubics(x: np.ndarray, width: int, step: float) -> np.ndarray:
    """(3, N) value, first and second derivative of x (N,), `step` apart, by the least squares cubic through
    `width` samples about each; at the ends by the first and the last of these (Savitzky, Golay, Anal. Chem.
    36(8), 1964). Importing scipy.signal, which has it, takes a third of a fit."""
    place = np.arange(width) - width // 2
    powers = np.vander(place, 4, increasing=True)
    a, b, c, d = np.linalg.pinv(powers) @ np.lib.stride_tricks.sliding_window_view(x, width).T
    at = np.arange(len(x))
    which = np.clip(at - width // 2, 0, len(a) - 1)
    u, a, b, c, d = at - width // 2 - which, a[which], b[which], c[which], d[which]
    value = a + u * (b + u * (c + u * d))
    return np.stack([value, (b + u * (2 * c + 3 * u * d)) / step, (2 * c + 6 * u * d) / step**2])


def take(
    streams: Sequence[RecordingStream], banks: Sequence[FilterBank], columns: Columns, role: str
) -> list[Sample]:
    """Thinned samples of the recordings with this role, where together they have rows enough to be asked;
    recordings of which nothing moves give none. (Of a TX40's two runs of 55 rows each with all torques turned
    nothing was asked: each alone was too short.)"""
    mine = [(s, bank) for s, bank in zip(streams, banks) if s.role == role][:8]
    most = min(ROWS, HELD / (8 * len(columns.channels) * len(columns.parameters)))
    out, rows = [], 0
    for stream, bank in mine:
        seconds = sum(s.move_end - s.move_start for s in stream.survey.segments)
        length = min(seconds * stream.rate_hz, FIRST)
        stride = max(1, int(length * len(mine) / most))
        thin, torques, total = [], [], 0
        for _, block in first_samples(filter_stream(stream, bank, torque_too=True), FIRST):
            thin.append(picked(block, np.arange(-total % stride, len(block.t), stride)))
            torques.append(columns.torque(block))
            total += len(block.t)
        if total:
            out.append(_sample(stream, columns, joined(thin), np.concatenate(torques), stride))
        rows += total
    return out if rows >= LEAST else []


def _sample(
    stream: RecordingStream, columns: Columns, thin: FilteredBlock, torque: np.ndarray, stride: int
) -> Sample:
    """thin: every stride-th row of the blocks whose torque (N, C) is given whole."""
    W = _observation(columns, stream.payload, thin)
    weight = thin.certain[:, columns.joint_of]
    rows = np.arange(0, len(torque), stride)
    steps = np.rint(np.array(LAGS) * stream.rate_hz).astype(int)
    late = torque[np.clip(rows + steps[:, None], 0, len(torque) - 1)]
    return Sample(stream.label, stream.role, stream.payload, thin, torque[rows], weight, W, late)


def _observation(
    columns: Columns, payload: str | None, thin: FilteredBlock, weightless: Collection[int] = ()
) -> np.ndarray:
    """W (C, N, b): the compiled model's columns and the study's own; of some channels without what bodies are
    felt at rest."""
    W = regressor(columns, payload, thin.q, thin.dq, thin.ddq, thin.sign_dq)
    for extra in columns.extras:
        W[extra.channel, :, extra.column] += extra.values(thin)
    which = sorted(weightless)
    if which:
        W[which] -= at_rest(columns, payload, thin.q)[which]
    return W


def at_rest(columns: Columns, payload: str | None, q: np.ndarray) -> np.ndarray:
    """(C, N, b): what is felt of bodies at positions q (N, n), which gravity alone makes."""
    none = np.zeros_like(q)
    return np.asarray(regressor(columns, payload, q, none, none, none) * of_bodies(columns))


def of_bodies(columns: Columns) -> np.ndarray:
    """(b,) bool: parameters that are a body's."""
    names = [ParameterName.of(name) for name in columns.parameters]
    return np.array([name is not None and name.of_body for name in names])


def regressor(
    columns: Columns, payload: str | None, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, sign: np.ndarray
) -> np.ndarray:
    """(C, N, b) of the columns that the compiled model gives in a run with this payload, 0 in the others."""
    used, channel, column = columns.entries(payload)
    there = column >= 0
    used, channel, column = used[there], channel[there], column[there]
    W = np.zeros((len(columns.channels), len(columns.parameters), len(q)))
    once = len(np.unique(channel * len(columns.parameters) + column)) == len(column)
    motion = (np.ascontiguousarray(x) for x in (q, dq, ddq))
    for rows, values in columns.model.nonzero_blocks(*motion, sign=np.ascontiguousarray(sign)):
        if once:
            W[channel, column, rows] = values[used]
        else:
            np.add.at(W, (channel, column, rows), values[used])
    return W.swapaxes(1, 2)
