"""Rows whitened by a noise and the model's own columns on them: where hypotheses are sized and judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ident.diagnosis.rows.rows import Rows
from ident.diagnosis.rows.slow_noise import SlowNoise
from ident.diagnosis.rows.whitened import Whitener

Columns = Mapping[int, np.ndarray]  # channel -> (M, p), the same p everywhere
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
