"""What anything smooth could explain: penalised functions of one signal or two, without a name.

Per channel, groups of functions of the joint's own position, rate, acceleration, load and time, of what it
remembers of its last reversal and of its path, of the other joints' motion, products of two of them, and
waves over the position. None is made after the shape of an effect. A group's evidence on the fitted rows is
that of a Gaussian prior of one common size on its scaled columns (Bayesian ridge),

    max over lambda of  1/2 sum_i [ (U'g)_i^2 lambda / (1 + lambda s_i) - ln(1 + lambda s_i) ],

G = U S U' the columns' products and g those with the residual, the model partialled out. Its posterior mean
is one column; what that says on the judged rows is compared with what an effect with a name says there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial

import numpy as np

from ident.cores import in_order
from ident.diagnosis.evidence.evidence import Evidence, weigh
from ident.diagnosis.evidence.metric import Metric
from ident.diagnosis.evidence.signals import Signals, scaled, signals_of, within
from ident.equations.fine import FineSegment

LAMBDAS = np.geomspace(1e-4, 1e6, 41)
HATS = 13
BENDS = 20  # degree of polynomials: some five waves over the range
SHORT = 60_000  # fine samples, five minutes: up to there what is made is kept, and two cores share the work
FEW = 5_000  # rows of which the columns of all groups are kept: a fifth of a gigabyte
UNSEEN = 1e-9  # share of a column's squares on the fitted rows
WAVES = 3  # peaks of the residual's spectrum over the position


@dataclass(frozen=True, slots=True)
class Flexible:
    """The best function found: its signals, its column (M,) as learned, what it says; what functions of the
    same signal of other joints say (their names, nats), where that was asked; the columns (M, k) that it is
    made of, each at the size that the prior gives it. `fitted` is what it says of the fitted rows as
    a law's gain does, the noise being what is left; its size is paid for."""

    variables: tuple[str, ...]
    column: np.ndarray
    prior_evidence: float  # nats on the fitted rows, its own size paid for
    evidence: Evidence
    others: tuple[tuple[str, float], ...] = ()
    room: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    fitted: float = -np.inf


def _basis(name: str, x: np.ndarray, widths: Sequence[float]) -> np.ndarray:
    """(N, k) functions of one scaled signal."""
    if name.startswith("dq"):
        signs = [np.tanh(x / w) for w in widths]
        return np.stack([*signs, x, x * np.abs(x), x**3, np.abs(x), x**2], axis=1)
    if name.startswith("ddq"):
        return np.stack([x, x * np.abs(x)], axis=1)
    if name.startswith("memory"):
        return x[:, None]
    degree = 4
    return np.polynomial.legendre.legvander(x, degree)[:, 1:]


def _local(x: np.ndarray) -> np.ndarray:
    """(N, HATS) hat functions over the range: what bends in one place, and says nothing beyond it."""
    width = 2.0 / (HATS - 1)
    return np.maximum(0.0, 1.0 - np.abs(x[:, None] - np.linspace(-1.0, 1.0, HATS)) / width)


Signal = Callable[[FineSegment], np.ndarray]  # (N,) of a segment
Made = Callable[[int], np.ndarray]  # number of a segment -> (N, k) on its fine samples
Column = Callable[[Made], np.ndarray]  # the same on the rows: (M, k)
Group = tuple[tuple[str, ...], Callable[[], np.ndarray]]  # signals, columns (M, k)
Told = tuple[tuple[str, ...], tuple[float, np.ndarray, np.ndarray, float]]  # signals, `_ridge` of them


def _groups(signals: Signals, joint: int, segments: int, on_rows: Column, short: bool) -> Iterator[Group]:
    """Every group. What several of them share is made once: functions of one signal on the rows, and those of
    the latest signals on the fine samples; of long recordings nothing is kept, which would be a tenth of a
    gigabyte of ten minutes."""
    number = joint + 1
    every = {**signals.own, **signals.others}

    @lru_cache(maxsize=3 * segments if short else 0)
    def fine(name: str, k: int) -> np.ndarray:
        return _basis(name, every[name][k], signals.rate_widths)

    @lru_cache(maxsize=None if short else 0)
    def basis(name: str) -> np.ndarray:
        return on_rows(lambda k: fine(name, k))

    def one(name: str) -> Callable[[], np.ndarray]:
        return lambda: np.hstack([basis(name), on_rows(lambda k: _local(every[name][k]))])

    def two(a: str, b: str) -> Callable[[], np.ndarray]:
        def product(k: int) -> np.ndarray:
            first, second = fine(a, k), fine(b, k)
            return (first[:, :, None] * second[:, None, :]).reshape(len(first), -1)

        return lambda: np.hstack([on_rows(product), basis(a), basis(b)])

    memory = [name for name in signals.own if name.startswith("memory")]
    yield (
        (f"dq{number}", "memory"),
        lambda: on_rows(lambda k: np.stack([every[name][k] for name in memory], axis=1)),
    )
    yield (f"q{number}", "memory"), lambda: on_rows(signals.loops().__getitem__)
    main = [f"q{number}", f"dq{number}", "tau", f"ddq{number}", "t"]
    for name in main:
        yield (name,), one(name)
    for i, a in enumerate(main):
        for b in main[i + 1 :]:
            yield (a, b), two(a, b)
    for name in signals.others:
        yield (name,), one(name)
    for name in signals.others:
        if name.startswith(("q", "dq")):
            yield (f"q{number}", name), two(f"q{number}", name)
            yield (f"dq{number}", name), two(f"dq{number}", name)


