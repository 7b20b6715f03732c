"""Signals that a function without a name may read: the joint's own, its memory, its load, its neighbours'."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ident.diagnosis.evidence.metric import Metric
from ident.equations.fine import FineSegment

LEVELS = 6  # of the position that it remembers to have passed


@dataclass(frozen=True, slots=True)
class Signals:
    """What functions are made of, one array a segment: name -> values (N,), scaled to about one."""

    own: dict[str, list[np.ndarray]]
    others: dict[str, list[np.ndarray]]
    rate_widths: tuple[float, ...]  # of signs of the scaled rate
    loops: Callable[[], list[np.ndarray]]  # (N, k) of the position's past, not made before they are asked


def signals_of(segments: Sequence[FineSegment], joint: int, load: Sequence[np.ndarray]) -> Signals:
    """Scaled signals of a joint (0-based) and of the others; load (N,) per segment [N m]."""
    n = segments[0].q.shape[1]
    number = joint + 1
    own = {
        f"q{number}": scaled([s.q[:, joint] for s in segments], True),
        f"dq{number}": scaled([s.dq[:, joint] for s in segments], False),
        f"ddq{number}": scaled([s.ddq[:, joint] for s in segments], False),
        "tau": scaled(list(load), False),
        "t": scaled([s.t for s in segments], True),
    }
    for name, parts in _memory(segments, joint).items():
        own[name] = scaled(parts, False)
    others = {}
    for k in range(n):
        if k != joint:
            others[f"q{k + 1}"] = scaled([s.q[:, k] for s in segments], True)
            others[f"dq{k + 1}"] = scaled([s.dq[:, k] for s in segments], False)
            others[f"ddq{k + 1}"] = scaled([s.ddq[:, k] for s in segments], False)
    speed = np.abs(np.concatenate(own[f"dq{number}"]))
    low = float(np.quantile(speed, 0.05))
    widths = tuple(np.geomspace(max(low, 3e-3), 0.5, 4))
    return Signals(own, others, widths, partial(_loops, [s.q[:, joint] for s in segments]))


def scaled(parts: Sequence[np.ndarray], centre: bool) -> list[np.ndarray]:
    """To at most one, about zero or about the middle of their range."""
    whole = np.concatenate(list(parts))
    middle = 0.5 * (whole.max() + whole.min()) if centre else 0.0
    reach = max(float(np.abs(whole - middle).max()), 1e-12)
    return [(part - middle) / reach for part in parts]


def within(signals: Signals, m: Metric, segments: Sequence[FineSegment]) -> Signals:
    """Held at the ends of what the fitted rows saw: a function says nothing of what lies beyond."""
    ends = np.cumsum([s.rows for s in segments])
    seen = [bool(m.fitted.mask[end - s.rows : end].any()) for s, end in zip(segments, ends)]

    def held(parts: list[np.ndarray]) -> list[np.ndarray]:
        known = [part for part, its in zip(parts, seen) if its] or parts
        low, high = min(part.min() for part in known), max(part.max() for part in known)
        return [np.clip(part, low, high) for part in parts]

    return replace(
        signals,
        own={name: held(parts) for name, parts in signals.own.items()},
        others={name: held(parts) for name, parts in signals.others.items()},
    )


def _memory(segments: Sequence[FineSegment], joint: int) -> dict[str, list[np.ndarray]]:
    """What a joint can remember of its last reversal: travel and age since then, each fading, with its
    sign."""
    whole = np.concatenate([s.q[:, joint] for s in segments])
    reach = max(float(np.ptp(whole)), 1e-9)
    out: dict[str, list[np.ndarray]] = {"memory": [], "memory_near": [], "memory_late": [], "memory_fast": []}
    for s in segments:
        dq, step = s.dq[:, joint], 1.0 / s.rate_hz
        sign = np.sign(dq)
        turned = np.flatnonzero(np.diff(sign, prepend=sign[0]) != 0)
        last = np.zeros(len(dq), int)
        last[turned] = turned
        last = np.maximum.accumulate(last)
        travel = np.abs(s.q[:, joint] - s.q[last, joint])
        age = (np.arange(len(dq)) - last) * step
        out["memory"].append(sign * np.exp(-travel / (0.1 * reach)))
        out["memory_near"].append(sign * np.exp(-travel / (0.01 * reach)))
        out["memory_late"].append(sign * np.exp(-age / 0.5))
        out["memory_fast"].append(sign * np.exp(-age / 0.1))
    return out


def _loops(parts: Sequence[np.ndarray]) -> list[np.ndarray]:
    """(N, k) relays of Preisach's model, of which whatever remembers a path and not its pace is made: 1 from
    where the position rises past a level until it falls past a lower one, -1 from there on, 0 until either is
    known."""
    levels = np.quantile(np.concatenate(list(parts)), (np.arange(LEVELS) + 0.5) / LEVELS)
    low, high = levels[np.array(np.triu_indices(LEVELS, 1))]
    out = []
    for q in parts:
        known = (q[:, None] >= high).astype(int) - (q[:, None] <= low)
        last = np.maximum.accumulate(np.where(known != 0, np.arange(len(q))[:, None], 0), axis=0)
        out.append(np.take_along_axis(known, last, axis=0).astype(float))
    return out
