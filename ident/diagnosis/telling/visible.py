"""How large an effect would have had to be to be seen: what "nothing found" means.

An effect of linear parameters a (p,) has the whitened columns Z beside the model on the judged rows. The
fitted rows tell a + d, d normal with the covariance A^-1, A the product of its columns there. With unit noise
u_k in each block k of judged rows, G_k = Z_k'Z_k, and b = a + d,

    gain of block k = b'G_k a - b'G_k b / 2 + sqrt(b'G_k b) u_k

where dry friction's turn-over takes up nothing; what it does take up is in absorbed.py.

The effect is seen where the sum, and the gain on the fitted rows, are more than tau, enough blocks agree
(the loop's own rule), and the last fit finds its sizes to be other than zero (a Wald test). Where too few
agree, the loop asks these rows once more given the fitted ones, the model's parameters being the same in
both (in_common.py): H_k of what is left beside those parameters is more than G_k, and its noise goes with
u_k by sqrt(G_k / H_k), as the sums over all blocks do. Beside noise that may be slow the sums are less
(slow_noise.py), by as much as they are for the effect without d in the residual as it is. Draws of d and u
tell how often either shows it; the size at which it is POWER is told. A shape that is searched costs half a
chi-square each. Shapes are those of the search next to a usual robot's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
import scipy.special
import scipy.stats

from ident.diagnosis.evidence.absorbed import Dryness, Left, dryness, products
from ident.diagnosis.evidence.blocks import enough, weights
from ident.diagnosis.evidence.metric import Columns, Metric, Side, changed, project
from ident.diagnosis.evidence.state import State
from ident.diagnosis.outcome import BUDGET
from ident.diagnosis.rows.terms import Term
from ident.diagnosis.search.candidates import Library
from modelgen.effects.effect import Effect
from modelgen.effects.place import Place

POWER = 0.95
DRAWS = 250
CLOSE = 1.05
LEAST = 1e-5  # share of a column that the model must leave
NEAR, FURTHER = (1.7, 2.4), 1.5  # of the size that the expected gain alone asks for: where most are
WIDE = (0.3, 12.0)  # of the same: where all are


@dataclass(frozen=True, slots=True)
class Visible:
    """An effect on joints: reported parameters {name: {value, unit}} at the smallest size that would have
    been seen, `sizes` naming those that it is told by; share: its rms torque over the joint's own."""

    effect: str
    joints: tuple[int, ...]
    source_joint: int | None
    channel: str
    parameters: Mapping[str, Mapping[str, object]]
    sizes: tuple[str, ...]
    share: float


def smallest_visible(
    state: State, library: Library, tau: float, alpha: float, closed: frozenset[int] = frozenset()
) -> tuple[Visible, ...]:
    """Every effect that adds a torque of its own, growing with its size, at every joint that is not `closed`,
    from the columns that the search has kept; without those that no size shows. Of delays and gears nothing
    is said: what they leave in slow motion may pass for noise."""
    kept: dict[tuple, list[tuple[dict[str, float], tuple]]] = {}
    width = len(Term(library.places[0][0], library.places[0][1]).kind) if library.places else 0
    for key, columns in library.kept.items():
        if columns:  # of a shape that these motions show
            kept.setdefault(key[:width], []).append((dict(key[width]), key))
    there = {term.kind for term in state.terms}
    dry = cache(partial(dryness, state))
    both = cache(lambda joint: (its.metric if (its := dry(joint)) else state.metric).both)
    out = []
    for effect, place in library.places:
        term = Term(effect, place)
        asked = effect.kind == "column" and effect.proportional and not effect.replaces
        if not asked or place.joint is None or place.joint in closed:
            continue
        if term.kind in there or term.kind not in kept or place.parts:
            continue
        beside = dry(place.joint), both(place.joint)
        found = _visible(state, effect, place, kept[term.kind], library, tau, alpha, *beside)
        if found is not None:
            out.append(found)
    return tuple(out)


