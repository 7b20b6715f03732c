"""The semidefinite programs of a fit, which give parameters that a physical robot can have: consistent.py."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from ident.export.bodies import body, pseudo
from ident.export.combination import Combination, ExportError, functional
from ident.export.saved import SavedFit

FINEST = 1e-4  # error over torque: no recording is believed to be finer


class Program:
    """The semidefinite programs of one fit, in Q_j = L_j^-1 P_j L_j^-T with P_j0 = L_j L_j'."""

    def __init__(self, fit: SavedFit, c: Combination, prior: np.ndarray) -> None:
        self.fit, self.c = fit, c
        b = len(fit.chi)
        noise = np.sqrt(fit.rss) / np.linalg.norm(fit.R[:, -1])
        self.T = np.sqrt(fit.share) * min(1.0, noise / FINEST) * fit.R[:b, :b]
        self.roots = np.linalg.cholesky(prior)
        alone = [name.startswith("Iam") and not c.rotors[k] for k, name in enumerate(c.names)]
        seen = [float(fit.full_chi @ c.G[:, k]) for k in np.flatnonzero(alone)]
        seen = [value for value in seen if value > 0]
        self.rotor = (
            float(np.median(seen)) if seen else 0.1 * float(np.median(prior[:, 0, 0] + prior[:, 1, 1]))
        )

    def rise(self, chi: np.ndarray, full: np.ndarray) -> float:
        return float(np.sum((self.T @ (chi - full)) ** 2))

    def solve(self, aim: str, chi: np.ndarray) -> np.ndarray | None:
        """x (p,), or None where there is none. aim: "exact", "nearest" or "physics" (no prior)."""
        cp = cvxpy_module()
        c, n = self.c, self.c.links
        Q = {int(j): cp.Variable((4, 4), PSD=True) for j in np.flatnonzero(c.solid)}
        parts: list[Any] = []
        for j in range(n):
            if j not in Q:
                parts.append(np.zeros(10))
                continue
            maps = np.array([functional(k) for k in range(10)])  # phi_k = tr(maps[k] P)
            seen = np.array([self.roots[j].T @ m @ self.roots[j] for m in maps]).reshape(10, 16)
            parts.append(seen @ cp.vec(Q[j], order="C"))
        rest = cp.Variable(len(c.names) - 10 * n)
        x = cp.hstack([*parts, rest])
        constraints = [rest[k] >= 0 for k in np.flatnonzero(c.not_negative[10 * n :])]
        divergence = sum(cp.trace(q) - cp.log_det(q) - 4 for q in Q.values())
        for k in np.flatnonzero(c.rotors[10 * n :]):
            divergence += rest[k] / self.rotor - cp.log(rest[k] / self.rotor) - 1
        if aim == "exact":
            used = np.abs(c.G).sum(axis=1) > 0
            scale = 1 / np.maximum(np.abs(chi), 1e-2 * np.abs(chi).mean())[used]
            constraints.append(cp.multiply(scale, c.G[used] @ x - chi[used]) == 0)
            objective = divergence
        else:
            misfit = cp.sum_squares((self.T @ c.G) @ x - self.T @ chi) / 2
            objective = misfit if aim == "physics" else misfit + divergence
        problem = cp.Problem(cp.Minimize(objective), constraints)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of its last digits: what comes out is checked here
                problem.solve(solver=cp.CLARABEL)
        except (cp.error.SolverError, ValueError):
            return None
        if problem.status not in ("optimal", "optimal_inaccurate") or rest.value is None:
            return None
        bodies = [
            body(self.roots[j] @ Q[j].value @ self.roots[j].T) if j in Q else np.zeros(10) for j in range(n)
        ]
        found = np.concatenate([*bodies, rest.value])
        found[c.not_negative] = np.maximum(found[c.not_negative], 0.0)
        return self._exactly(found, chi) if aim == "exact" else found

    def _exactly(self, x: np.ndarray, chi: np.ndarray) -> np.ndarray | None:
        """Take out what the solver's tolerance left of G x = chi; None if that is not possible."""
        scale = np.maximum(np.abs(x), 1e-6)
        step = np.linalg.lstsq(self.c.G * scale, chi - self.c.G @ x, rcond=None)[0] * scale
        moved = x + step
        bodies = moved[: 10 * self.c.links].reshape(-1, 10)
        fine = all(np.linalg.eigvalsh(pseudo(phi))[0] > 0 for phi in bodies[self.c.solid])
        fine &= bool(np.all(moved[self.c.not_negative] >= 0)) and np.allclose(
            self.c.G @ moved, chi, rtol=1e-12, atol=1e-12
        )
        return moved if fine else None


def cvxpy_module() -> Any:
    try:
        import cvxpy
    except ImportError:
        raise ExportError(
            "physically consistent parameters need a solver; pip install 'dynident[export]'"
        ) from None
    return cvxpy
