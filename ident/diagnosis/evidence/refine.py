"""Shape parameters of a hypothesis where the fitted rows want them: variable projection inside their bounds.

Linear coefficients are projected out; each step solves for the shape parameters' change along the
sensitivities of the columns (Golub and Pereyra, SIAM J. Numer. Anal. 10(2), 1973, in Kaufman's form),
shortened while it does not help. Effects that are not linear in their size are taken again as secants at
the size found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.diagnosis.evidence.metric import Metric, beside_model, orthonormal
from ident.diagnosis.rows.terms import Scene, Term

TURNS = 5
STEEP = 1e100  # slopes beyond which a shape cannot be followed
FACTORS = (0.5, 1.0, 2.0, 4.0, 8.0)  # of the size that a tangent gives
NEAR = (0.8, 1.0, 1.25)  # of one that was found before
PARABOLAS = 4


@dataclass(frozen=True, slots=True)
class Refined:
    """A term at its best shape: its columns, the coefficients, what it gains on the fitted rows (nats)."""

    term: Term
    columns: Mapping[int, np.ndarray]
    sizes: np.ndarray
    gain: float
    at_bound: tuple[str, ...] = ()


def fit_sizes(m: Metric, columns: Mapping[int, np.ndarray]) -> tuple[np.ndarray, float]:
    """Coefficients (p,) beside the model, and half the fall of the whitened sum of squares."""
    if not columns:
        return np.zeros(0), 0.0
    return solution(*beside_model(m, m.fitted, m.whiten(columns)))


def solution(left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, float]:
    """The same of columns' products (p, p) beside the model, and with the residual (p,)."""
    basis = orthonormal(left)
    a = basis @ (basis.T @ right)
    return a, 0.5 * float(right @ a)


def refine(m: Metric, scene: Scene, term: Term, turns: int = TURNS) -> Refined:
    """The term with its shape and size as the fitted rows want them. A shape that begins beyond its bounds,
    where another law ended, begins at them."""
    bounds = term.effect.bounds(term.place)
    term = term.at(**{n: float(np.clip(x, *bounds[n])) for n, x in term.theta.items() if n in bounds})
    if term.effect.changes_model:
        term = _whole(m, scene, term)
    columns = scene.columns(term)
    sizes, gain = fit_sizes(m, columns)
    best = Refined(term, columns, sizes, gain)
    if term.size is None and len(sizes):
        best = _secant(m, scene, best)
    elif term.size is not None and len(sizes) == 1:
        best = _as_it_is(m, scene, best, [factor * term.size[0] for factor in NEAR])
    names = list(bounds)
    damp = 1.0
    for _ in range(turns if names and best.columns else 0):
        step = _step(m, scene, best, bounds)
        improved = False
        for _half in range(3):
            theta = dict(best.term.theta)
            for name, d in step.items():
                low, high = bounds[name]
                theta[name] = float(np.clip(theta[name] + damp * d, low, high))
            trial_term = replace(best.term, theta=theta)
            columns = scene.columns(trial_term)
            sizes, gain = fit_sizes(m, columns)
            if gain > best.gain:
                rise = gain - best.gain
                best = Refined(trial_term, columns, sizes, gain)
                improved = rise > 0.05
                damp = min(1.0, 2 * damp)
                break
            damp /= 4
        if not improved:
            break
    if term.effect.changes_model:
        term = _whole(m, scene, best.term)
        columns = scene.columns(term)
        best = Refined(term, columns, *fit_sizes(m, columns))
    natural = {p.name: p.grid for p in term.effect.nonlinear}  # a bound that a search may begin at is no end
    bound = tuple(
        name
        for name in names
        if any(
            abs(best.term.theta.get(name, np.nan) - end)
            < 1e-6 * max(bounds[name][1] - bounds[name][0], 1e-300)
            and end not in natural.get(name, ())
            for end in bounds[name]
        )
    )
    return replace(best, at_bound=bound)


def _whole(m: Metric, scene: Scene, term: Term) -> Term:
    """Shape parameters, which are rotations, scaled until the change that they make has size one. Angles and
    size say the same, and a step along both may have left any product of the two: a tilt of six degrees was
    lost as one of half a degree, thirteen times."""
    for _ in range(6):
        columns = scene.columns(term)
        sizes, _ = fit_sizes(m, columns)
        if not len(sizes) or abs(sizes[-1] - 1.0) < 0.02 or abs(sizes[-1]) < 1e-4:
            break
        scaled = {name: float(value * sizes[-1]) for name, value in term.theta.items()}
        if max(map(abs, scaled.values()), default=0.0) > np.pi:
            break
        term = term.at(**scaled)
    return term


def _secant(m: Metric, scene: Scene, start: Refined) -> Refined:
    """Columns again at the size found, until it stays; the tangent where the columns do not depend on it."""
    best = _followed(m, scene, start, tuple(start.sizes))
    if best.term.size is None or len(start.sizes) > 1:
        return best
    first = float(best.sizes[0])
    if best.term.effect.linear[0].sign == "positive":
        return _as_it_is(m, scene, best, [factor * abs(first) for factor in FACTORS])
    led = [factor * first for factor in (*FACTORS, -1.0)]
    return _as_it_is(m, scene, best, [*led, *best.term.effect.tried])