def wave_peaks(
    segments: Sequence[FineSegment], joint: int, back: Sequence[np.ndarray], top: float
) -> list[float]:
    """Wavenumbers [1/rad | 1/m] where the residual, spread over the position, has its largest lines."""
    x = np.concatenate([s.q[:, joint] for s in segments])
    w = np.concatenate(list(back))
    low, reach = float(x.min()), max(float(np.ptp(x)), 1e-9)
    first = max(2 * np.pi / reach, 1e-9)
    top = min(top, first * 20_000)
    width = np.pi / (4 * top)
    size = 1 << int(np.ceil(np.log2(max(8 * reach / width, 16))))
    density = np.bincount(np.floor((x - low) / width).astype(int), weights=w, minlength=8)
    power = np.abs(np.fft.rfft(density, size)) ** 2
    k = 2 * np.pi * np.arange(len(power)) / (size * width)
    power[(k < 1.5 * first) | (k > top)] = 0.0
    peaks = []
    for _ in range(WAVES):
        best = int(np.argmax(power))
        if power[best] <= 0:
            break
        peaks.append(float(k[best]))
        power[np.abs(k - k[best]) < first] = 0.0
    return peaks


def flexible(
    metrics: Sequence[Metric],
    channel: int,
    joint: int,
    segments: Sequence[FineSegment],
    load: Sequence[np.ndarray],
    top_wave: float,
    wanted: float,
    only: frozenset[str] | None = None,
    made: dict[int, np.ndarray] | None = None,
) -> list[Flexible | None]:
    """The function of the channel with the largest evidence on the fitted rows, of the signals in `only`
    where they are given; None below `wanted` nats. One in each noise: the columns are made once for all, and
    those of few rows kept in `made` for the next noise."""
    one = metrics[0]
    signals = within(signals_of(segments, joint, load), one, segments)

    def on_rows(made: Made) -> np.ndarray:
        Z = np.concatenate([s.decimate(made(k), joint) for k, s in enumerate(segments)])
        Z *= one.rows.scale[channel][:, None]
        return Z

    def shared(number: int) -> list[Told]:
        kept = made if made is not None and len(one.rows.t) <= FEW else {}
        if number not in kept:
            kept[number] = groups[number][1]()
        return [(groups[number][0], _ridge(m, channel, kept[number])) for m in metrics]

    short = sum(len(s.t) for s in segments) <= SHORT
    groups = list(_groups(signals, joint, len(segments), on_rows, short))
    asked = [k for k, group in enumerate(groups) if only is None or set(group[0]) <= only]
    common = list((in_order if short else map)(shared, asked))
    out: list[Flexible | None] = []
    for number, m in enumerate(metrics):
        waves = _waves(m, channel, joint, segments, signals, on_rows, top_wave)
        waves = [group for group in waves if only is None or set(group[0]) <= only]
        told = [each[number] for each in common] + [
            (variables, _ridge(m, channel, columns())) for variables, columns in waves
        ]
        best = max(told, key=lambda its: its[1][0], default=None)
        if best is None or best[1][0] < wanted:
            out.append(None)
            continue
        variables, (value, column, room, price) = best
        evidence = weigh(m, {channel: column[:, None]}, np.ones(1))
        out.append(Flexible(variables, column, value, evidence, room=room, fitted=evidence.gain - price))
    return out


def _waves(
    m: Metric,
    channel: int,
    joint: int,
    segments: Sequence[FineSegment],
    signals: Signals,
    on_rows: Column,
    top_wave: float,
) -> list[Group]:
    """Over the position, at the lines of what is left, and times the rate: a wave that goes with the rate has
    its line in what is left times the rate, and none over the position."""
    back = _spread(m, channel, joint, segments)
    name, rates = f"q{joint + 1}", signals.own[f"dq{joint + 1}"]
    lines = wave_peaks(segments, joint, back, top_wave)
    moving = wave_peaks(segments, joint, [b * x for b, x in zip(back, rates)], top_wave)
    out: list[Group] = [((name,), partial(on_rows, _wave(segments, joint, k, None))) for k in lines]
    for k in dict.fromkeys([*lines, *moving]):
        out.append(((name, f"dq{joint + 1}"), partial(on_rows, _wave(segments, joint, k, rates))))
    return out


