"""How dry friction changes its sign: within a rate and within a travel of presliding, both free.

    sign(dq) ~ z |tanh(dq / rate)|,   dz/dq = (1 - z sign dq) / travel   (Dahl)

The widths belong to Coulomb friction itself, in every hypothesis alike: friction that turns over more
slowly than the model's is no Stribeck curve. A travel that the samples show needs no rate:
the least one that is tried is a friction that falls for a moment wherever the joint stops to turn. A second
width has to pay for itself beside the first, and for its choice among so many; so has the only one of a joint
that goes one way, which shows it by starts and stops alone. (Of positions in steps as long as the travel any
gain let friction fall before a joint turned: eight rows of a thousand were four fifths of an error.) Profiled
on the fitted rows; where parts of a run judge others, on all, as their slow noise is: a joint that turned in
these alone was told as coupled to another. A grid in the logarithm of each width, then parabolas through the
best three, joint after joint, until no other width says more than chance.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

import numpy as np
import scipy.linalg

from ident.diagnosis.rows.rows import Rows
from ident.diagnosis.rows.signs import How, SignColumns, sign_columns
from ident.diagnosis.rows.whitened import Whitener
from ident.equations.fine import FineSegment
from ident.signals.dry_friction import TurnOver

SLOWEST, HIGHEST = 1e-4, 0.3  # of the top rate: least and largest width; of the travel: largest presliding
ORDINARY = 0.1  # rad/s, m/s: up to there in slow motions, whose friction is no other one
STRAIGHT = 2.0  # times the top rate: a sign that turns over so slowly is a straight line
SHORTEST, LONGEST = 2e-6, 2e-3  # of the joint's travel: least and largest presliding, or what no effect has
STEPS = 1.5  # ratio of the grid
CHANCE = 1.0  # of a whitened sum of squares: what any width gains by chance, in the mean
NEAR = 4.0  # of the same: how far below the summit a parabola is that of the curve
PARABOLAS = 6
AROUND = np.array([-1.0, -0.25, 0.25, 1.0])  # steps from a width at which it is asked whether it is the best
SAMPLES = 2.0  # in which a joint covers what its recording cannot show of a travel
RIDGE = 1e-10  # of the scaled Gram matrix: directions without data
ORDERS = (("rate", "travel"), ("travel", "rate"))  # which width first; either can stand in for the other

Columns = Mapping[int, np.ndarray]  # of the channels
Explained = Callable[[Sequence[TurnOver]], np.ndarray]  # (K,) what each of K turn-overs accounts for


@dataclass(frozen=True, slots=True)
class Dry:
    """Where a joint's dry friction stands: (channel, place of its parameter). travels: whether it may give
    way before it slips; shorter [rad | m]: than any effect has it, a travel is no other friction."""

    joint: int
    places: tuple[tuple[int, int], ...]
    travels: bool = True
    shorter: float = 0.0


def grids(segments: Sequence[FineSegment], joint: int, shorter: float = 0.0) -> dict[str, np.ndarray]:
    """Widths to try; shorter: as of `Dry`."""
    top = max(float(np.abs(s.speed[:, joint]).max()) for s in segments)
    noise = max(float(s.vs[joint]) for s in segments) / 10
    reach = max(s.q[:, joint].max() for s in segments) - min(s.q[:, joint].min() for s in segments)
    low = max(noise, SLOWEST * top, 1e-9)
    return {
        "rate": _ladder(low, max(HIGHEST * top, min(ORDINARY, STRAIGHT * top), 1.5 * low)),
        "travel": _ladder(
            SHORTEST * reach + 1e-12, max(LONGEST * reach, min(shorter, HIGHEST * reach)) + 2e-12
        ),
    }


def ways(segments: Sequence[FineSegment], joint: int) -> int:
    """In how many directions a joint goes for certain."""
    speed = np.concatenate([np.where(s.certain[:, joint] >= 1, s.speed[:, joint], 0.0) for s in segments])
    return int((speed > 0).any()) + int((speed < 0).any())


def unseen_travel(segments: Sequence[FineSegment], joint: int) -> float:
    """What a joint covers within SAMPLES of its usual turn [rad | m]."""
    steps, rate = [], segments[0].rate_hz
    for s in segments:
        speed = s.speed[:, joint]
        turns = np.flatnonzero(speed[1:] * speed[:-1] < 0)
        steps.append(np.abs(speed[turns + 1] - speed[turns]))
    each = np.concatenate(steps)
    return float(0.5 * np.median(each) * SAMPLES**2 / rate) if len(each) else 0.0


def _ladder(low: float, high: float) -> np.ndarray:
    return np.geomspace(low, high, max(3, int(np.ceil(np.log(high / low) / np.log(STEPS))) + 1))


def with_turn_overs(
    segments: Sequence[FineSegment], turns: Mapping[int, TurnOver]
) -> tuple[FineSegment, ...]:
    """The fine signals with these joints' signs."""
    out = []
    for s in segments:
        sign = s.sign_dq.copy()
        for joint, turn in turns.items():
            sign[:, joint] = turn.sign(s.q[:, joint], s.speed[:, joint], s.rate_hz)
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
    record: Mapping[tuple[int, int], How] = MappingProxyType({}),
    sweeps: int = 3,
    kept: SignColumns | None = None,
    motion: Sequence[FineSegment] = (),
) -> dict[int, TurnOver]:
    """The widths that fit best beside everything in `design` (whose first columns are the rows' base), near
    `turns`; those of joints without any, and of the joints `afresh`, from all their range. record: {(joint,
    channel): what is recorded of a sign}; kept: columns of an earlier search; motion: all segments, whose
    range it is, where only some are fitted."""
    motion, kept = motion or segments, kept or SignColumns()
    went = {d.joint: ways(motion, d.joint) for d in dry}
    both = {joint: its == 2 for joint, its in went.items()}  # what goes one way starts and stops
    dry = [replace(d, travels=d.travels and both[d.joint]) for d in dry if went[d.joint]]
    shown = rows.fitted if rows.held_apart else rows.usable
    normal = _Normal.of(rows, shown, design, B, whiteners)
    out = dict(turns)
    moved = {d.joint: True for d in dry}
    number = np.log(max(int(shown.sum()), 2))  # what one more has to say (twice its nats)
    for first in (True, *(False,) * (sweeps - 1)):
        for d in dry:
            if not moved[d.joint]:
                continue
            columns = partial(_columns, segments, rows, whiteners, d, record, kept)
            explained = normal.explaining(d, columns)
            before = out.get(d.joint)
            ladders = grids(motion, d.joint, d.shorter)
            asked = {name: number + 2 * np.log(len(grid)) for name, grid in ladders.items()}  # and its choice
            seen = unseen_travel(motion, d.joint)
            orders = ORDERS if d.travels else (("rate",),)
            if before is not None and not (d.joint in afresh and first):
                moved[d.joint] = not _rests(before, orders[0], ladders, seen, asked, explained)
                if not moved[d.joint]:
                    continue
            starts = [] if before is None else [(before, orders[0], False)]
            if before is not None and before.travel > 0:
                starts.append((replace(before, travel=0.0), orders[0], False))
            if before is None or (d.joint in afresh and first):
                starts += [(TurnOver(float(ladders["rate"][0])), order, True) for order in orders]
            ends = [_climbed(turn, order, whole, ladders, seen, explained) for turn, order, whole in starts]
            ends += [replace(t, travel=0.0, instant=i) for t in ends for i in (t.instant, not t.instant)]
            paid = explained(ends) - asked["travel"] * np.array([t.travel > 0 for t in ends])
            turn = ends[int(paid.argmax())]
            if before is None and not both[d.joint]:  # its constant friction is an offset
                moved[d.joint] = bool(np.subtract(*explained([turn, starts[0][0]])) > asked["rate"])
                if not moved[d.joint]:
                    continue
            if turn.rate > 0 and turn.travel > seen:  # so has a rate beside a travel
                bare = _climbed(replace(turn, rate=0.0), ("travel",), False, ladders, seen, explained)
                turn = turn if np.subtract(*explained([turn, bare])) > asked["rate"] else bare
            if before is not None:
                travels = np.array([turn.travel > 0, before.travel > 0])
                gained = np.subtract(*(explained([turn, before]) - asked["travel"] * travels))
                moved[d.joint] = gained > CHANCE or _far(before, turn)
                turn = turn if moved[d.joint] else before
            its = {c: z[:, 0] for c, z in columns([turn]).items()}
            normal = normal.taken(d, its)  # later joints see the new column
            out[d.joint] = turn
        if not any(moved.values()):
            break
    return out


