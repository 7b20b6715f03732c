"""How dry friction changes its sign: within a rate and within a travel of presliding, both free.

    sign(dq) ~ z |tanh(dq / rate)|,   dz/dq = (1 - z sign dq) / travel   (Dahl)

The widths belong to Coulomb friction itself, in every hypothesis alike: friction that turns over more
slowly than the model's is no Stribeck curve. Profiled on the fitted rows: a grid in the logarithm of each
width, then a parabola through the best three, joint after joint, until no width moves by a tenth of a step.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.fine import FineSegment
from ident.diagnosis.recorded import Record
from ident.diagnosis.rows import Rows
from ident.diagnosis.whitened import Whitener
from ident.signals.dry_friction import TurnOver

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


def sign_column(
    segments: Sequence[FineSegment],
    rows: Rows,
    joint: int,
    channel: int,
    turn: TurnOver,
    record: Record | None = None,
) -> np.ndarray:
    """(M,) decimated smoothed sign; record: what is recorded of it, where the torque comes late."""
    signs = [turn.sign(s.q[:, joint], s.speed[:, joint]) for s in segments]
    signs = signs if record is None else record(channel, signs)
    made = [s.decimate(sign[:, None], joint)[:, 0] for s, sign in zip(segments, signs)]
    return np.concatenate(made) * rows.scale[channel]


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
) -> dict[int, TurnOver]:
    """The widths that fit best beside everything in `design` (whose first columns are the rows' base), near
    `turns`; those of joints without any, and of the joints `afresh`, from all their range. record: what is
    recorded of a sign."""
    fitted = rows.fitted
    dry = [d for d in dry if reverses(segments, d.joint)]
    X = [w @ values for (_, values), w in zip(design, whiteners)]
    y = [w @ rows.Y[c] for c, w in enumerate(whiteners)]
    gram, right = np.zeros((B, B)), np.zeros(B)
    power = 0.0
    for c, (places, _) in enumerate(design):
        on = fitted & rows.use[c]
        gram[np.ix_(places, places)] += X[c][on].T @ X[c][on]
        right[places] += X[c][on].T @ y[c][on]
        power += float(y[c][on] @ y[c][on])
    out = dict(turns)
    moved = {d.joint: True for d in dry}
    for first in (True, *(False,) * (sweeps - 1)):
        for d in dry:
            if not moved[d.joint]:
                continue

            def trial(
                turn: TurnOver, d: Dry = d, gram: np.ndarray = gram, right: np.ndarray = right
            ) -> tuple[float, np.ndarray, np.ndarray]:
                G, g = gram.copy(), right.copy()
                for place in {place for _, place in d.places}:
                    G[place, :] = G[:, place] = 0.0
                    g[place] = 0.0
                own = {place for _, place in d.places}
                for channel in {channel for channel, _ in d.places}:
                    on = fitted & rows.use[channel]
                    z = whiteners[channel] @ sign_column(segments, rows, d.joint, channel, turn, record)
                    z = z[on]
                    here = [place for c, place in d.places if c == channel]
                    places = design[channel][0]
                    others = ~np.isin(places, list(own))
                    cross = X[channel][on][:, others].T @ z
                    for place in here:
                        G[places[others], place] += cross
                        G[place, places[others]] += cross
                        G[place, here] += z @ z
                        g[place] += z @ y[channel][on]
                scale = np.sqrt(np.maximum(np.diag(G), 1e-300))
                H = G / np.outer(scale, scale) + 1e-10 * np.eye(B)
                explained = float((g / scale) @ np.linalg.solve(H, g / scale))
                return explained, G, g

            before = out.get(d.joint)
            ladders = grids(segments, d.joint)
            orders = ORDERS if d.travels else (("rate",),)
            starts = [] if before is None else [(before, orders[0], False)]
            if before is not None and before.travel > 0:
                starts.append((replace(before, travel=0.0), orders[0], False))
            if before is None or (d.joint in afresh and first):
                starts += [(TurnOver(float(ladders["rate"][0])), order, True) for order in orders]
            ends = [
                _climbed(turn, order, whole, ladders, lambda t: trial(t)[0]) for turn, order, whole in starts
            ]
            plain = [replace(t, travel=0.0) for t in ends]
            asked = np.log(max(int(fitted.sum()), 2))  # a second width has to pay for itself (twice its nats)
            turn = max((*ends, *plain), key=lambda t: trial(t)[0] - asked * (t.travel > 0))
            _, gram, right = trial(turn)
            out[d.joint] = turn
            for channel, place in d.places:  # later joints see the new column
                column = whiteners[channel] @ sign_column(segments, rows, d.joint, channel, turn, record)
                X[channel] = X[channel].copy()
                X[channel][:, int(np.flatnonzero(design[channel][0] == place)[0])] = column
            moved[d.joint] = before is None or _far(before, turn)
        if not any(moved.values()):
            break
    return out


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
