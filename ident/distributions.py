"""Fisher's F and Student's t for the tests of a fit: importing scipy.special takes a twelfth of `ident fit`.

P(F > f) with m and n degrees of freedom is the regularised incomplete beta function I_x(n/2, m/2) at x = n /
(n + m f) (DLMF 8.17), by its continued fraction. Student's t squared is F with m = 1.
"""

from __future__ import annotations

import math

EXACT = 1e-15
NEAR = 1e-8  # a step of Newton's: the next one would be its square
STEPS = 10_000
LARGE = 200.0  # from here on five terms of Stirling's series are exact


def f_beyond(f: float, m: float, n: float) -> float:
    """P(F > f) with m and n degrees of freedom."""
    if f <= 0:
        return 1.0
    x, y = _shares(f, m, n)
    if not x > 0:  # f is infinite, or no number
        return x
    if not y > 0:
        return 1.0
    if x < (n + 2) / (m + n + 4):
        return _front(x, y, n / 2, m / 2) * _fraction(x, n / 2, m / 2) / (n / 2)
    return 1.0 - _front(x, y, n / 2, m / 2) * _fraction(y, m / 2, n / 2) / (m / 2)


def t_beyond(t: float, free: float) -> float:
    """P(T > t) of Student's t."""
    both = f_beyond(t * t, 1, free)
    return both / 2 if not t < 0 else 1 - both / 2


def f_quantile(share: float, m: float, n: float) -> float:
    """f with P(F > f) = share, by Newton's steps of ln P over ln f.

    That is concave (Fisher's z has a log-concave density), so each step ends right of f, wherever the first
    began, and all after it come nearer.
    """
    z = 0.0
    for _ in range(STEPS):
        f = math.exp(z)
        left, density = f_beyond(f, m, n), _front(*_shares(f, m, n), n / 2, m / 2)  # of z
        step = math.log(left / share) * left / density if left > 0 else -1.0
        z += step
        if abs(step) < NEAR:
            break
    return math.exp(z)


def _shares(f: float, m: float, n: float) -> tuple[float, float]:
    """x and y = 1 - x that f > 0 stands for."""
    return n / (n + m * f), 1.0 / (1.0 + n / (m * f))


def _front(x: float, y: float, a: float, b: float) -> float:
    """x^a y^b / B(a, b), x + y = 1."""
    ln_x, ln_y = (math.log(x), math.log1p(-x)) if x < y else (math.log1p(-y), math.log(y))
    return math.exp(a * ln_x + b * ln_y - _ln_beta(max(a, b), min(a, b)))


def _ln_beta(a: float, b: float) -> float:
    """ln B(a, b), a >= b; gammas of large a would take each other's digits away."""
    if a < LARGE:
        return math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)
    c = a + b
    grown = (a - 0.5) * math.log1p(b / a) + b * math.log(c) - b
    grown += (1 / c - 1 / a) / 12 - (1 / c**3 - 1 / a**3) / 360 + (1 / c**5 - 1 / a**5) / 1260
    return math.lgamma(b) - grown


def _fraction(x: float, a: float, b: float) -> float:
    """The continued fraction of I_x(a, b) (DLMF 8.17.22), x < (a + 1) / (a + b + 2), by Lentz's method."""
    c, d = 1.0, 1.0 / (1.0 - (a + b) * x / (a + 1))
    value = d
    for k in range(1, STEPS):
        for odd in (
            k * (b - k) * x / ((a + 2 * k - 1) * (a + 2 * k)),
            -(a + k) * (a + b + k) * x / ((a + 2 * k) * (a + 2 * k + 1)),
        ):
            c, d = 1.0 + odd / c, 1.0 / (1.0 + odd * d)
            value *= c * d
        if abs(c * d - 1.0) < EXACT:
            break
    return value