def _columns(
    segments: Sequence[FineSegment],
    rows: Rows,
    whiteners: Sequence[Whitener],
    dry: Dry,
    record: Mapping[tuple[int, int], How],
    kept: SignColumns,
    turns: Sequence[TurnOver],
) -> dict[int, np.ndarray]:
    """{channel: (M, turns)} a joint's dry friction as it turns over, whitened."""
    return {
        c: whiteners[c] @ sign_columns(segments, rows, dry.joint, c, turns, record.get((dry.joint, c)), kept)
        for c in {c for c, _ in dry.places}
    }


@dataclass(frozen=True)
class _Normal:
    """Normal equations of some rows: whitened columns and torque, their products."""

    on: tuple[np.ndarray, ...]  # of each channel the rows that count
    X: tuple[tuple[np.ndarray, np.ndarray], ...]  # (places (k,), (M, k)), 0 on other rows
    y: tuple[np.ndarray, ...]
    gram: np.ndarray
    right: np.ndarray

    @staticmethod
    def of(
        rows: Rows,
        shown: np.ndarray,
        design: Sequence[tuple[np.ndarray, np.ndarray]],
        B: int,
        whiteners: Sequence[Whitener],
    ) -> _Normal:
        on = tuple(shown & use for use in rows.use)
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

    def exchanged(self, dry: Dry, columns: Columns) -> tuple[np.ndarray, np.ndarray]:
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

    def explaining(self, dry: Dry, columns: Callable[[Sequence[TurnOver]], Columns]) -> Explained:
        """What the model with a joint's friction turning over so accounts for; asked twice, computed once."""
        beside = self.beside(dry)
        known: dict[TurnOver, float] = {}

        def explained(turns: Sequence[TurnOver]) -> np.ndarray:
            new = [turn for turn in dict.fromkeys(turns) if turn not in known]
            if new:
                known.update(zip(new, beside(columns(new)).tolist()))
            return np.array([known[turn] for turn in turns])

        return explained

    def beside(self, dry: Dry) -> Callable[[Columns], np.ndarray]:
        """Whitened sum of squares that the model accounts for with a joint's dry friction columns {channel:
        (M, K)} (whitened) in the place of its own, (K,). All that is not the joint's is factored once."""
        own = sorted({place for _, place in dry.places})
        free = np.delete(np.arange(len(self.right)), own)
        G = self.gram[np.ix_(free, free)]
        scale = np.sqrt(np.maximum(np.diag(G), 1e-300))
        factor = scipy.linalg.lu_factor(G / np.outer(scale, scale) + RIDGE * np.eye(len(free)))
        right = self.right[free] / scale
        without = float(right @ scipy.linalg.lu_solve(factor, right))

        def accounted(columns: Columns) -> np.ndarray:
            p, K = len(own), next(iter(columns.values())).shape[1]
            cross, told = np.zeros((len(self.right), p, K)), np.zeros((p, K))
            squares = np.zeros((p, p, K))
            for channel, whole in columns.items():
                z = np.where(self.on[channel][:, None], whole, 0.0)
                here = [own.index(place) for c, place in dry.places if c == channel]
                places, values = self.X[channel]
                along, size = values.T @ z, np.sum(z * z, axis=0)
                for k in here:
                    cross[places, k] += along
                    squares[k, here] += size
                    told[k] += self.y[channel] @ z
            sizes = np.sqrt(np.maximum(np.einsum("kkn->kn", squares), 1e-300))
            cross = cross[free] / scale[:, None, None] / sizes
            answer = scipy.linalg.lu_solve(factor, cross.reshape(len(free), -1)).reshape(cross.shape)
            left = np.einsum("fan,fbn->nab", -cross, answer) + RIDGE * np.eye(p)
            left += np.transpose(squares / sizes[:, None] / sizes, (2, 0, 1))
            news = (told / sizes - np.einsum("f,fan->an", right, answer)).T
            return without + np.einsum("na,na->n", news, np.linalg.solve(left, news[:, :, None])[:, :, 0])

        return accounted

    def taken(self, dry: Dry, columns: Columns) -> _Normal:
        """The same with these columns in it."""
        X = list(self.X)
        for channel, place in dry.places:
            places, values = X[channel]
            values = values.copy()
            values[:, places == place] = np.where(self.on[channel], columns[channel], 0.0)[:, None]
            X[channel] = places, values
        return _Normal(self.on, tuple(X), self.y, *self.exchanged(dry, columns))


