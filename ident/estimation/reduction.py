"""Essential parameters by the F-statistic (paper 3.4, eq. 18; Janot et al. 2014).

The parameter with the largest relative standard deviation is tested first: without it the weighted residual
grows by chi_i^2 / Sigma_ii, and if

    F = (||rho_c||^2 - ||rho||^2) / (||rho||^2 / (r - b)) <= F_d(alpha; 1, r - b)

the parameter is cancelled and the rest is estimated again; the process ends with the first F that is larger.
Decimated rows can stay correlated: F is scaled by r_eff / r and F_d read at r_eff - b, unless a study says
`effective_rows: false` and so asks for the paper's own test.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.special

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
        return float(scipy.special.fdtrc(self.df_num, self.df_den, self.statistic))

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
    """Kolmogorov-Smirnov; null hypothesis: normalised residuals are N(0, 1)."""

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
    full: Estimate, alpha: float = 0.05, effective_share: float = 1.0, keep: frozenset[str] = frozenset()
) -> Reduction:
    """Cancel parameters until the F-test refuses. effective_share = r_eff / r; `keep` are never cancelled."""
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
        free = max(rows - estimate.b, 1.0)
        spread = estimate.rss / max(estimate.rows - estimate.b, 1)
        statistic = estimate.chi[worst] ** 2 / (estimate.covariance[worst, worst] * spread) * effective_share
        step = FTest(
            estimate.parameters[worst],
            float(statistic),
            1,
            free,
            float(scipy.special.fdtri(1, free, 1 - alpha)),
        )
        steps.append(step)
        if not step.accepted:
            break
        active = estimate.active.copy()
        active[worst] = False
        estimate = restrict(estimate, active)
    return Reduction(full, estimate, tuple(steps), alpha)


def kolmogorov_smirnov(normalised: np.ndarray, effective_share: float = 1.0) -> NormalityTest:
    """Distance of the residuals' distribution from N(0, 1); p by Kolmogorov's limit with Stephens'
    correction."""
    x = np.sort(np.ravel(normalised))
    n = len(x)
    cdf = scipy.special.ndtr(x)
    distance = float(max(np.max(np.arange(1, n + 1) / n - cdf), np.max(cdf - np.arange(n) / n)))
    rows = n * effective_share
    root = np.sqrt(rows)
    return NormalityTest(
        distance, float(scipy.special.kolmogorov((root + 0.12 + 0.11 / root) * distance)), rows
    )
