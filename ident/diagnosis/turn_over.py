"""How dry friction changes its sign: within a rate and within a travel of presliding, both free.

    sign(dq) ~ z |tanh(dq / rate)|,   dz/dq = (1 - z sign dq) / travel   (Dahl)

The widths belong to Coulomb friction itself, in every hypothesis alike: friction that turns over more
slowly than the model's is no Stribeck curve. Profiled on the fitted rows: a grid in the logarithm of each
width, then a parabola through the best three, joint after joint, until no width moves by a tenth of a step.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial

import numpy as np

from ident.diagnosis.fine import FineSegment
from ident.diagnosis.recorded import Record
from ident.diagnosis.rows import Rows
from ident.diagnosis.whitened import Whitener
from ident.signals.dry_friction import TurnOver, mean_sign, slid

SLOWEST, HIGHEST = 1e-4, 0.3  # of the top rate: least and largest width
SHORTEST, LONGEST = 2e-6, 2e-3  # of the joint's travel: least and largest presliding
STEPS = 1.5  # ratio of the grid
ORDERS = (("rate", "travel"), ("travel", "rate"))  # which width first; either can stand in for the other


@dataclass(frozen=True, slots=True)
class Dry:
    """Where a joint's dry friction stands: (channel, place of its parameter). travels: whether it may give
    way before it slips."""

    joint: int
    places: tuple[tuple[int, int], ...]
    travels: bool = True


def grids(segments: Sequence[FineSegment], joint: int) -> dict[str, np.ndarray]:
    """Widths to try."""
    top = max(float(np.abs(s.speed[:, joint]).max()) for s in segments)
    noise = max(float(s.vs[joint]) for s in segments) / 10
    reach = max(s.q[:, joint].max() for s in segments) - min(s.q[:, joint].min() for s in segments)
    low = max(noise, SLOWEST * top, 1e-9)
    return {
        "rate": _ladder(low, max(HIGHEST * top, 1.5 * low)),
        "travel": _ladder(SHORTEST * reach + 1e-12, LONGEST * reach + 2e-12),
    }


def reverses(segments: Sequence[FineSegment], joint: int) -> bool:
    """Whether a joint moves both ways; with one direction alone its dry friction is a constant."""
    dq = np.concatenate([s.dq[:, joint] for s in segments])
    top = np.abs(dq).max(initial=0.0)
    return bool(np.mean(dq > 0.1 * top) > 0.02 and np.mean(dq < -0.1 * top) > 0.02)


def _ladder(low: float, high: float) -> np.ndarray:
    return np.geomspace(low, high, max(3, int(np.ceil(np.log(high / low) / np.log(STEPS))) + 1))


Signs = Callable[[TurnOver], list[np.ndarray]]  # of one joint: (N,) smoothed sign of each stretch


def signs_of(segments: Sequence[FineSegment], joint: int) -> Signs:
    """A joint's smoothed signs; what only one of the widths enters is kept while the other one is sought."""

    @lru_cache(maxsize=2)
    def direct(rate: float) -> list[np.ndarray]:
        return [mean_sign(s.speed[:, joint], rate) for s in segments]

    @lru_cache(maxsize=2)
    def state(travel: float) -> list[np.ndarray]:
        turn = TurnOver(0.0, travel)
        return [turn.state(s.q[:, joint], s.speed[:, joint]) for s in segments]

    def made(turn: TurnOver) -> list[np.ndarray]:
        if turn.travel <= 0:
            return direct(turn.rate)
        return [slid(z, x) for z, x in zip(state(turn.travel), direct(turn.rate))]

    return made


class SignColumns:
    """Decimated smoothed signs (M,) of one motion, kept: a later search tries the widths of an earlier one
    again, three times out of four."""

    def __init__(self, limit_bytes: float = 1e7) -> None:
        self.limit = self.room = limit_bytes
        self.motion: tuple[np.ndarray, ...] = ()
        self.kept: dict[tuple[int, TurnOver], np.ndarray] = {}

    def column(
        self, segments: Sequence[FineSegment], joint: int, turn: TurnOver, signs: Signs | None
    ) -> np.ndarray:
        motion = tuple(s.q for s in segments)
        if len(motion) != len(self.motion) or any(q is not its for q, its in zip(motion, self.motion)):
            self.motion, self.kept, self.room = motion, {}, self.limit
        found = self.kept.get((joint, turn))
        if found is None:
            found = _decimated(segments, joint, (signs or signs_of(segments, joint))(turn))
            if found.nbytes <= self.room:
                self.room -= found.nbytes
                self.kept[joint, turn] = found
        return found