def _as_it_is(m: Metric, scene: Scene, start: Refined, sizes: Sequence[float]) -> Refined:
    """The columns of that size at which the change that it makes fits best as it is.

    A coefficient beside a secant is no size: of a torque with steps any delay shorter than the true one is a
    fixed point of coefficient and size, and a soft gear's runs away. The summit may stand far from where the
    tangent leads: these sizes are tried, then parabolas through the best three."""
    tried: dict[float, tuple[float, Refined]] = {}

    def gain(size: float) -> float:
        if size not in tried:
            tried[size] = _exactly(m, scene, start, size)
        return tried[size][0]

    for size in sizes:
        gain(size)
    for _ in range(PARABOLAS):
        top = max(tried, key=gain)
        new = _summit({size: told for size, (told, _) in tried.items()}, top)
        if abs(new - top) < 0.01 * abs(top) or new in tried:
            break
        gain(new)
    best = tried[max(tried, key=gain)][1]
    return best if best.columns else start


def _summit(tried: Mapping[float, float], top: float) -> float:
    """Where a parabola through the best size and its neighbours is highest; further out where the best
    stands at an end."""
    sizes = sorted(tried)
    at = sizes.index(top)
    if at in (0, len(sizes) - 1):
        return 1.5 * top if abs(top) == max(map(abs, sizes)) else 0.5 * top
    low, high = sizes[at - 1], sizes[at + 1]
    left, right = ((tried[size] - tried[top]) / (size - top) for size in (low, high))
    bend = (right - left) / (high - low)
    new = 0.5 * (low + top) - 0.5 * left / bend if bend < 0 else top
    return float(np.clip(new, 0.5 * (low + top), 0.5 * (top + high)))


def _exactly(m: Metric, scene: Scene, start: Refined, size: float) -> tuple[float, Refined]:
    """What the change of a size gains as it is, and its columns with the coefficient that fits best."""
    term = replace(start.term, size=(size,))
    columns = scene.columns(term)
    if not columns:
        return -np.inf, replace(start, term=term, columns=columns)
    products, right = beside_model(m, m.fitted, m.whiten(columns))
    left = float(products[0, 0])
    a = float(right[0]) / max(left, 1e-300)
    told = size * float(right[0]) - 0.5 * size**2 * left
    return told, Refined(term, columns, np.array([a]), 0.5 * float(right[0]) * a)


def _followed(m: Metric, scene: Scene, start: Refined, size: tuple[float, ...]) -> Refined:
    best = start
    for _ in range(4):
        term = replace(start.term, size=size)
        columns = scene.columns(term)
        trial = Refined(term, columns, *fit_sizes(m, columns))
        if not len(trial.sizes):
            return best
        same = np.allclose(trial.sizes, best.sizes, rtol=1e-3, atol=1e-12)
        if all(np.array_equal(columns[c], best.columns[c]) for c in columns if c in best.columns):
            return best
        best, size = trial, tuple(trial.sizes)
        if same or len(size) == 1:
            break
    return best


def _step(
    m: Metric, scene: Scene, at: Refined, bounds: Mapping[str, tuple[float, float]]
) -> dict[str, float]:
    """Gauss-Newton step of the shape parameters, of each at most half of itself or a third of its range: a
    step along several that is cut in one of them alone leads elsewhere. (Of a counterbalance it stopped at
    half of the spring's offset, and a ripple of five numbers was told in its place.) What
    turns the model's own torque is held at size one: its angles and that size say the same, and a step along
    both is any. (A tilt of 8 milliradians stayed half a milliradian off, 65 nats, and two forces of 0.04 N
    were told beside it.)"""
    p = len(at.sizes)
    names = list(bounds)
    held = at.term.effect.changes_model  # the last of its columns
    sizes = np.append(at.sizes[:-1], 1.0) if held else at.sizes
    extra: dict[int, list[np.ndarray]] = {c: [] for c in at.columns}
    for name in names:
        low, high = bounds[name]
        value = at.term.theta[name]
        h = 1e-3 * max(abs(value), 1e-3 * (high - low))
        up, down = min(value + h, high), max(value - h, low)
        plus, minus = scene.columns(at.term.at(**{name: up})), scene.columns(at.term.at(**{name: down}))
        for c in at.columns:
            zero = np.zeros_like(at.columns[c])
            change = (plus.get(c, zero) - minus.get(c, zero)) @ sizes
            slope = change / (up - down) if up > down else zero[:, 0]
            extra[c].append(slope[:, None] if np.abs(slope).max(initial=0.0) < STEEP else zero[:, :1])
    wide = {c: np.hstack([at.columns[c], *extra[c]]) for c in at.columns}
    left, right = beside_model(m, m.fitted, m.whiten(wide))
    if held:
        right = np.delete(right - left[:, p - 1], p - 1)
        left = np.delete(np.delete(left, p - 1, 0), p - 1, 1)
    linear, free = len(left) - len(names), names
    while True:  # what would leave its bounds stays there, and the others go on without it
        some = [*range(linear), *(linear + names.index(name) for name in free)]
        step = dict(zip(free, solution(left[np.ix_(some, some)], right[some])[0][linear:].tolist()))
        out = [name for name, d in step.items() if d and at.term.theta[name] == bounds[name][d > 0]]
        if not out:
            break
        free = [name for name in free if name not in out]
    most = max((abs(d) / _longest(at.term.theta[name], *bounds[name]) for name, d in step.items()), default=0)
    return {name: d / max(most, 1.0) for name, d in step.items()}


def _longest(value: float, low: float, high: float) -> float:
    return 0.5 * abs(value) if low > 0 else 0.3 * (high - low)
