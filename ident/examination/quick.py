"""A quick fit on some thousand samples, and what it costs to fit the same samples under another hypothesis.

Every channel's normal matrix is made once, recording by recording. A torque with another sign, another scale
or in another's place changes only right-hand sides, so each hypothesis costs one small solution. Channels
are weighted by what the fit leaves of them (three turns), and two fits are compared by

    gain = sum over channels of ln(error before / error after),   error = ||Y - W chi|| / ||Y||,

in which halving the error of one channel is 0.69 whatever the size of its torque.
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
FIRST = 98_304  # rows of a recording that they are taken from
RAIL = 0.05  # of a clipped torque's range: where the filter rounds the edges
FLOOR = 3e-3  # errors below it are not told apart
CLUSTERS = 20  # stretches of one recording whose scores are taken as independent
RIDGE = 1e-10
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

    def moved(
        self, columns: Columns, order: Sequence[int] | None = None, factor: Any = 1.0, offset: Any = 0.0
    ) -> Sample:
        """The same torques along other positions: joint j with that of joint order[j], times its factor (n,),
        from another zero (n,)."""
        its, joints = self.thin, slice(None) if order is None else list(order)
        q, dq, ddq = (x[:, joints] * factor for x in (its.q, its.dq, its.ddq))
        sign = its.sign_dq[:, joints] * np.sign(factor)
        thin = replace(its, q=q + offset, dq=dq, ddq=ddq, sign_dq=sign)
        return replace(self, thin=thin, W=_observation(columns, self.payload, thin, self.weightless))

    def timed(self, columns: Columns, factor: float) -> Sample:
        """The same with stamps times a factor."""
        its = self.thin
        thin = replace(its, t=factor * its.t, dq=its.dq / factor, ddq=its.ddq / factor**2)
        return replace(self, thin=thin, W=_observation(columns, self.payload, thin, self.weightless))

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

    def without_bodies(self, columns: Columns, channels: Iterable[int]) -> Sample:
        """The same torques with nothing but friction, rotors and offsets in these channels."""
        W = self.W.copy()
        W[list(channels)] *= ~of_bodies(columns)
        return replace(self, W=W)

    def mixed(self, columns: Columns, positions: np.ndarray, torques: np.ndarray) -> Sample:
        """Along positions (n, n) times those recorded, with recorded torques times (C, C)."""
        its = self.thin
        q, dq, ddq = (x @ positions.T for x in (its.q, its.dq, its.ddq))
        plain = (positions == np.eye(len(positions))).all(axis=1)
        thin = replace(its, q=q, dq=dq, ddq=ddq, sign_dq=np.where(plain, its.sign_dq, np.sign(dq)))
        W = _observation(columns, self.payload, thin, self.weightless)
        return replace(self, thin=thin, W=W, Y=self.Y @ torques, late=self.late @ torques)


@dataclass(frozen=True, slots=True)
class Assignment:
    """Which recorded torque stands in which channel, times what: a hypothesis about torques."""

    order: tuple[int, ...]
    factor: tuple[float, ...]

    @classmethod
    def plain(cls, channels: int) -> Assignment:
        return cls(tuple(range(channels)), (1.0,) * channels)

    def times(self, channels: Sequence[int], factor: float) -> Assignment:
        values = list(self.factor)
        for c in channels:
            values[c] *= factor
        return Assignment(self.order, tuple(values))

    def placed(self, source: Sequence[int], gains: np.ndarray) -> Assignment:
        """Channel c with the torque of channel source[c]: a current is then times the gain (C,) of its own
        drive."""
        factors = (self.factor[k] * float(gains[c] / gains[k]) for c, k in enumerate(source))
        return Assignment(tuple(self.order[k] for k in source), tuple(factors))


@dataclass(frozen=True, slots=True)
class Fit:
    """chi (b,), error (C,) on identify, validate (C,) or None, and its normal matrix."""

    chi: np.ndarray
    error: np.ndarray
    validate: np.ndarray | None
    normal: np.ndarray  # (b, b), of columns divided by `length`
    length: np.ndarray
    scale: np.ndarray  # (C,) 1 / variance of the channels

    @property
    def inverse(self) -> np.ndarray:
        return np.linalg.inv(self.normal) / np.outer(self.length, self.length)

    def gain_over(self, other: Fit) -> float:
        return gain_of(other.error, self.error)

    def holds_over(self, other: Fit) -> float:
        """The same on the validate recordings; on identify where there are none."""
        if self.validate is None or other.validate is None:
            return self.gain_over(other)
        return gain_of(other.validate, self.validate)


def gain_of(before: np.ndarray, after: np.ndarray) -> float:
    """Sum of ln(before / after) of errors (C,) over the channels that both have."""
    return float(np.sum(gains_of(before, after)))


def gains_of(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """(C,) ln(before / after) of errors (C,); 0 of channels that not both have."""
    seen = np.isfinite(before) & np.isfinite(after)
    return np.where(seen, np.log(np.maximum(before, FLOOR) / np.maximum(after, FLOOR)), 0.0)


@dataclass(frozen=True, slots=True)
class Normal:
    """Sums over samples: G (C, b, b), v (C, C, b) = W_c' Y_k, yy (C, C) = |Y_k|^2 in rows of c."""

    G: np.ndarray
    v: np.ndarray
    yy: np.ndarray
    rows: np.ndarray

    @classmethod
    def of(cls, s: Sample) -> Normal:
        C, _, b = s.W.shape
        G, v = np.zeros((C, b, b)), np.zeros((C, C, b))
        root = np.sqrt(s.weight)
        for c in range(C):
            columns = s.W[c].T  # (b, N), row after row in memory
            live = np.flatnonzero(columns.any(axis=1))  # a torque feels no link before its joint
            W = columns[live] * root[:, c]
            G[c, live[:, None], live] = W @ W.T
            v[c][:, live] = (W @ (s.Y * root[:, c : c + 1])).T
        return cls(G, v, s.weight.T @ s.Y**2, s.weight.sum(axis=0))

    def right(self, how: Assignment) -> tuple[np.ndarray, np.ndarray]:
        """(C,) |Y|^2 and (C, b) W' Y of the torques that the channels then have."""
        each, factor = (np.arange(len(how.order)), list(how.order)), np.array(how.factor)
        return factor**2 * self.yy[each], factor[:, None] * self.v[each]

    def size_beside(self, other: Normal, how: Assignment) -> np.ndarray:
        """(C,) |Y| of the torques that the channels then have, over those of other recordings; 1 where there
        are none."""
        mine, its = self.right(how)[0], other.right(how)[0]
        return np.sqrt(np.where(its > 0, mine / np.where(its > 0, its, 1.0), 1.0))

    def errors(self, chi: np.ndarray, how: Assignment) -> np.ndarray:
        """(C,) relative; NaN where nothing is seen."""
        size, v = self.right(how)
        return self.left(chi[None], size[None], v[None])[0]

    def left(self, chi: np.ndarray, size: np.ndarray, v: np.ndarray) -> np.ndarray:
        """(K, C), the same by each of chi (K, b) of torques with |Y|^2 (K, C) and W' Y (K, C, b)."""
        C, b, _ = self.G.shape
        along = (self.G.reshape(-1, b) @ chi.T).reshape(C, b, -1)
        left = size - 2 * (v @ chi[:, :, None])[:, :, 0] + np.einsum("cbk,kb->kc", along, chi)
        seen = (self.rows > 10) & (size > 0)
        return np.where(seen, np.sqrt(np.maximum(left, 0.0) / np.where(seen, size, 1.0)), np.nan)