def _rests(
    turn: TurnOver,
    names: Sequence[str],
    ladders: Mapping[str, np.ndarray],
    seen: float,
    asked: Mapping[str, float],
    explained: Explained,
) -> bool:
    """Whether no width about a turn-over's, and no turn-over without one of its widths, says more than chance
    beside what each width has to say. These are the same whatever else is in the model, and most joints' stay
    where they are: a climb from there asks for three times as many that nobody has asked for."""
    otherwise = replace(turn, instant=not turn.instant)
    near: list[TurnOver] = [turn, otherwise, replace(otherwise, travel=0.0)]
    rises: list[float] = []
    for way in (turn, replace(turn, travel=0.0), replace(turn, rate=0.0)):
        if not way.rate and way.travel <= seen:  # a friction that no width lets turn over
            continue
        near.append(way)
        for name in names:
            grid, now = ladders[name], getattr(way, name)
            widths = now * STEPS**AROUND if now else grid
            trials = [_of_width(way, name, w) for w in widths if grid[0] <= w <= grid[-1]]
            near += trials
            if way == turn and now and len(trials) == len(AROUND):
                x, y = AROUND[1:-1] * np.log(STEPS), explained([trials[1], turn, trials[2]])
                rises.append(_promised(np.array([x[0], 0.0, x[1]]), y))
    price = [
        asked["travel"] * (t.travel > 0) + asked["rate"] * (t.rate > 0 and t.travel > seen) for t in near
    ]
    paid = explained(near) - np.array(price)
    return bool(paid.max() - paid[0] <= CHANCE and max(rises, default=0.0) <= CHANCE)


