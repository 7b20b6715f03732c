"""Weighted least squares for the inverse dynamic identification model, on triangular factors (paper 3.1).

    sigma_j   from channel j alone, Y_j = W_j chi + rho_j, ordinary least squares          eq. (11), (12)
    chi       = (W' Omega^-1 W)^-1 W' Omega^-1 Y                                            eq. (13)
    Sigma     = (W' Omega^-1 W)^-1                                                          eq. (15)
    % sigma_i = 100 sqrt(Sigma_ii) / |chi_i|                                                eq. (16)

Everything is computed from the R factors of observation.py, stacked after division by sigma_j. Columns that
the motion leaves dependent are found by a pivoted QR of the factor with columns scaled to length one; the
rest is identified, and each dropped parameter is told with the combination it was seen in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.equations.observation import ChannelFactor, RecordingSystem, triangular
from ident.errors import NotEnoughDataError
from modelgen.geometry.names import ParameterName

DEPENDENT = 1e-8  # of the longest pivot (scaled columns): below it a column is a combination of others
WEAK = 1e-4  # singular value, relative: this combination is hardly excited
HUBER = 1.345  # 95 % efficiency on Gaussian errors (Huber 1981)


@dataclass(frozen=True, slots=True)
class Dependence:
    """A parameter whose column is a combination of others in these data; the others absorb it."""

    parameter: str
    seen_in: tuple[tuple[str, float], ...]  # kept parameter, how much of it moves per unit of this one

    def sentence(self) -> str:
        if not self.seen_in:
            return f"{self.parameter} is not excited at all"
        parts = ", ".join(f"{name} ({factor:+.3g})" for name, factor in self.seen_in[:4])
        return f"{self.parameter} is seen only together with {parts}"


@dataclass(frozen=True, slots=True)
class Estimate:
    """chi (b,), covariance (b, b) as eq. 15. What is not `active` has the value that it is held at: zero, or
    for the shape of an effect the point about which its columns were made (terms.py)."""

    parameters: tuple[str, ...]
    chi: np.ndarray
    covariance: np.ndarray
    active: np.ndarray  # (b,) bool: columns in the fit
    sigma: np.ndarray  # (channels,)
    R: np.ndarray  # (b + 1, b + 1) weighted factor of all columns and Y
    rss: float  # ||Y - W chi||^2 weighted
    rows: int
    dependent: tuple[Dependence, ...] = ()
    held: np.ndarray | None = None  # (b,); None: zeros

    @property
    def condition_number(self) -> float:
        """Of the columns in the fit, scaled to length one."""
        return self._conditioning[0]

    @property
    def weak(self) -> tuple[str, ...]:
        """Parameters of combinations that are hardly excited."""
        return self._conditioning[1]

    @property
    def _conditioning(self) -> tuple[float, tuple[str, ...]]:
        names = tuple(np.array(self.parameters)[self.active])
        return _conditioning(self.R[:, : len(self.active)][:, self.active], names)

    @property
    def std(self) -> np.ndarray:
        return np.sqrt(np.diag(self.covariance))

    @property
    def relative_std_percent(self) -> np.ndarray:
        """Eq. 16; infinite where chi is zero."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.chi != 0, 100 * self.std / np.abs(self.chi), np.inf)

    @property
    def b(self) -> int:
        return int(self.active.sum())

    def summary(self) -> str:
        """Name, value, sigma and % sigma of every parameter in the fit, one line each."""
        lines = [f"{'':10} {'value':>12} {'std':>12} {'% std':>8}"]
        for k in np.flatnonzero(self.active):
            lines.append(
                f"{self.parameters[k]:10} {self.chi[k]:12.5g} {self.std[k]:12.3g} "
                f"{self.relative_std_percent[k]:8.3g}"
            )
        return "\n".join(lines)


def channel_sigma(factors: Sequence[ChannelFactor]) -> np.ndarray:
    """sigma_j of eq. 12: each channel by ordinary least squares alone, residual over rows minus rank ->
    (channels,).

    A channel with no more rows than its own parameters (its joint hardly moves) takes the mean of the others.
    """
    sigma = np.full(len(factors), np.nan)
    for j, factor in enumerate(factors):
        W, Y = factor.R[:, :-1], factor.R[:, -1]
        scale = np.linalg.norm(W, axis=0)
        scale[scale == 0] = 1.0
        solution, _, rank, _ = np.linalg.lstsq(W / scale, Y, rcond=DEPENDENT)
        if factor.rows > rank:
            sigma[j] = np.sqrt(np.sum((Y - W / scale @ solution) ** 2) / (factor.rows - int(rank)))
    rows = sum(factor.rows for factor in factors)
    if rows == 0:
        raise NotEnoughDataError(
            "no joint moves in the identify recordings, so nothing can be identified; record the robot moving"
        )
    if np.isnan(sigma).all():
        raise NotEnoughDataError(
            f"{rows} decimated rows are fewer than each channel has parameters; record longer or "
            "raise decimation_cutoff_hz"
        )
    sigma = np.where(np.isnan(sigma), np.nanmean(sigma), sigma)
    return np.maximum(sigma, max(float(sigma.max()), 1e-12) * 1e-6)  # an exact fit keeps a finite weight


