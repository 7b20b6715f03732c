"""What one model says for itself against another: a likelihood ratio on rows that chose nothing.

Everything about a hypothesis (place, window, shape, size, noise) is chosen on the fitted rows. On the
judged rows both models are whitened by the same noise and projected off the rigid model's own columns,
whose parameters stay free there (residual contrasts: Perez-Ortiz et al., Ann. Statist. 52(4), 2024), and

    log E = sum over channels  ln likelihood of the hypothesis as fitted - ln likelihood of the null

is the logarithm of a split likelihood ratio (Wasserman, Ramdas, Balakrishnan, PNAS 117(29), 2020):
whatever the search on the fitted rows was, P(log E > ln 1/alpha) <= alpha if the noise is what it is taken
for: the whitener's, and any slow noise, each model's own (slow_noise.py). Where parts of a run judge
others of it, that noise is one: the likelihood of the judged rows is that given the fitted ones. That
noise is such, is not taken for granted: blocks of `BLOCK_S` each give their own gain, and enough of them
must be positive: a sign test, which needs no noise model. A block counts by how surely it would be
positive were the effect there as the fitted rows have it (the log of the odds, at most TRUST), which the
judged torque has no part in: where an effect hardly acts the sign is a coin's. (By signed ranks, which let
large gains count for more, two laws of one friction were told where one was wrong.)"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.special

from ident.diagnosis.rows.rows import Rows
from ident.diagnosis.rows.slow_noise import SlowNoise
from ident.diagnosis.rows.whitened import Whitener

Columns = Mapping[int, np.ndarray]  # channel -> (M, p), the same p everywhere
BLOCK_S = 2.0  # s, longer than the noise remembers; shorter where there would be too few to agree
FEWEST, MANY = 12, 20
TRUST = 0.95  # no block counts as surer than this
FINE = 5000  # steps of the weights of all blocks
TOLERANCE = 1e-10  # of the scaled Gram matrix: a direction without data


@dataclass(frozen=True)
class Side:
    """The model on one set of rows: whitened columns times `basis` (B, r) are orthonormal there; noise: of
    each channel, none where it is white whatever the rows say."""

    mask: np.ndarray  # (M,)
    basis: np.ndarray
    residual: np.ndarray  # (C, M) whitened torque, projected; 0 elsewhere
    rss: np.ndarray  # (C,)
    free: np.ndarray  # (C,) rows less the parameters that they determine
    noise: tuple[SlowNoise, ...] = ()

    def likelihoods(self, residual: np.ndarray) -> tuple[np.ndarray, ...]:
        """Of each channel logarithms, but for a constant, of a residual (C, M) that the model has answered
        to, in every noise (J, A)."""
        if self.noise:
            return tuple(its.likelihoods(e) for its, e in zip(self.noise, residual))
        rss = np.maximum(np.einsum("cm,cm->c", residual, residual), 1e-300)
        return tuple(np.array([[-0.5 * n * np.log(r / n)]]) for n, r in zip(self.free, rss))

    def likelihood(self, residual: np.ndarray) -> np.ndarray:
        """(C,) of them the largest."""
        return np.array([its.max() for its in self.likelihoods(residual)])

    @cached_property
    def told(self) -> np.ndarray:
        """(C,) of the model alone."""
        return self.likelihood(self.residual)


def given_part(both: Side, part: Side, residual: np.ndarray, its: np.ndarray) -> np.ndarray:
    """(C,) logarithm of the likelihood of the residual (C, M) of all rows given those of a part, `its`
    residual: in the noise that all rows have."""
    pairs = zip(both.likelihoods(residual), part.likelihoods(its))
    return np.array([a.max() - b.flat[a.argmax()] for a, b in pairs])


@dataclass(frozen=True)
class Metric:
    """Rows and columns of a model in one noise: X[c] = (places (k,), values (M, k)) whitened, y (C, M)."""

    rows: Rows
    whiteners: tuple[Whitener, ...]
    X: tuple[tuple[np.ndarray, np.ndarray], ...]
    y: np.ndarray
    B: int
    fitted: Side
    judged: Side

    @cached_property
    def both(self) -> Side:
        """The model on the fitted and the judged rows together."""
        slow = bool(self.fitted.noise)
        mask = self.fitted.mask | self.judged.mask
        return side_of(self.rows, self.X, self.y, self.B, mask, slow, self.taken)

    @property
    def taken(self) -> tuple[np.ndarray | None, ...]:
        """What the whiteners take up whatever its size, channel by channel."""
        return tuple(w.taken for w in self.whiteners)

    @cached_property
    def told_given(self) -> np.ndarray:
        """(C,) of the judged rows given the fitted ones, of the model alone."""
        return given_part(self.both, self.fitted, self.both.residual, self.fitted.residual)

    @cached_property
    def parted(self) -> bool:
        """Whether some recording is fitted in parts and judges in others: noise that outlasts them is one."""
        r = self.rows.recording
        return bool(self.judged.noise) and bool(np.isin(r[self.judged.mask], r[self.fitted.mask]).any())

    def only(self, chosen: np.ndarray) -> Metric:
        """Some of its rows (k,), whole pieces: products with columns that are zero on the others, and nothing
        else, are the same."""
        sides = [
            replace(side, mask=side.mask[chosen], residual=side.residual[:, chosen], noise=())
            for side in (self.fitted, self.judged)
        ]
        return Metric(
            self.rows.only(chosen),
            tuple(w.only(chosen) for w in self.whiteners),
            tuple((places, values[chosen]) for places, values in self.X),
            self.y[:, chosen],
            self.B,
            sides[0],
            sides[1],
        )

    def whiten(self, columns: Columns) -> dict[int, np.ndarray]:
        return {c: self.whiteners[c] @ z for c, z in columns.items()}


@dataclass(frozen=True, slots=True)
class Evidence:
    """log_e on judged rows, gain (nats) on fitted ones, the blocks' own gains and what these are expected to
    be, the sizes as fitted."""

    log_e: float
    gain: float
    blocks: np.ndarray  # (blocks,)
    expected: np.ndarray  # (blocks,) nats, were the effect as fitted; inf: all blocks alike
    sizes: np.ndarray  # (p,)
    per_channel: np.ndarray  # (C,) of log_e
    rss: np.ndarray  # (C,) whitened, judged rows
    left: float  # smallest share of a column that the model leaves, 1: orthogonal to it
    free: np.ndarray  # (C,) judged rows less the parameters that they determine
    given: bool = False  # what is told of the judged rows is told given the fitted ones (given.py)

    def supported(self, alpha: float) -> bool:
        """Enough blocks agree."""
        return agree(self.blocks, self.expected, alpha)

    def contradicted(self, alpha: float) -> bool:
        """Some block gains less than chance allows, were the effect there as the fitted rows have it:
        normal about what is expected, with twice its variance."""
        told = self.blocks != 0
        short = (self.expected[told] - self.blocks[told]) / np.sqrt(
            2 * np.maximum(self.expected[told], 1e-300)
        )
        return bool(np.any(short > -scipy.special.ndtri(alpha / max(len(short), 1))))

    def beats(self, other: Evidence, tau: float, alpha: float) -> bool:
        """These data tell the two apart: the same comparison as against nothing, with the other as the null.
        Both of one metric."""
        if self.log_e - other.log_e <= tau:
            return False
        if self.blocks.shape != other.blocks.shape:
            return True  # a window's blocks are its own
        apart = self.blocks - other.blocks
        return replace(self, blocks=apart, expected=np.full(len(apart), np.inf)).supported(alpha)


def agree(gains: np.ndarray, expected: np.ndarray, alpha: float) -> bool:
    """Whether more blocks gain (blocks,) than coins would at the rate alpha; expected: as of Evidence. Of so
    few that coins always would, none tells. (Of four clean robots of 300 a second of a turning joint was a
    load, in two blocks or none.)"""
    told = gains != 0
    weight = weights(expected[told])
    asked = rarely(len(weight), alpha) < 1
    return bool(asked and weight @ (gains[told] > 0) >= enough(weight, alpha))


def drop_percent(nats: float, free: float) -> float:
    """By how much the whitened error of a channel with `free` judged rows falls where log E is so many."""
    return float(100 * (1 - np.exp(-nats / max(free, 1.0))))


def weights(expected: np.ndarray) -> np.ndarray:
    """(blocks,) log odds that a block's gain is positive, of expected gains (nats; it is normal about these
    with twice the variance), in whole steps of which all blocks have about FINE."""
    sure = np.clip(scipy.special.ndtr(np.sqrt(np.maximum(expected, 0.0) / 2)), 0.5, TRUST)
    odds = np.log(sure / (1 - sure))
    return np.round(odds * (FINE / max(float(odds.sum()), 1e-300))).astype(int)


def enough(weight: np.ndarray, alpha: float) -> int:
    """The least weight that must agree, of blocks with so much each: coins seldom add up to it."""
    rare = rarely(len(weight), alpha)
    likely, top = np.zeros(int(weight.sum()) + 1), 1
    likely[0] = 1.0
    for step in weight.tolist():
        half = likely[:top] / 2
        likely[:top] = half
        likely[step : step + top] += half
        top += step
    tail = np.cumsum(likely[::-1])[::-1]
    return int(np.argmax(tail <= rare)) if tail[-1] <= rare else len(tail)


def rarely(blocks: int, alpha: float) -> float:
    """How often coins may agree as well as so many blocks: at the rate alpha; of fewer than MANY less can be
    asked (ten of twelve have 2 %), and they only guard the likelihood, which has passed alpha itself."""
    return alpha * max(1.0, (MANY / max(blocks, 1)) ** 2)


def stacked(rows: Rows, found: Sequence[Columns]) -> tuple[tuple[tuple[np.ndarray, np.ndarray], ...], int]:
    """The base columns with those of what was found behind them, channel by channel."""
    parts = [([places], [values]) for places, values in rows.base]
    at = rows.b
    for columns in found:
        p = next(iter(columns.values())).shape[1]
        for c, z in columns.items():
            parts[c][0].append(np.arange(at, at + p))
            parts[c][1].append(z)
        at += p
    return tuple((np.concatenate(places), np.hstack(values)) for places, values in parts), at


def metric(
    rows: Rows,
    design: Sequence[tuple[np.ndarray, np.ndarray]],
    B: int,
    whiteners: Sequence[Whitener],
    slow: bool = True,
) -> Metric:
    """Whiten a model's columns and project its torque on both kinds of rows; slow: whether noise may outlast
    the whiteners."""
    X = tuple((places, w @ values) for (places, values), w in zip(design, whiteners))
    y = np.stack([w @ rows.Y[c] for c, w in enumerate(whiteners)])
    taken = [w.taken for w in whiteners]
    sides = [side_of(rows, X, y, B, mask, slow, taken) for mask in (rows.fitted, rows.judged)]
    return Metric(rows, tuple(whiteners), X, y, B, sides[0], sides[1])


def side_of(
    rows: Rows,
    X: tuple,
    y: np.ndarray,
    B: int,
    mask: np.ndarray,
    slow: bool,
    taken: Sequence[np.ndarray | None],
) -> Side:
    """The whitened model X, y on the rows of a mask (M,), beside what the whiteners have `taken`."""
    gram, right = np.zeros((B, B)), np.zeros(B)
    for c, (places, values) in enumerate(X):
        here = values[mask & rows.use[c]]
        gram[np.ix_(places, places)] += here.T @ here
        right[places] += here.T @ y[c, mask & rows.use[c]]
    basis = orthonormal(gram)
    beta = basis @ (basis.T @ right)
    residual = np.zeros_like(y)
    rss, free, noise = np.zeros(len(X)), np.zeros(len(X)), []
    for c, (places, values) in enumerate(X):
        on = mask & rows.use[c]
        residual[c, on] = y[c, on] - values[on] @ beta[places]
        rss[c] = residual[c] @ residual[c]
        up = np.zeros((len(on), 0)) if (its := taken[c]) is None else its
        free[c] = max(on.sum() - np.sum((values[on] @ basis[places]) ** 2) - np.sum(up[on] ** 2), 1.0)
        noise.append(SlowNoise(rows, on, values, basis[places], up, float(free[c])))
    return Side(mask, basis, residual, rss, free, tuple(noise) if slow else ())


def orthonormal(gram: np.ndarray) -> np.ndarray:
    """(B, r) that turns a Gram matrix to the identity; directions without data are left out."""
    d = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    seen = np.diag(gram) > 1e-24 * max(float(np.diag(gram).max(initial=0.0)), 1e-300)
    values, vectors = np.linalg.eigh(np.where(np.outer(seen, seen), gram / np.outer(d, d), 0.0))
    good = values > TOLERANCE * max(values[-1], 1e-300)
    return vectors[:, good] / np.sqrt(values[good]) / np.where(seen, d, np.inf)[:, None]


def side_by_side(one: Columns, other: Columns) -> dict[int, np.ndarray]:
    """{channel: (M, p + q)} columns of both in one model; zeros where one has none."""
    (rows, p), (_, q) = (next(iter(z.values())).shape for z in (one, other))
    none = np.zeros((rows, p)), np.zeros((rows, q))
    return {c: np.hstack([one.get(c, none[0]), other.get(c, none[1])]) for c in sorted({*one, *other})}


def acting(columns: Mapping[int, np.ndarray]) -> np.ndarray:
    """(M,) rows in which columns are not zero."""
    return np.asarray(np.any([np.any(z, axis=1) for z in columns.values()], axis=0))


def whole(m: Metric, usable: np.ndarray) -> Metric:
    """Everything usable fitted."""
    side = side_of(m.rows, m.X, m.y, m.B, usable, bool(m.fitted.noise), m.taken)
    return replace(m, fitted=side, judged=side)


def project(m: Metric, side: Side, white: Columns) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Whitened columns against a side's model -> coefficients (r, p), own products (p, p), products with the
    residual (p,)."""
    p = next(iter(white.values())).shape[1]
    cross, own, right = np.zeros((m.B, p)), np.zeros((p, p)), np.zeros(p)
    for c, z in white.items():
        here = np.where((side.mask & m.rows.use[c])[:, None], z, 0.0)  # cheaper than taking rows out of X
        places, values = m.X[c]
        cross[places] += values.T @ here
        own += here.T @ here
        right += here.T @ side.residual[c]
    return side.basis.T @ cross, own, right