def _climbed(
    turn: TurnOver,
    order: Sequence[str],
    whole: bool,
    ladders: Mapping[str, np.ndarray],
    seen: float,
    explained: Explained,
) -> TurnOver:
    """One width after the other at its best, the first once more at the end; from where they are, or from
    all their range. No travel at all, and a torque recorded the other way, are always tried, and no rate
    beside a travel that is `seen`."""
    for name in (*order, order[0]):
        grid, now = ladders[name], getattr(turn, name)
        if not whole and now > 0:
            near = now * STEPS ** np.arange(-2.0, 2.5)
            grid = near[(near >= 0.999 * grid[0]) & (near <= 1.001 * grid[-1])]
        kept = [turn, replace(turn, travel=0.0), replace(turn, instant=not turn.instant)]
        kept += [replace(turn, rate=0.0)] if turn.travel > seen else []
        if name == "travel" and turn.rate <= 0:
            grid = grid[grid > seen]
        likely = kept
        if len(grid):
            trials = [_of_width(turn, name, w) for w in grid]
            values = explained([*kept, *trials])[len(kept) :]
            peak = _of_width(turn, name, _summit(grid, values, partial(_at, turn, name, explained)))
            likely = [*kept, trials[int(values.argmax())], peak]
        turn = likely[int(explained(likely).argmax())]
    return turn


def _far(a: TurnOver, b: TurnOver) -> bool:
    pairs = ((a.rate, b.rate), (a.travel, b.travel))
    return any(abs(np.log(max(x, 1e-12) / max(y, 1e-12))) > 0.1 * np.log(STEPS) for x, y in pairs if x != y)


def _of_width(turn: TurnOver, name: str, width: float) -> TurnOver:
    return replace(turn, **{name: float(width)})  # type: ignore[arg-type]  # rate or travel


def _at(turn: TurnOver, name: str, explained: Explained, width: float) -> float:
    return float(explained([_of_width(turn, name, width)])[0])


def _summit(grid: np.ndarray, values: np.ndarray, explained: Callable[[float], float]) -> float:
    """The width that explains most: parabola after parabola, in its logarithm, each through widths about the
    last one's vertex that lie NEAR below it, until one promises no more than chance. (One alone, through
    widths a half apart, was 5 % off: 11 nats, and beside it viscous friction bent.)"""
    x, y = np.log(grid), values
    k = int(np.argmax(y))
    if k in (0, len(x) - 1):
        return float(grid[k])
    x, y = x[k - 1 : k + 2], y[k - 1 : k + 2]
    for _ in range(PARABOLAS):
        peak, bend = _vertex(x, y)
        reach = np.sqrt(2 * NEAR / max(-bend, 1e-300))
        if -0.5 * bend * (peak - x[1]) ** 2 < CHANCE and x[2] - x[0] < 3 * reach:
            break
        x = peak + np.minimum(reach, x[2] - x[1]) * np.array([-1.0, 0.0, 1.0])
        y = np.array([explained(float(w)) for w in np.exp(x)])
    return float(np.exp(peak))


def _promised(x: np.ndarray, y: np.ndarray) -> float:
    """By how much the parabola through three points rises above the middle one."""
    peak, bend = _vertex(x, y)
    return float(-0.5 * bend * (peak - x[1]) ** 2)


def _vertex(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Of the parabola through three points, no further off than they reach, and its second derivative; of one
    that opens upwards the best point."""
    left, right = x[[0, 2]] - x[1]
    down, up = y[[0, 2]] - y[1]
    bend = 2 * (up / right - down / left) / (right - left)
    if not bend < 0:
        return float(x[np.argmax(y)]), 0.0
    off = 0.5 * right - up / right / bend
    return float(x[1] + np.clip(off, 2 * left, 2 * right)), float(bend)