@dataclass(frozen=True, slots=True)
class Quick:
    """The samples of a study and their sums: of each, and of all that are fitted or judge."""

    columns: Columns
    samples: tuple[Sample, ...]
    each: tuple[Normal, ...]
    identify: Normal
    validate: Normal | None

    @property
    def fitted(self) -> tuple[Sample, ...]:
        return tuple(s for s in self.samples if s.role == "identify")

    def plain(self) -> Assignment:
        return Assignment.plain(len(self.columns.channels))

    def fit(self, how: Assignment) -> Fit:
        return solve(self.identify, self.validate, how)

    def fits(self, hows: Sequence[Assignment]) -> list[Fit]:
        """One under each of these hypotheses about torques."""
        return solve_each(self.identify, self.validate, hows)

    def of(self, samples: Sequence[Sample]) -> Quick:
        """Other samples; most hypotheses change one, and the sums of the others are known."""
        return _summed(self.columns, samples, list(zip(self.samples, self.each)))

    def moved(self, order: Sequence[int] | None = None, factor: Any = 1.0, offset: Any = 0.0) -> Quick:
        """Along other positions: `Sample.moved`."""
        return self.of([s.moved(self.columns, order, factor, offset) for s in self.samples])


def quick_of(columns: Columns, samples: Sequence[Sample]) -> Quick:
    return _summed(columns, samples, [])


def _summed(columns: Columns, samples: Sequence[Sample], known: Sequence[tuple[Sample, Normal]]) -> Quick:
    each = [next((sums for its, sums in known if s.is_summed_as(its)), None) or Normal.of(s) for s in samples]
    of = {role: [n for s, n in zip(samples, each) if s.role == role] for role in ("identify", "validate")}
    judged = added(of["validate"]) if of["validate"] else None
    return Quick(columns, tuple(samples), tuple(each), added(of["identify"]), judged)