def beside_model(m: Metric, side: Side, white: Columns) -> tuple[np.ndarray, np.ndarray]:
    """Products of whitened columns that a side's model leaves (p, p), and with its residual (p,)."""
    cross, own, right = project(m, side, white)
    return own - cross.T @ cross, right


def spread(m: Metric, columns: Columns) -> np.ndarray:
    """(p, p) covariance of their coefficients on the fitted rows, beside the model."""
    basis = orthonormal(beside_model(m, m.fitted, m.whiten(columns))[0])
    return np.asarray(basis @ basis.T)


def weigh(
    m: Metric, columns: Columns, sizes: np.ndarray | None = None, inside: np.ndarray | None = None
) -> Evidence:
    """Fit the sizes of columns on the fitted rows (or take those given), judge them on the others; blocks
    are those of the rows `inside` (M,), where the columns act in some alone."""
    white = m.whiten(columns)
    cross, own, right = project(m, m.fitted, white)
    scale = np.sqrt(np.maximum(np.diag(own), 1e-300))
    left = (own - cross.T @ cross) / np.outer(scale, scale)
    share = float(np.min(np.diag(left)))
    if sizes is None:
        sizes = np.linalg.lstsq(left + 1e-12 * np.eye(len(left)), right / scale, rcond=1e-9)[0] / scale
    fitted = changed(m, m.fitted, white, sizes, cross)
    residual = changed(m, m.judged, white, sizes, project(m, m.judged, white)[0])
    rss = np.einsum("cm,cm->c", residual, residual)
    if m.parted:
        both = changed(m, m.both, white, sizes, project(m, m.both, white)[0])
        per_channel = given_part(m.both, m.fitted, both, fitted) - m.told_given
    else:
        per_channel = m.judged.likelihood(residual) - m.judged.told
    gain = float(np.sum(m.fitted.likelihood(fitted) - m.fitted.told))
    spread = np.maximum(rss / m.judged.free, 1e-300)[:, None]
    each = np.sum((m.judged.residual**2 - residual**2) / (2 * spread), axis=0)
    change = np.sum((m.judged.residual - residual) ** 2 / (2 * spread), axis=0)
    here = m.judged.mask if inside is None else m.judged.mask & inside
    return Evidence(
        float(per_channel.sum()),
        gain,
        block_sums(m.rows, each, here),
        block_sums(m.rows, change, here),
        sizes,
        per_channel,
        rss,
        share,
        m.judged.free,
    )