def _visible(
    state: State,
    effect: Effect,
    place: Place,
    shapes: Sequence[tuple[dict[str, float], tuple]],
    library: Library,
    tau: float,
    alpha: float,
    dry: Dryness | None,
    both: Side,
) -> Visible | None:
    own = {f"{k}": state.model.number(f"{k}m", place.joint or 0) or 1.0 for k in ("Fc", "Fv")}
    context = effect.context_of(place, state.model)
    linear, usual = effect.values_from_reported(effect.usual({}, own), {**own, **context})
    theta, key = min(shapes, key=lambda shape: _apart(shape[0], usual))
    names = effect.parameters_of(place)
    v = np.array([linear[name] for name in names])
    columns = {c: z.astype(float) for c, z in library.kept[key].items()}
    if not np.any(v) or next(iter(columns.values())).shape[1] != len(v):
        return None
    size = seen_from(state.metric, columns, v, len(effect.nonlinear), tau, alpha, dry, both)
    if size is None:
        return None
    limits = {p.name: max(abs(p.low), abs(p.high)) for p in effect.linear}
    beyond = any(abs(size * x) > limits[name] for name, x in zip(names, v))
    if beyond or set(effect.context) - set(context):
        return None
    if effect.physical({**theta, **dict(zip(names, size * v))}, state.model) is not None:
        return None
    values = {**dict.fromkeys(effect.linear_names, 0.0), **dict(zip(names, size * v)), **theta}
    told = effect.report(values, None, context, place)
    labels = state.problem.robot.joint_labels
    c = max(columns, key=lambda c: float(np.sum((columns[c] @ v) ** 2)))
    use = state.rows.use[c] & state.rows.usable
    share = size * _rms((columns[c] @ v)[use]) / max(_rms(state.rows.Y[c, use]), 1e-300)
    return Visible(
        effect.name,
        (int(labels[place.joint or 0]),),
        None if place.source is None else int(labels[place.source]),
        state.model.channels[c].name(labels),
        {name: {"value": entry["value"], "unit": entry["unit"]} for name, entry in told.items()},
        effect.size_names,
        float(share),
    )


def seen_from(
    m: Metric,
    columns: Mapping[int, np.ndarray],
    v: np.ndarray,
    shapes: int,
    tau: float,
    alpha: float,
    dry: Dryness | None = None,
    both: Side | None = None,
) -> float | None:
    """The factor of v (p,) from which on an effect of these columns is seen with POWER; None: from none.

    dry: the joint's turn-over, which may take up some of it; both: all rows of its metric, or of m."""
    white = m.whiten(columns)
    cross, own, _ = project(m, m.fitted, white)
    A = own - cross.T @ cross
    if not v @ A @ v > LEAST * (v @ own @ v):
        return None
    alone = products(m, white, dry)
    given = products(m, white, dry, both or (m if dry is None else dry.metric).both)
    blocks = given.left(v, 0.0).A_blocks[:-1]  # what they see given the fitted rows is more
    whole = float(np.einsum("i,kij,j->", v, blocks, v))
    if not whole > 0:
        return None
    rng = np.random.default_rng([17, len(v), shapes])
    draws = rng.normal(size=(DRAWS, len(v)))
    u, other = rng.normal(size=(2, DRAWS, len(blocks)))
    rest = rng.normal(size=DRAWS)
    searched = rng.chisquare(shapes, DRAWS) / 2 if shapes else np.zeros(DRAWS)
    asked = scipy.stats.chi2.isf(alpha / BUDGET, len(v))
    free = float(sum(m.judged.free[c] for c in columns))
    last = draws @ _root(A).T
    sides = [(side, _left_of(m, side, white, v)) for side in (m.fitted, m.judged)]
    rare = -scipy.special.ndtri(alpha / len(blocks))

    def power(size: float) -> float:
        slow = [_beside_slow(side, left, size) for side, left in sides]
        left, more = alone.left(v, size), given.left(v, size)
        root = _root(left.A)
        b = (root @ root.T @ left.own) + draws @ root.T
        gain = np.einsum("ri,ij,rj->r", b, left.A, b) / 2 + searched
        settled = size * v + last
        fitted = np.einsum("ri,ij,rj->r", settled, A, settled) > asked

        told = np.einsum("ri,ki->rk", b, left.own_blocks)
        squares = _squares(b, left.A_blocks)
        each = told - squares / 2 + np.sqrt(squares) * u - searched[:, None] * _share(v, left)
        wrong = np.maximum((left.square_blocks - 2 * told + squares).sum(axis=1), 0.0)
        log_e = free / 2 * np.log1p(np.maximum(2 * each.sum(axis=1) / (free + wrong), -0.99))
        shown = (slow[1] * log_e > tau) & _agree(each, squares, alpha)

        ours = _squares(b, more.A_blocks)
        ours[:, -1] = np.maximum(ours[:, -1] - _squares(b, left.A[None])[:, 0], 0.0)  # is not new
        alike = np.sqrt(np.minimum(squares / np.maximum(ours[:, :-1], 1e-300), 1.0))
        noise = np.column_stack((alike * u + np.sqrt(1 - alike**2) * other, rest))
        each = np.einsum("ri,ki->rk", b, more.own_blocks) - ours / 2 + np.sqrt(ours) * noise
        each[:, -1] -= b @ left.own
        each -= searched[:, None] * _share(v, more)
        short = (ours / 2 - each)[:, :-1] / np.sqrt(np.maximum(ours[:, :-1], 1e-300))
        contradicted = (short > rare).any(axis=1)
        agree = _agree(each[:, :-1], ours[:, :-1], alpha) & ~contradicted
        shown |= ((slow[1] if m.parted else 1.0) * each.sum(axis=1) > tau) & agree
        return float(np.mean(shown & (slow[0] * gain > tau) & fitted))

    first = np.sqrt(2 * (tau + 2 * np.sqrt(tau)) / min(whole, float(v @ A @ v)))
    low, high = NEAR[0] * first, NEAR[1] * first
    while power(high) < POWER:
        low, high = high, FURTHER * high
        if high > WIDE[1] * first:
            return None
    while power(low) >= POWER and low > WIDE[0] * first:
        low, high = low / FURTHER, low
    while high > CLOSE * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if power(middle) >= POWER else (middle, high)
    return float(np.sqrt(low * high))


