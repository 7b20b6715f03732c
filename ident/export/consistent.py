"""Standard parameters that a physical robot can have: exactly the identified ones, or the nearest possible.

What identification gives are base parameters, chi = G x: combinations G of each link's ten parameters and of
the drives'. Of all x with positive definite pseudo-inertias P_j and no negative friction or rotor inertia,

    exact      minimise sum_j D(P_j | P_j0)   subject to G x = chi
    nearest    minimise 1/2 (n_eff / n) ||R (G x; -1)||^2 + sum_j D(P_j | P_j0)     where no x gives chi

with D(P | P0) = tr(P0^-1 P) - log det(P0^-1 P) - 4, the log-det divergence from a prior P0 (Lee, Wensing and
Park 2020), and R the triangular factor of the weighted equations: its first term is minus the log-likelihood
with as many rows as the correlated residuals are worth, so that the prior weighs what one sample would.
Both are semidefinite programs of a few dozen unknowns, whatever the recordings' length. `physics` says what
possible bodies alone cost, without a prior: parameters that no robot has are named from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.stats

from ident.export.bodies import BASIS, body, given_bodies, pseudo, unit_density
from ident.export.combination import Combination, ExportError, combination, never_negative
from ident.export.program import Program
from ident.export.saved import SavedFit, TextTable
from modelgen.geometry.robot import Robot

FALLBACK_DENSITY = 1500.0  # kg/m^3, where the recordings show no weight
MEASURED = 0.9  # share of a parameter's variance under the prior that the recordings take away
TOGETHER = 0.89  # at most, for a parameter that base parameters have only in a sum with others
SURE = 1e-3  # probability below which noise is no explanation


@dataclass(frozen=True, slots=True)
class Consistent:
    """x (p,) standard parameters of a robot that can exist, chi = G x (b,) its base parameters.

    measured (p,): how much of its variance under the prior the recordings take from each; std (p,). rise: of
    chi-squared in effective rows over the unconstrained fit; rise_of_physics: without any prior.
    """

    combination: Combination
    x: np.ndarray
    chi: np.ndarray
    exact: bool
    prior_is: str
    measured: np.ndarray
    std: np.ndarray
    rise: float
    rise_of_physics: float
    findings: tuple[str, ...]

    def value(self, name: str) -> float:
        """A standard parameter by name, 0 where the model has none."""
        names = self.combination.names
        return float(self.x[names.index(name)]) if name in names else 0.0

    def bodies(self) -> np.ndarray:
        """(links, 10) in the order of INERTIAL."""
        return self.x[: 10 * self.combination.links].reshape(-1, 10)

    def label(self, k: int) -> str:
        """Where parameter k is from."""
        return "measured" if self.measured[k] >= MEASURED else "from the prior"

    def sentence(self) -> str:
        """How these numbers stand to the identified ones."""
        how = (
            "They give exactly the identified base parameters"
            if self.exact
            else "No physical robot with exactly the identified base parameters was found (cancelled ones "
            "count as zero); these are the most likely that one can have "
            f"(chi-squared rises by {self.rise:.3g}, without a prior by {self.rise_of_physics:.3g})"
        )
        return f"All bodies are physically consistent. {how}. Prior: {self.prior_is}."


def parameter_table(found: Consistent) -> TextTable:
    """Header and rows of every standard parameter: value, std, share that is measured, where it is from."""
    rows: list[tuple[str, ...]] = [
        (name, f"{x:.4g}", f"{std:.2g}", f"{100 * share:.0f}", found.label(k))
        for k, (name, x, std, share) in enumerate(
            zip(found.combination.names, found.x, found.std, found.measured)
        )
        if k >= 10 * found.combination.links or found.combination.solid[k // 10]
    ]
    return ("parameter", "value", "std", "measured %", "from"), rows


def consistent(fit: SavedFit, robot: Robot) -> Consistent:
    """The physically consistent parameters of a fit. Raises ExportError."""
    if fit.study.model == "D":
        raise ExportError("model D has the drives alone, no bodies; fit model A, B or C to export a robot")
    c = combination(fit, robot)
    prior, prior_is = _prior(fit, robot, c)
    program = Program(fit, c, prior)
    full = np.where(fit.full_active, fit.full_chi, 0.0)
    exact = program.solve("exact", fit.chi)
    x = exact if exact is not None else program.solve("nearest", full)
    possible = program.solve("physics", full) if exact is None else exact
    if x is None or possible is None:
        raise ExportError(
            "the semidefinite program has no solution; check the fit's errors and warnings first"
        )
    chi = fit.chi.copy() if exact is not None else c.G @ x
    measured, std = _resolution(program, x)
    rise, of_physics = (program.rise(v, full) for v in (chi, c.G @ possible))
    findings = _findings(fit, c, c.G @ possible, of_physics)
    return Consistent(c, x, chi, exact is not None, prior_is, measured, std, rise, of_physics, findings)


def _prior(fit: SavedFit, robot: Robot, c: Combination) -> tuple[np.ndarray, str]:
    given = given_bodies(robot)
    if given is not None:
        return given, "the inertias of the robot's own file"
    made = unit_density(robot)
    column = c.G[:, : 10 * c.links] @ np.concatenate([body(P) for P in made])
    others = [np.eye(len(fit.chi))[:, k] for k, name in enumerate(fit.columns.parameters)
              if not c.G[k, : 10 * c.links].any()]  # fmt: skip
    A = fit.R[:, :-1] @ np.column_stack([column, *others])
    density = float(np.linalg.lstsq(A, fit.R[:, -1], rcond=None)[0][0])
    if not density > 0:
        density = FALLBACK_DENSITY
    mass = density * made[:, 3, 3].sum()
    return (
        density * made,
        f"tubes between the joints, of one density that suits the recordings ({mass:.3g} kg in all)",
    )


def _resolution(program: Program, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How much of each parameter's variance under the prior the recordings take away, and its std, (p,) each.

    From the Hessians of likelihood and divergence at x: 1 - diag((H_data + H_prior)^-1) / diag(H_prior^-1).
    What motion shows only in sums with other parameters is never called measured: the prior parts the sum.
    """
    c = program.c
    data = (program.T @ c.G).T @ (program.T @ c.G)
    prior, before = np.zeros_like(data), np.full(len(x), np.inf)
    for j, phi in enumerate(x[: 10 * c.links].reshape(-1, 10)):
        if not c.solid[j]:
            continue
        inverse = np.linalg.inv(pseudo(phi))
        moved = [inverse @ B for B in BASIS]
        at = slice(10 * j, 10 * j + 10)
        prior[at, at] = [[float(np.sum(a * b.T)) for b in moved] for a in moved]
        before[at] = _inverse_diagonal(prior[at, at])
    for k in np.flatnonzero(c.rotors):
        before[k] = max(x[k], 1e-9) ** 2
        prior[k, k] = 1 / before[k]
    after = _inverse_diagonal(data + prior)
    rows = c.G[program.fit.full_active]
    seen_alone = np.linalg.norm(np.eye(len(x)) - np.linalg.pinv(rows) @ rows, axis=0) < 1e-9
    after[np.diag(data + prior) <= 0] = np.inf  # neither excited nor given
    with np.errstate(invalid="ignore"):
        share = np.where(np.isfinite(after), 1 - after / before, 0.0)
    return np.where(seen_alone, np.clip(share, 0, 1), np.minimum(np.clip(share, 0, 1), TOGETHER)), np.sqrt(
        after
    )