def imitation(
    m: Metric,
    channel: int,
    joint: int,
    segments: Sequence[FineSegment],
    signal: Signal,
    torque: np.ndarray,
    rate: int | None = None,
) -> np.ndarray:
    """(M,) the polynomial in a signal that comes nearest to a torque (M,) on all rows, as it tells no torque;
    with a joint whose `rate` it reads, too, also times its sign and times itself. (No hats: what bends at a
    point is all new to a whitener of smooth noise.)"""
    unit = scaled([signal(s) for s in segments], True)
    made = [np.polynomial.legendre.legvander(x, BENDS) for x in unit]
    if rate is not None:
        by = [(s.sign_dq[:, rate, None], s.dq[:, rate, None]) for s in segments]
        made = [np.hstack([z, *(z * x for x in factors)]) for z, factors in zip(made, by)]
    Z = np.concatenate([s.decimate(z, joint) for z, s in zip(made, segments)])
    Z *= m.rows.scale[channel][:, None]
    on = (m.fitted.mask | m.judged.mask) & m.rows.use[channel]
    white = m.whiteners[channel]
    a = np.linalg.lstsq((white @ Z)[on], (white @ torque)[on], rcond=1e-9)[0]
    return np.asarray(Z @ a)


def _wave(segments: Sequence[FineSegment], joint: int, k: float, rate: list[np.ndarray] | None) -> Made:
    def columns(number: int) -> np.ndarray:
        q = segments[number].q[:, joint]
        waves = np.stack([np.sin(k * q), np.cos(k * q)], axis=1)
        if rate is None:
            return waves
        x = rate[number][:, None]
        return np.hstack([waves, waves * np.tanh(x / 0.02), waves * x])

    return columns


def _spread(m: Metric, channel: int, joint: int, segments: Sequence[FineSegment]) -> list[np.ndarray]:
    """The whitened residual given back to the fine samples between the rows."""
    e = m.whiteners[channel].L.T @ m.fitted.residual[channel]
    out, at = [], 0
    for s in segments:
        rows = len(s.t) // s.every
        piece = np.repeat(e[at : at + rows], s.every)
        at += rows
        out.append(np.concatenate([piece, np.zeros(len(s.t) - len(piece))]) * s.certain[:, joint])
    return out


def _ridge(m: Metric, channel: int, Z: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, float]:
    """Evidence of a group on the fitted rows, its posterior mean (M,), the columns (M, k) of its prior, and
    what it pays for its size [nats]: what the fall of squares is ahead of the evidence by, at the best size
    half of the numbers that it uses and of ln det (1 + lambda G), whatever the noise's size."""
    on = m.fitted.mask & m.rows.use[channel]
    white = m.whiteners[channel] @ Z
    here = np.where(on[:, None], white, 0.0)
    seen = np.sum(here**2, axis=0) > UNSEEN * np.sum(white**2, axis=0)  # others have no size to be learned
    Z, here = Z[:, seen], here[:, seen]
    if not seen.any():
        return 0.0, np.zeros(len(Z)), Z, 0.0
    places, values = m.X[channel]
    cross = m.fitted.basis[places].T @ (values.T @ here)
    own = here.T @ here
    scale = np.sqrt(np.maximum(np.diag(own), 1e-300))
    G = (own - cross.T @ cross) / np.outer(scale, scale)
    g = (here.T @ m.fitted.residual[channel]) / scale
    s, U = np.linalg.eigh(G)
    keep = s > 1e-9
    s, U = s[keep], U[:, keep]
    if not len(s):
        return 0.0, np.zeros(len(Z)), np.zeros((len(Z), 0)), 0.0
    h = (U.T @ g) ** 2
    spread = LAMBDAS[:, None] * s[None, :]
    values_ = 0.5 * np.sum(h * LAMBDAS[:, None] / (1 + spread) - np.log1p(spread), axis=1)
    k = int(np.argmax(values_))
    a = U @ ((U.T @ g) * LAMBDAS[k] / (1 + LAMBDAS[k] * s)) / scale
    price = 0.5 * np.sum(spread[k] / (1 + spread[k]) + np.log1p(spread[k]))
    return float(values_[k]), Z @ a, Z @ (U / scale[:, None] * np.sqrt(LAMBDAS[k])), float(price)