def _left_of(m: Metric, side: Side, white: Columns, v: np.ndarray) -> dict[int, np.ndarray]:
    """{channel: (M,)} what a side's model leaves of whitened columns with the sizes v."""
    plain = replace(side, residual=np.zeros_like(side.residual))
    left = changed(m, plain, white, -v, project(m, side, white)[0])
    return {c: left[c] for c in white if side.noise}


def _beside_slow(side: Side, left: Mapping[int, np.ndarray], size: float) -> float:
    """Share of what a torque of this size, of which the model leaves `left`, would say in a side's residual
    that stays beside slow noise."""
    slow = plain = 0.0
    for c, torque in left.items():
        more = side.residual[c] + size * torque
        slow += side.told[c] - float(side.noise[c].likelihoods(more).max())
        sizes = np.maximum([more @ more, side.rss[c]], 1e-300)
        plain += 0.5 * side.free[c] * float(np.log(sizes[0] / sizes[1]))
    return float(np.clip(slow / plain, 0.0, 1.0)) if plain > 0 else 1.0


def _squares(b: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    """(draws, blocks) b'B_k b."""
    return np.maximum(np.einsum("ri,kij,rj->rk", b, blocks, b), 0.0)


def _share(v: np.ndarray, left: Left) -> np.ndarray:
    """(blocks,) of what the fitted rows see of v what each block sees."""
    return np.einsum("i,kij,j->k", v, left.A_blocks, v) / max(float(v @ left.A @ v), 1e-300)


def _agree(each: np.ndarray, squares: np.ndarray, alpha: float) -> np.ndarray:
    """(draws,) whether enough blocks do."""
    weight = weights(squares.mean(axis=0) / 2)
    return np.asarray((each > 0) @ weight >= enough(weight, alpha))


def _root(A: np.ndarray) -> np.ndarray:
    """(p, p) whose square is the inverse of A, without directions that A does not see: the symmetric root of
    A scaled to ones. (Eigenvectors alone have signs, and turn where values are equal, as rounding will.)"""
    d = np.sqrt(np.maximum(np.diag(A), 1e-300))
    values, V = np.linalg.eigh(A / np.outer(d, d))
    good = values > 1e-6
    return (V[:, good] / np.sqrt(values[good])) @ V[:, good].T / d[:, None]


def _apart(theta: Mapping[str, float], usual: Mapping[str, float]) -> float:
    return sum(
        abs(np.log(theta[n] / usual[n])) if theta[n] > 0 and usual[n] > 0 else abs(theta[n] - usual[n])
        for n in theta
    )


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2))) if len(x) else 0.0