def _inverse_diagonal(H: np.ndarray) -> np.ndarray:
    """diag(H^-1) of a positive semidefinite matrix, scaled first."""
    scale = 1 / np.sqrt(np.where(np.diag(H) > 0, np.diag(H), 1.0))
    return (
        np.maximum(np.diag(np.linalg.pinv(H * scale[:, None] * scale, rcond=1e-14, hermitian=True)), 0)
        * scale**2
    )


def _findings(fit: SavedFit, c: Combination, possible: np.ndarray, rise: float) -> tuple[str, ...]:
    """What no physical robot can have, in words, or nothing."""
    reasons = (
        "the usual reasons are a drive gain, the sign of a torque, an effect that the model lacks, or motion "
        "that excites the parameter too little"
    )
    std = np.sqrt(np.diag(fit.covariance))
    out = []
    for k, name in enumerate(fit.columns.parameters):
        sure = fit.full_active[k] and fit.full_chi[k] < -3.3 * std[k]
        if sure and never_negative(c, k):
            out.append(
                f"{name} = {fit.full_chi[k]:.3g} (std {std[k]:.2g}): no physical robot has it below zero; "
                f"{reasons}"
            )
    if rise > scipy.stats.chi2.isf(SURE, len(fit.chi)):
        with np.errstate(divide="ignore", invalid="ignore"):
            moved = np.where(fit.full_active, (possible - fit.full_chi) / std, 0.0)
        worst = [k for k in np.argsort(-np.abs(moved))[:4] if abs(moved[k]) > 3]
        told = ", ".join(f"{fit.columns.parameters[k]} ({moved[k]:+.1f} std)" for k in worst)
        out.append(
            f"no physical robot has these parameters together: chi-squared rises by {rise:.3g}"
            + (f", most for {told}" if told else "")
            + f"; {reasons}"
        )
    return tuple(out)