def said(m: Metric, columns: Columns, sizes: np.ndarray) -> float:
    """Nats of columns of these sizes on the fitted rows."""
    white = m.whiten(columns)
    left = changed(m, m.fitted, white, sizes, project(m, m.fitted, white)[0])
    return float(np.sum(m.fitted.likelihood(left) - m.fitted.told))


def unseen(m: Metric, columns: Columns, sizes: np.ndarray, tau: float) -> bool:
    """Whether these columns at these sizes, were they true, would not reach the limit on the judged rows."""
    left, _ = beside_model(m, m.judged, m.whiten(columns))
    return 0.5 * float(sizes @ left @ sizes) < tau


def over(null: Metric, m: Metric, told: Evidence) -> Evidence:
    """What a hypothesis says beside the model of `m`, held against the model of `null`: both of one noise and
    of the same rows. Told given the fitted rows, so is what the one model is ahead of the other."""

    def nats(a: Side, b: Side) -> np.ndarray:
        if told.given and not m.parted:  # as in given.py
            return 0.5 * a.free * np.log(np.maximum(a.rss, 1e-300) / np.maximum(b.rss, 1e-300))
        return b.told * a.free / b.free - a.told

    fitted, ahead = nats(null.fitted, m.fitted), nats(null.judged, m.judged)
    one, other = null.judged, m.judged
    if told.given or m.parted:
        one, other = null.both, m.both
        ahead = m.told_given - null.told_given if m.parted else nats(one, other) - fitted
    spread = np.maximum(told.rss / m.judged.free, 1e-300)[:, None]
    each = np.sum((one.residual**2 - other.residual**2) / (2 * spread), axis=0)
    change = np.sum((one.residual - other.residual) ** 2 / (2 * spread), axis=0)
    return replace(
        told,
        log_e=told.log_e + float(ahead.sum()),
        gain=told.gain + float(fitted.sum()),
        blocks=told.blocks + block_sums(m.rows, each, m.judged.mask),
        expected=told.expected + block_sums(m.rows, change, m.judged.mask),
        per_channel=told.per_channel + ahead,
    )


def changed(m: Metric, side: Side, white: Columns, sizes: np.ndarray, cross: np.ndarray) -> np.ndarray:
    """(C, M) residual of a side with the columns' torque taken off, the model free to answer."""
    beta = side.basis @ (cross @ sizes)
    out = side.residual.copy()
    for c, (places, values) in enumerate(m.X):
        change = values @ beta[places]
        if c in white:
            change -= white[c] @ sizes
        out[c] += np.where(side.mask & m.rows.use[c], change, 0.0)
    return out


def block_numbers(rows: Rows, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(masked rows,) number of each one's block, and (blocks,) which are not half empty."""
    seconds = min(BLOCK_S, max(mask.sum() * rows.hop / FEWEST, 4 * rows.hop))
    number = rows.piece[mask] * 1_000_000 + np.floor(rows.t[mask] / seconds).astype(int)
    _, block = np.unique(number, return_inverse=True)
    return block, np.bincount(block) > 0.5 * seconds / rows.hop


def block_sums(rows: Rows, values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Sums of values (M,) over blocks of the masked rows; half-empty blocks are left out."""
    block, kept = block_numbers(rows, mask)
    return np.bincount(block, values[mask], minlength=len(kept))[kept]
