"""Essential parameters by the F-statistic (paper 3.4, eq. 18; Janot et al. 2014).

The parameter with the largest relative standard deviation is tested first: without it the weighted residual
grows by chi_i^2 / Sigma_ii, and if

    F = (||rho_c||^2 - ||rho||^2) / (||rho||^2 / (r - b)) <= F_d(alpha; 1, r - b)

the parameter is cancelled and the rest is estimated again; the process ends with the first F that is larger.
Decimated rows can stay correlated: F is scaled by r_eff / r and F_d read at r_eff - b, unless a study says
`effective_rows: false` and so asks for the paper's own test.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ident import distributions
from ident.estimation.least_squares import Estimate, restrict


@dataclass(frozen=True, slots=True)
class FTest:
    """Null hypothesis: `dropped` is zero, the others given."""

    dropped: str
    statistic: float
    df_num: int
    df_den: float
    threshold: float

    @property
    def p_value(self) -> float:
        return distributions.f_beyond(self.statistic, self.df_num, self.df_den)

    @property
    def accepted(self) -> bool:
        """Whether the reduction is accepted: the parameter can go."""
        return self.statistic <= self.threshold

    def __str__(self) -> str:
        verdict = "cancelled" if self.accepted else "kept"
        numbers = f"F = {self.statistic:.3g}, F_d = {self.threshold:.3g}, p = {self.p_value:.2g}"
        return f"{self.dropped}: {numbers}, {verdict}"


@dataclass(frozen=True, slots=True)
class NormalityTest:
    """Kolmogorov-Smirnov; null hypothesis: normalised residuals are normal."""

    statistic: float
    p_value: float
    rows: float


@dataclass(frozen=True, slots=True)
class Reduction:
    """The essential estimate and every step that led to it; the last step is the one that failed."""

    full: Estimate
    estimate: Estimate
    steps: tuple[FTest, ...]
    alpha: float

    @property
    def essential(self) -> tuple[str, ...]:
        return tuple(np.array(self.full.parameters)[self.estimate.active])


def reduce(
    full: Estimate,
    alpha: float = 0.05,
    effective_share: float = 1.0,
    keep: frozenset[str] = frozenset(),
    groups: Sequence[tuple[frozenset[str], frozenset[str]]] = (),
) -> Reduction:
    """Cancel parameters until the F-test refuses. effective_share = r_eff / r; `keep` are never cancelled.

    groups: sizes and shapes of an effect; its shapes are never cancelled alone and go with its last size.
    """
    keep = keep.union(*(shapes for _, shapes in groups))
    steps: list[FTest] = []
    estimate = full
    rows = full.rows * effective_share
    while estimate.b > 1:
        relative = np.where(estimate.active, estimate.relative_std_percent, -1.0)
        for name in keep:
            relative[estimate.parameters.index(name)] = -1.0
        worst = int(np.argmax(relative))
        if relative[worst] < 0:
            break
        active = estimate.active.copy()
        active[[worst, *_following(estimate, worst, groups)]] = False
        free = max(rows - estimate.b, 1.0)
        spread = estimate.rss / max(estimate.rows - estimate.b, 1)
        count = estimate.b - int(active.sum())
        without = restrict(estimate, active) if count > 1 else None
        grown = (
            estimate.chi[worst] ** 2 / estimate.covariance[worst, worst]
            if without is None
            else without.rss - estimate.rss
        )
        step = FTest(
            estimate.parameters[worst],
            float(grown / count / spread * effective_share),
            count,
            free,
            distributions.f_quantile(alpha, count, free),
        )
        steps.append(step)
        if not step.accepted:
            break
        estimate = without or restrict(estimate, active)
    return Reduction(full, estimate, tuple(steps), alpha)


def _following(
    estimate: Estimate, worst: int, groups: Sequence[tuple[frozenset[str], frozenset[str]]]
) -> list[int]:
    """Shapes that lose their meaning when the size `worst` goes."""
    names = np.array(estimate.parameters)
    for sizes, shapes in groups:
        left = sizes & set(names[estimate.active])
        if left == {names[worst]}:
            return [int(k) for k in np.flatnonzero(estimate.active) if names[k] in shapes]
    return []


def kolmogorov_smirnov(normalised: np.ndarray, effective_share: float = 1.0) -> NormalityTest:
    """Distance of the residuals' distribution from the normal one with their own mean and deviation.

    Both are estimated, so Kolmogorov's own distribution would find any residual normal; p is Lilliefors' (J.
    Am. Stat. Assoc. 62, 1967) by the approximations of Dallal and Wilkinson (Am. Stat. 40, 1986; p < 0.1)
    and Stephens (J. Am. Stat. Assoc. 69, 1974).
    """
    x = np.sort(np.ravel(normalised))
    n = len(x)
    spread = float(np.std(x, ddof=1)) if n > 1 else 0.0
    if n < 5 or spread == 0:
        return NormalityTest(0.0, 1.0, n * effective_share)
    cdf = np.array([math.erfc(z) for z in ((x.mean() - x) / (spread * math.sqrt(2))).tolist()]) / 2
    distance = float(max(np.max(np.arange(1, n + 1) / n - cdf), np.max(cdf - np.arange(n) / n)))
    rows = n * effective_share
    return NormalityTest(distance, lilliefors(distance, max(rows, 5.0)), rows)


def lilliefors(distance: float, rows: float) -> float:
    """p-value of a distance from the normal distribution whose two parameters were estimated."""
    D, n = (distance * (rows / 100) ** 0.49, 100.0) if rows > 100 else (distance, rows)
    p = float(
        np.exp(
            -7.01256 * D**2 * (n + 2.78019)
            + 2.99587 * D * np.sqrt(n + 2.78019)
            - 0.122119
            + 0.974598 / np.sqrt(n)
            + 1.67997 / n
        )
    )
    if p <= 0.1:
        return p
    K = (np.sqrt(rows) - 0.01 + 0.85 / np.sqrt(rows)) * distance
    for end, polynomial in _STEPHENS:
        if end >= K:
            return float(np.clip(np.polyval(polynomial[::-1], K), 0.0, 1.0))
    return 0.0


_STEPHENS = (  # of K up to the first number
    (0.302, (1.0,)),
    (0.5, (2.76773, -19.828315, 80.709644, -138.55152, 81.218052)),
    (0.9, (-4.901232, 40.662806, -97.490286, 94.029866, -32.355711)),
    (1.31, (6.198765, -19.558097, 23.186922, -12.234627, 2.423045)),
)