def added(normals: Sequence[Normal]) -> Normal:
    """Those of several recordings together."""
    first = normals[0]
    for n in normals[1:]:
        first = Normal(first.G + n.G, first.v + n.v, first.yy + n.yy, first.rows + n.rows)
    return first


def solve(identify: Normal, validate: Normal | None, how: Assignment) -> Fit:
    """Least squares of all channels, weighted three times by what it leaves."""
    return solve_each(identify, validate, [how])[0]


def solve_each(identify: Normal, validate: Normal | None, hows: Sequence[Assignment]) -> list[Fit]:
    """The same under several hypotheses about torques."""
    fits = least_squares(identify, [identify.right(how) for how in hows])
    if validate is not None:
        fits = [replace(fit, validate=validate.errors(fit.chi, how)) for fit, how in zip(fits, hows)]
    return fits


def least_squares(sums: Normal, torques: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[Fit]:
    """The same of several torques with |Y|^2 (C,) and W' Y (C, b): a product for all of them."""
    C, b, _ = sums.G.shape
    size, right = (np.stack(each) for each in zip(*torques))  # (K, C), (K, C, b)
    seen = (sums.rows > 10) & (size > 0)
    scale = np.where(seen, 1.0 / np.maximum(size, 1e-300), 0.0)
    for turn in range(3):
        G = (scale @ sums.G.reshape(C, -1)).reshape(-1, b, b)
        own = G.diagonal(axis1=1, axis2=2)
        live = own > 1e-20 * own.max(axis=1, keepdims=True)  # a joint at rest shows nothing of itself
        length = np.where(live, np.sqrt(np.maximum(own, 0.0)), np.inf)
        G /= length[:, None]
        G /= length[:, :, None]
        G.reshape(len(G), -1)[:, :: b + 1] += np.where(live, RIDGE, 1.0)
        aim = (scale[:, None] @ right)[:, 0] / length
        chi = np.linalg.solve(G, aim[:, :, None])[:, :, 0] / length
        error = sums.left(chi, size, right)
        if turn < 2:
            scale = np.where(seen, 1.0 / (np.maximum(size, 1e-300) * np.fmax(error, 0.02) ** 2), 0.0)
    return [Fit(x, e, None, *its) for x, e, *its in zip(chi, error, G, length, scale)]


def alone(G: np.ndarray, v: np.ndarray, size: np.ndarray) -> np.ndarray:
    """(L,) relative errors of one channel fitted by itself, to L torques with W' Y (b, L) and |Y|^2 (L,): no
    fit of several channels leaves less of it."""
    own = np.diag(G)
    length = np.sqrt(np.maximum(own, 1e-300))
    normal = G / np.outer(length, length) + np.diag(np.where(own > 0, 1e-12, 1.0))
    v = v / length[:, None]
    left = size - (v * np.linalg.solve(normal, v)).sum(axis=0)
    return np.sqrt(np.maximum(left, 0.0) / np.maximum(size, 1e-300))


def functionals(quick: Quick, fit: Fit, how: Assignment, H: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(F,) H' chi of the columns of H (b, F), and their standard deviations from the scatter of the scores
    between stretches of the recordings."""
    meat = np.zeros(H.shape[1])
    directions = np.column_stack([fit.chi, fit.inverse @ H])
    for s in quick.fitted:
        scores = np.zeros((len(s.q), H.shape[1]))
        for c, (k, f) in enumerate(zip(how.order, how.factor)):
            seen = s.W[c] @ directions
            left = f * s.Y[:, k] - seen[:, 0]
            scores += (fit.scale[c] * s.weight[:, c] * left)[:, None] * seen[:, 1:]
        pieces = np.array_split(scores, max(2, CLUSTERS // len(quick.fitted)))
        meat += sum(piece.sum(axis=0) ** 2 for piece in pieces)
    return H.T @ fit.chi, np.sqrt(meat)


def take(
    streams: Sequence[RecordingStream], banks: Sequence[FilterBank], columns: Columns, role: str
) -> list[Sample]:
    """Thinned samples of the recordings with this role; recordings of which nothing moves give none."""
    mine = [(s, bank) for s, bank in zip(streams, banks) if s.role == role][:8]
    most = min(ROWS, HELD / (8 * len(columns.channels) * len(columns.parameters)))
    out = []
    for stream, bank in mine:
        seconds = sum(s.move_end - s.move_start for s in stream.survey.segments)
        length = min(seconds * stream.rate_hz, FIRST)
        stride = max(1, int(length * len(mine) / most))
        thin, torques, total = [], [], 0
        for _, block in first_samples(filter_stream(stream, bank, torque_too=True), FIRST):
            thin.append(picked(block, np.arange(-total % stride, len(block.t), stride)))
            torques.append(columns.torque(block))
            total += len(block.t)
        if total >= 60:
            out.append(_sample(stream, columns, joined(thin), np.concatenate(torques), stride))
    return out


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