def joint_sigma(
    factors: Sequence[ChannelFactor], chi: np.ndarray, covariance: np.ndarray, sigma: np.ndarray
) -> np.ndarray:
    """sigma_j from the residuals of the common fit, with the rows that the fit used up in each channel."""
    left = rows_left(factors, covariance, sigma)
    out = np.sqrt([factor.sum_of_squares(chi) / n for factor, n in zip(factors, left)])
    return np.asarray(np.maximum(out, max(float(out.max()), 1e-12) * 1e-6))


def rows_left(factors: Sequence[ChannelFactor], covariance: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """(channels,) rows less those that the common fit used up, at least one."""
    out = np.empty(len(factors))
    for j, factor in enumerate(factors):
        W = factor.R[:, :-1]
        used = np.sum((W @ covariance[np.ix_(factor.columns, factor.columns)]) * W) / sigma[j] ** 2
        out[j] = max(factor.rows - used, 1.0)
    return out


def weighted_factor(factors: Sequence[ChannelFactor], sigma: np.ndarray, b: int) -> np.ndarray:
    """All channels divided by their sigma as one factor [W Y] -> R (<= b+1, b+1)."""
    rows = []
    for factor, weight in zip(factors, 1 / sigma):
        wide = np.zeros((len(factor.R), b + 1))
        wide[:, factor.columns] = factor.R[:, :-1] * weight
        wide[:, -1] = factor.R[:, -1] * weight
        rows.append(wide)
    return triangular(np.vstack(rows))


def solve(
    R: np.ndarray, active: np.ndarray, held: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, float]:
    """Least squares on the active columns of a factor, the others at `held` (zero) -> chi (b,), covariance
    (b, b) of unit noise, rss."""
    columns = np.flatnonzero(active)
    scale = np.linalg.norm(R[:, columns], axis=0)
    scale[scale == 0] = 1.0
    chi = np.zeros(len(active)) if held is None else np.where(active, 0.0, held)
    right = R[:, -1] - R[:, :-1] @ chi
    part = triangular(np.column_stack([R[:, columns] / scale, right]))
    k = len(columns)
    inverse = np.linalg.inv(part[:k, :k]) / scale[:, None]
    chi[columns] = inverse @ part[:k, -1]
    covariance = np.zeros((len(active), len(active)))
    covariance[np.ix_(columns, columns)] = inverse @ inverse.T
    return chi, covariance, float(np.sum(part[k:, -1] ** 2))


def weighted_least_squares(
    factors: Sequence[ChannelFactor],
    sigma: np.ndarray,
    names: tuple[str, ...],
    allowed: np.ndarray | None = None,
    held: np.ndarray | None = None,
) -> Estimate:
    """Solve Y = W chi + rho with every row divided by its channel's noise (eq. 13), what is dependent left
    out; what is not allowed, or left out, is at `held`."""
    b = len(names)
    R = weighted_factor(factors, sigma, b)
    rows = sum(factor.rows for factor in factors)
    allowed = np.ones(b, bool) if allowed is None else allowed
    if rows <= allowed.sum():
        raise NotEnoughDataError(
            f"{rows} decimated rows cannot carry {int(allowed.sum())} parameters; record longer, "
            "or raise decimation_cutoff_hz"
        )
    active, dependent = _independent(R[:, :b], names, allowed)
    chi, covariance, rss = solve(R, active, held)
    return Estimate(names, chi, covariance, active, sigma, R, rss, rows, dependent, held)


def restrict(estimate: Estimate, active: np.ndarray) -> Estimate:
    """The same equations with fewer parameters."""
    chi, covariance, rss = solve(estimate.R, active, estimate.held)
    return replace(estimate, chi=chi, covariance=covariance, active=active, rss=rss)


def _independent(
    W: np.ndarray, names: tuple[str, ...], allowed: np.ndarray
) -> tuple[np.ndarray, tuple[Dependence, ...]]:
    """Which columns are independent, by QR with column pivoting of the columns scaled to length one.

    No pivot is smaller than the smallest singular value: where that is large enough, all are.
    """
    columns = np.flatnonzero(allowed)
    norm = np.linalg.norm(W[:, columns], axis=0)
    longest = norm.max(initial=0.0)
    seen = norm > 1e-12 * longest if longest > 0 else np.zeros(len(columns), bool)
    dependent = [Dependence(names[k], ()) for k in columns[~seen]]
    columns, norm = columns[seen], norm[seen]
    active = np.zeros(len(names), bool)
    if not len(columns):
        return active, tuple(dependent)
    scaled = W[:, columns] / norm
    if len(columns) <= len(W) and np.linalg.svd(scaled, compute_uv=False)[-1] > DEPENDENT:
        active[columns] = True
        return active, tuple(dependent)
    import scipy.linalg

    R, order = scipy.linalg.qr(scaled, mode="r", pivoting=True)
    diagonal = np.abs(np.diag(R))
    rank = int((diagonal > DEPENDENT * diagonal[0]).sum())
    active[columns[order[:rank]]] = True
    if rank < len(columns):
        combine = scipy.linalg.solve_triangular(R[:rank, :rank], R[:rank, rank:])
        for number, column in enumerate(order[rank:]):
            per_unit = combine[:, number] * norm[column] / norm[order[:rank]]
            strong = sorted(
                (k for k in range(rank) if abs(combine[k, number]) > 1e-3),
                key=lambda k: -abs(combine[k, number]),
            )
            dependent.append(
                Dependence(
                    names[columns[column]],
                    tuple((names[columns[order[k]]], float(per_unit[k])) for k in strong),
                )
            )
    return active, tuple(dependent)


def _conditioning(W: np.ndarray, names: tuple[str, ...]) -> tuple[float, tuple[str, ...]]:
    """Condition number of the columns scaled to length one, and the parameters of combinations hardly
    excited."""
    if W.shape[1] == 0:
        return 1.0, ()
    scaled = W / np.linalg.norm(W, axis=0)
    _, singular, V = np.linalg.svd(scaled, full_matrices=False)
    weak: dict[str, None] = {}
    for k in np.flatnonzero(singular < WEAK * singular[0]):
        strength = np.abs(V[k])
        weak |= dict.fromkeys(
            names[i] for i in np.argsort(-strength)[:4] if strength[i] > 0.3 * strength.max()
        )
    return float(singular[0] / max(singular[-1], 1e-300)), tuple(weak)


def bounded(estimate: Estimate) -> tuple[Estimate, tuple[str, ...]]:
    """`bounds: physical`: Iam, Fv, Fc and masses not negative. -> the estimate and the names held at zero.

    Solved on the factor (as many rows as parameters). A parameter at its bound leaves the fit, so the
    covariance is that of the others given the bound.
    """
    from scipy.optimize import lsq_linear

    columns = np.flatnonzero(estimate.active)
    lower = np.array([0.0 if not_negative(estimate.parameters[k]) else -np.inf for k in columns])
    if not (estimate.chi[columns] < lower).any():
        return estimate, ()
    R, scale = estimate.R[:, columns], np.linalg.norm(estimate.R[:, columns], axis=0)
    right = estimate.R[:, -1] - estimate.R[:, :-1] @ np.where(estimate.active, 0.0, estimate.chi)
    found = lsq_linear(R / scale, right, bounds=(lower * 1.0, np.inf), method="bvls", tol=1e-12)
    held = (found.x / scale <= lower + 1e-12) & np.isfinite(lower)
    active = estimate.active.copy()
    active[columns[held]] = False
    return restrict(estimate, active), tuple(estimate.parameters[k] for k in columns[held])


def not_negative(name: str) -> bool:
    """Whether physics forbids a negative value: rotor inertia, friction, mass (regrouped friction too)."""
    its = ParameterName.of(name)
    return its is not None and (its.kind in _DRIVES or (its.kind == "M" and not its.regrouped))


_DRIVES = ("Iam", "Iac", "Ial", "Fvm", "Fvl", "Fvc", "Fcm", "Fcl", "Fcc")


def huber_factors(
    systems: Sequence[RecordingSystem], sigma: np.ndarray, chi: np.ndarray
) -> tuple[tuple[ChannelFactor, ...], int]:
    """Factors with Huber's weights min(1, 1.345 sigma_j / |rho|) for residuals of chi; and how many rows
    lost weight."""
    n_channels = len(systems[0].factors)
    out, down = [], 0
    for j in range(n_channels):
        columns = np.unique(np.concatenate([system.factors[j].columns for system in systems]))
        stacked, rows = np.zeros((0, len(columns) + 1)), 0
        for system in systems:
            for segment in system.segments:
                for _, piece in segment.pieces():
                    used = piece.used[j]
                    W, Y = system.dense(piece, j, len(chi))[used], piece.Y[j, used]
                    rho = np.abs(Y - W @ chi) / sigma[j]
                    weight = np.minimum(1.0, HUBER / np.maximum(rho, 1e-300))
                    down += int((weight < 1).sum())
                    rows += len(rho)
                    wide = np.column_stack([W[:, columns], Y]) * np.sqrt(weight)[:, None]
                    stacked = triangular(np.vstack([stacked, wide]))
        out.append(ChannelFactor(columns, stacked, rows))
    return tuple(out), down