def sign_column(
    segments: Sequence[FineSegment],
    rows: Rows,
    joint: int,
    channel: int,
    turn: TurnOver,
    record: Record | None = None,
    signs: Signs | None = None,
    kept: SignColumns | None = None,
) -> np.ndarray:
    """(M,) decimated smoothed sign; record: what is recorded of it, where the torque comes late."""
    if record is None and kept is not None:
        return kept.column(segments, joint, turn, signs) * rows.scale[channel]
    made = (signs or signs_of(segments, joint))(turn)
    made = made if record is None else record(channel, made)
    return _decimated(segments, joint, made) * rows.scale[channel]


def _decimated(segments: Sequence[FineSegment], joint: int, signs: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([s.decimate(sign[:, None], joint)[:, 0] for s, sign in zip(segments, signs)])


def with_turn_overs(
    segments: Sequence[FineSegment], turns: Mapping[int, TurnOver]
) -> tuple[FineSegment, ...]:
    """The fine signals with these joints' signs."""
    out = []
    for s in segments:
        sign = s.sign_dq.copy()
        for joint, turn in turns.items():
            sign[:, joint] = turn.sign(s.q[:, joint], s.speed[:, joint])
        out.append(replace(s, sign_dq=sign))
    return tuple(out)


def with_column(rows: Rows, dry: Dry, columns: Mapping[int, np.ndarray]) -> Rows:
    """The rows with a joint's dry friction columns exchanged."""
    base = list(rows.base)
    for channel, place in dry.places:
        places, values = base[channel]
        values = values.copy()
        values[:, int(np.flatnonzero(places == place)[0])] = columns[channel]
        base[channel] = (places, values)
    return replace(rows, base=tuple(base))


def settle(
    rows: Rows,
    design: Sequence[tuple[np.ndarray, np.ndarray]],
    B: int,
    whiteners: Sequence[Whitener],
    segments: Sequence[FineSegment],
    dry: Sequence[Dry],
    turns: Mapping[int, TurnOver],
    afresh: Collection[int] = (),
    record: Record | None = None,
    sweeps: int = 3,
    kept: SignColumns | None = None,
) -> dict[int, TurnOver]:
    """The widths that fit best beside everything in `design` (whose first columns are the rows' base), near
    `turns`; those of joints without any, and of the joints `afresh`, from all their range. record: what is
    recorded of a sign; kept: columns of an earlier search."""
    dry = [d for d in dry if reverses(segments, d.joint)]
    normal = _Normal.of(rows, design, B, whiteners)
    out = dict(turns)
    moved = {d.joint: True for d in dry}
    asked = np.log(max(int(rows.fitted.sum()), 2))  # a second width has to pay for itself (twice its nats)
    for first in (True, *(False,) * (sweeps - 1)):
        for d in dry:
            if not moved[d.joint]:
                continue
            signs = signs_of(segments, d.joint)
            columns = partial(_columns, segments, rows, whiteners, d, record, signs, kept)
            explained = normal.explaining(d, columns)
            before = out.get(d.joint)
            ladders = grids(segments, d.joint)
            orders = ORDERS if d.travels else (("rate",),)
            starts = [] if before is None else [(before, orders[0], False)]
            if before is not None and before.travel > 0:
                starts.append((replace(before, travel=0.0), orders[0], False))
            if before is None or (d.joint in afresh and first):
                starts += [(TurnOver(float(ladders["rate"][0])), order, True) for order in orders]
            ends = [_climbed(turn, order, whole, ladders, explained) for turn, order, whole in starts]
            plain = [replace(t, travel=0.0) for t in ends]
            turn = max((*ends, *plain), key=lambda t: explained(t) - asked * (t.travel > 0))
            moved[d.joint] = before is None or _far(before, turn)
            if before is not None and not moved[d.joint]:
                turn = before
            normal = normal.taken(d, columns(turn))  # later joints see the new column
            out[d.joint] = turn
        if not any(moved.values()):
            break
    return out


def _columns(
    segments: Sequence[FineSegment],
    rows: Rows,
    whiteners: Sequence[Whitener],
    dry: Dry,
    record: Record | None,
    signs: Signs,
    kept: SignColumns | None,
    turn: TurnOver,
) -> dict[int, np.ndarray]:
    """{channel: (M,)} a joint's dry friction as it turns over, whitened."""
    return {
        c: whiteners[c] @ sign_column(segments, rows, dry.joint, c, turn, record, signs, kept)
        for c in {c for c, _ in dry.places}
    }


@dataclass(frozen=True)
class _Normal:
    """Normal equations of the fitted rows: whitened columns and torque, their products."""

    on: tuple[np.ndarray, ...]  # of each channel the rows that count
    X: tuple[tuple[np.ndarray, np.ndarray], ...]  # (places (k,), (M, k)), 0 on other rows
    y: tuple[np.ndarray, ...]
    gram: np.ndarray
    right: np.ndarray

    @staticmethod
    def of(
        rows: Rows, design: Sequence[tuple[np.ndarray, np.ndarray]], B: int, whiteners: Sequence[Whitener]
    ) -> _Normal:
        on = tuple(rows.fitted & use for use in rows.use)
        X = tuple(
            (places, np.where(o[:, None], w @ values, 0.0))
            for (places, values), w, o in zip(design, whiteners, on)
        )
        y = tuple(np.where(o, w @ torque, 0.0) for torque, w, o in zip(rows.Y, whiteners, on))
        gram, right = np.zeros((B, B)), np.zeros(B)
        for (places, values), torque in zip(X, y):
            gram[np.ix_(places, places)] += values.T @ values
            right[places] += values.T @ torque
        return _Normal(on, X, y, gram, right)

    def exchanged(self, dry: Dry, columns: Mapping[int, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Products with a joint's dry friction columns (whitened) in the place of its own."""
        G, g = self.gram.copy(), self.right.copy()
        own = list({place for _, place in dry.places})
        G[own, :] = G[:, own] = 0.0
        g[own] = 0.0
        for channel, whole in columns.items():
            z = np.where(self.on[channel], whole, 0.0)
            here = [place for c, place in dry.places if c == channel]
            places, values = self.X[channel]
            others = ~np.isin(places, own)
            cross = (values.T @ z)[others]
            for place in here:
                G[places[others], place] += cross
                G[place, places[others]] += cross
                G[place, here] += z @ z
                g[place] += z @ self.y[channel]
        return G, g

    def explaining(
        self, dry: Dry, columns: Callable[[TurnOver], Mapping[int, np.ndarray]]
    ) -> Callable[[TurnOver], float]:
        """What the model with a joint's friction turning over so accounts for; asked twice, computed once."""

        @cache
        def explained(turn: TurnOver) -> float:
            return _explained(*self.exchanged(dry, columns(turn)))

        return explained

    def taken(self, dry: Dry, columns: Mapping[int, np.ndarray]) -> _Normal:
        """The same with these columns in it."""
        X = list(self.X)
        for channel, place in dry.places:
            places, values = X[channel]
            values = values.copy()
            values[:, places == place] = np.where(self.on[channel], columns[channel], 0.0)[:, None]
            X[channel] = places, values
        return _Normal(self.on, tuple(X), self.y, *self.exchanged(dry, columns))


def _explained(gram: np.ndarray, right: np.ndarray) -> float:
    """Whitened sum of squares that the columns of these products account for."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    H = gram / np.outer(scale, scale) + 1e-10 * np.eye(len(scale))
    return float((right / scale) @ np.linalg.solve(H, right / scale))


def _climbed(
    turn: TurnOver,
    order: Sequence[str],
    whole: bool,
    ladders: Mapping[str, np.ndarray],
    explained: Callable[[TurnOver], float],
) -> TurnOver:
    """One width after the other at its best, the first once more at the end; from where they are, or from
    all their range. No travel at all is always tried."""
    for name in (*order, order[0]):
        grid, now = ladders[name], getattr(turn, name)
        if not whole and now > 0:
            near = now * STEPS ** np.arange(-2.0, 2.5)
            grid = near[(near >= 0.999 * grid[0]) & (near <= 1.001 * grid[-1])]
        trials = [replace(turn, **{name: float(w)}) for w in grid]
        values = np.array([explained(t) for t in trials])
        peak = replace(turn, **{name: float(np.exp(_peak(np.log(grid), values)))})
        turn = max((turn, replace(turn, travel=0.0), trials[int(values.argmax())], peak), key=explained)
    return turn


def _far(a: TurnOver, b: TurnOver) -> bool:
    pairs = ((a.rate, b.rate), (a.travel, b.travel))
    return any(abs(np.log(max(x, 1e-12) / max(y, 1e-12))) > 0.1 * np.log(STEPS) for x, y in pairs if x != y)


def _peak(x: np.ndarray, y: np.ndarray) -> float:
    """Where a curve through the points is highest: the vertex of the parabola at the best one."""
    k = int(np.argmax(y))
    if k in (0, len(x) - 1):
        return float(x[k])
    a, b, c = y[k - 1 : k + 2]
    bend = a - 2 * b + c
    shift = 0.5 * (a - c) / bend if bend < 0 else 0.0
    return float(x[k] + shift * (x[1] - x[0]))
