"""The little linear algebra that regrouping needs, on exact numbers: spans, their annihilators, products."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sympy.polys.domains import QQ

from modelgen.geometry.kinematics import Number, add, mul, sub

Vector = list[Number]


class Span:
    """A space of vectors, kept as its reduced row echelon form."""

    def __init__(self, size: int, vectors: Iterable[Vector] = ()) -> None:
        self.size = size
        self.rows: dict[int, Vector] = {}  # pivot -> row with 1 there and 0 at the other pivots
        self.extend(vectors)

    @property
    def full(self) -> bool:
        """True if the space is the whole space."""
        return len(self.rows) == self.size

    def extend(self, vectors: Iterable[Vector]) -> None:
        """Add vectors to the space."""
        for vector in vectors:
            if self.full:
                return
            self._add(vector)

    def _add(self, vector: Vector) -> None:
        v = vector
        for pivot, row in self.rows.items():
            v = self._eliminated(v, row, pivot)
        if not any(v):
            return
        pivot = next(i for i, x in enumerate(v) if x)
        scale = v[pivot]
        v = [_divided(x, scale) for x in v]
        v[pivot] = 1
        for other, row in self.rows.items():
            self.rows[other] = self._eliminated(row, v, pivot)
        self.rows[pivot] = v

    def _eliminated(self, v: Vector, row: Vector, pivot: int) -> Vector:
        factor = v[pivot]
        if not factor:
            return v
        result = [sub(x, mul(factor, y)) for x, y in zip(v, row, strict=True)]
        result[pivot] = 0
        return result

    def annihilator(self) -> dict[int, Vector]:
        """The vectors x with v . x = 0 for all v of the space, as a basis: one per column that is no pivot.

        The vector of such a column has 1 there, and 0 at the others of its kind.
        """
        basis = {}
        for free in range(self.size):
            if free not in self.rows:
                x: Vector = [0] * self.size
                x[free] = 1
                for pivot, row in self.rows.items():
                    x[pivot] = sub(0, row[free])
                basis[free] = x
        return basis


def _divided(x: Number, y: Number) -> Number:
    return x / (QQ(y) if isinstance(y, int) else y) if x else 0


def product(a: Sequence[Sequence[Number]], b: Sequence[Sequence[Number]]) -> list[Vector]:
    """Matrix product without the products by structural zeros."""
    columns = list(zip(*b, strict=True))
    return [[_dot(row, column) for column in columns] for row in a]


def transposed(a: Sequence[Sequence[Number]]) -> list[Vector]:
    """Matrix transpose."""
    return [list(column) for column in zip(*a, strict=True)]


def _dot(u: Sequence[Number], v: Sequence[Number]) -> Number:
    total: Number = 0
    for x, y in zip(u, v, strict=True):
        total = add(total, mul(x, y))
    return total
