"""What the study's estimator makes of a weighted least squares fit: one switch, one value.

Every estimator ends as an `Estimate` whose factor the tests and the reduction solve on, and says of which
equations its residuals are and by which its covariance is spread. `wls` and `irls` are done in solving.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.equations.observation import RecordingSystem, stack
from ident.equations.prepared import Prepared
from ident.estimation.estimators.recursive import WINDOW_S, weighed, windows
from ident.estimation.least_squares import Estimate
from ident.estimation.noise import ChannelNoise, channel_noises, honest_covariance
from ident.progress import Progress, silent


@dataclass(frozen=True, slots=True)
class Feedback:
    """The test of "least squares is unbiased", and the parameter that the two estimates tell apart most, by
    how many of its standard deviations. Many rows reject a bias that does not matter: only one of a whole
    deviation is worth a word."""

    statistic: float
    p_value: float
    parameter: str
    shift: float

    def sentence(self, alpha: float = 0.01) -> str:
        """The finding, "" where there is none."""
        if self.p_value >= alpha or abs(self.shift) < 1.0:
            return ""
        return (
            f"least squares and instruments disagree, on {self.parameter} by {abs(self.shift):.1f} standard "
            f"deviations (Durbin, Wu and Hausman: p = {self.p_value:.2g}): feedback that carries noise "
            "biases least squares, or the model lacks something; compare with estimator: iv"
        )

    def document(self) -> dict[str, float]:
        """As fit.json holds it; shift in standard deviations."""
        return {"statistic": self.statistic, "p_value": self.p_value, "largest_shift": self.shift}


@dataclass(frozen=True, slots=True)
class Refined:
    """observed: systems whose residuals the estimate leaves; spread: whose W (times turn (b, b)) stands in
    its covariance; feedback: a test of "least squares is unbiased", where one was made."""

    estimate: Estimate
    observed: Sequence[RecordingSystem]
    spread: Sequence[RecordingSystem]
    turn: np.ndarray | None = None
    feedback: Feedback | None = None
    notes: tuple[str, ...] = ()

    @property
    def plain(self) -> bool:
        """Whether its covariance is spread by the equations whose residuals it leaves."""
        return self.turn is None and self.spread is self.observed

    def covariance(self, estimate: Estimate, noises: Sequence[ChannelNoise] | None = None) -> np.ndarray:
        """Honest covariance (b, b) of the estimate, or of a restriction of it."""
        noises = channel_noises(self.observed, estimate) if noises is None else noises
        return honest_covariance(self.spread, estimate, noises, self.turn)


def refined(
    prepared: Prepared,
    systems: Sequence[RecordingSystem],
    first: Estimate,
    cutoff_hz: float,
    progress: Progress = silent,
) -> Refined:
    """The study's estimator, from weighted least squares on the identify recordings. Raises IdentError."""
    study, plain = prepared.study, Refined(first, systems, systems)
    if study.estimator == "tls":
        from ident.estimation.estimators.total import total_least_squares

        return replace(plain, estimate=total_least_squares(prepared, stack(systems), first))
    if study.estimator == "recursive":
        assert study.forgetting is not None
        said = () if windows(systems) > 1 else (f"forgetting: all rows are of one {WINDOW_S / 60:g} min",)
        return replace(plain, spread=weighed(systems, study.forgetting), notes=said)
    if study.controller is None:
        return plain
    from ident.estimation.estimators.didim import didim
    from ident.estimation.estimators.instrumental import by_instruments, most_shifted
    from ident.estimation.estimators.simulated import loop_of

    loop = loop_of(prepared, cutoff_hz, progress)
    if study.estimator == "didim":
        estimate, simulated = didim(loop, first, progress)
        return Refined(estimate, simulated, simulated)
    noises = channel_noises(systems, first)
    share = min(1.0, sum(noise.effective_rows for noise in noises) / first.rows)
    turns = {} if study.estimator == "iv" else {"turns": 1}
    estimate, instruments, test, T = by_instruments(loop, systems, first, share, progress, **turns)
    name, shift = most_shifted(test, first, np.sqrt(np.diag(plain.covariance(first, noises))))
    told = Feedback(float(test.statistic), test.p_value, name, shift)
    if study.estimator == "iv":
        return Refined(estimate, systems, instruments, T, told)
    return replace(plain, feedback=told)
