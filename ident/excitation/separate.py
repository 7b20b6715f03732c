"""The motion that tells two effects apart: T-optimal design (Atkinson and Fedorov, Biometrika 62(1), 1975).

What of effect a no model with effect b can imitate is, in noise,

    T(a|b) = rows/s * min over d, theta, size of the mean over time |(F_a - W d - F_b(theta, size)) / sigma|^2

with the base parameters d and all parameters of b refitted. The motion makes 1/(1/T(a|b) + 1/T(b|a)) large,
which is next to the smaller of the two. At the inner optimum its slope is that of the residual at fixed
parameters (Danskin): exact through W, by differences through the effects, which may have any form and memory.

The log likelihood ratio has mean T s / 2 and variance T s after s seconds; it is beyond log 1/alpha with
probability 1 - alpha when sqrt(T s) = z + sqrt(z^2 + 2 log 1/alpha), z the normal quantile of 1 - alpha.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize
import scipy.signal
import scipy.stats
import sympy as sp

from ident.equations.terms import Term, plain, torque_of
from ident.excitation.information import Rows
from ident.excitation.known import ROWS_HZ, Known, as_motion
from ident.excitation.motion import Basis
from modelgen.effects.effect import SIGNALS
from modelgen.effects.place import Motion

Array = np.ndarray
RATE_HZ = 50.0  # at which a motion is designed
SAME = 1e-9  # share of an effect's own square below which it is imitated
ALPHA = 0.01
SHAPES = 60  # starting shapes that are tried


@dataclass(frozen=True)
class Imitation:
    """Effect a against the best of b: T per second, the base parameters and b that imitate it, what is left.

    `visible`: T of a against the base model alone, per second."""

    rate: float
    visible: float
    d: Array  # (b,)
    other: Term
    residual: Array  # (N, C) over sigma

    @property
    def same(self) -> bool:
        return self.rate <= SAME * self.visible


class Projector:
    """Least squares over the base parameters along one motion, rows weighted by sigma (C,).

    `band_hz`: rows are low-passed, as an identification does, and one in `every` is kept."""

    def __init__(
        self, known: Known, motion: Motion, sigma: Array, band_hz: float | None = None, every: int = 1
    ) -> None:
        self.known, self.motion, self.sigma, self.every = known, motion, sigma, every
        self.filter = scipy.signal.butter(4, band_hz, fs=motion.rate_hz, output="sos") if band_hz else None
        self.W = self.seen(known.regressor(motion))
        length = np.linalg.norm(self.W, axis=0)
        length[length == 0] = 1.0
        U, s, V = np.linalg.svd(self.W / length, full_matrices=False)
        clear = s > 1e-10 * s.max(initial=1e-300)
        self.Q, self.back = U[:, clear], (V[clear].T / s[clear]) / length[:, None]

    @property
    def instants(self) -> int:
        """Instants of the kept rows."""
        return len(self.W) // len(self.sigma)

    def seen(self, torque: Array) -> Array:
        """(rows, ...) of torques (N, C, ...): filtered, thinned, weighted."""
        if self.filter is not None:
            torque = scipy.signal.sosfiltfilt(self.filter, torque, axis=0)[self.every // 2 :: self.every]
        shape = (1, len(self.sigma)) + (1,) * (torque.ndim - 2)
        return (torque / self.sigma.reshape(shape)).reshape(-1, *torque.shape[2:])

    def off(self, Y: Array) -> Array:
        """What W does not explain of Y (rows, k)."""
        left = Y - self.Q @ (self.Q.T @ Y)
        return left - self.Q @ (self.Q.T @ left)

    def torque(self, term: Term) -> Array:
        """(rows,) of a term, weighted."""
        return self.seen(torque_of(term, self.motion, self.known, {}))  # type: ignore[arg-type]

    def columns(self, term: Term) -> Array:
        """(rows, p) columns of a term's linear parameters, weighted."""
        out = np.zeros((len(self.motion.t), len(self.sigma), len(term.linear)))
        size = np.array(term.size)
        found = term.effect.columns(term.place, term.theta, size, self.motion, self.known, {})
        for channel, part in found.items():
            out[:, channel] = part
        if term.effect.changes_model:
            changes = term.effect.regressor_change(term.place, term.theta, self.motion, self.known)
            change = sum(self.known.chi[number] * W for number, W in changes.items())
            out = np.concatenate((out, np.broadcast_to(change, out.shape[:2])[..., None]), axis=2)
        return self.seen(out)


def imitation(project: Projector, a: Term, b: Term, warm: bool = False) -> Imitation:
    """The best that b can do to look like a on this motion. `warm`: b's shape is near its best already."""
    Y = project.torque(a)
    left = project.off(Y)
    per_second = ROWS_HZ / project.instants
    limits = {p.name: (p.low if p.sign == "positive" else -np.inf, np.inf) for p in b.effect.linear}
    low, high = np.array([limits[name] for name in b.linear]).reshape(-1, 2).T

    def solved(term: Term) -> tuple[Array, Term]:
        aim = left
        for _ in range(1 if plain(term) else 3):  # columns may be secants that go with the size
            C = project.off(project.columns(term))
            aim = left - C[:, len(low) :].sum(axis=1)
            C = C[:, : len(low)]
            if len(low):
                size = scipy.optimize.lsq_linear(C, aim, (low, high), method="bvls").x
                aim, term = aim - C @ size, replace(term, size=tuple(map(float, size)))
        return aim, term

    def tried(theta: Mapping[str, float]) -> tuple[float, Term]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            residual, term = solved(replace(b, theta=dict(theta)))
        value = float(residual @ residual)
        return (value if np.isfinite(value) else np.inf), term

    shapes = [dict(b.theta)]
    if b.free and not warm:
        channel = min(b.place.rows(project.known.channels), default=0)
        like = torque_of(a, project.motion, project.known, {})[:, channel]  # type: ignore[arg-type]
        shapes += list(b.effect.starts(b.place, [project.motion], [like], project.known))[:SHAPES]
    found = sorted((tried(shape) for shape in shapes), key=lambda entry: entry[0])
    best = found[0]
    for _, near in found[: 1 if warm else 2] if b.free else ():
        refined = _refined(lambda shape: tried(shape)[0], near, 25 if warm else 60)
        best = min(best, tried(refined), key=lambda entry: entry[0])
    residual, other = solved(best[1])
    d = project.back @ (project.Q.T @ (Y - project.torque(other)))
    return Imitation(
        per_second * float(residual @ residual),
        per_second * float(left @ left),
        d,
        other,
        residual.reshape(project.instants, -1),
    )


def _refined(value: Callable[[Mapping[str, float]], float], near: Term, tries: int) -> dict[str, float]:
    """Shape parameters inside their bounds, from near a minimum; on a log scale where they are positive."""
    names, box = near.free, near.bounds
    logs = np.array([box[name][0] > 0 for name in names])
    low, high = (np.array([box[name][k] for name in names]) for k in (0, 1))

    def shape(x: Array) -> dict[str, float]:
        y = np.clip(np.where(logs, np.exp(np.where(logs, x, 0.0)), x), low, high)
        return {**near.theta, **dict(zip(names, map(float, y)))}

    at = np.clip([near.theta[name] for name in names], low, high)
    at = np.where(logs, np.log(np.maximum(at, 1e-300)), at)
    options = {"maxfev": tries * len(names), "xatol": 1e-6, "fatol": 0.0}
    step = np.where(logs, 0.1, 0.02 * (high - low))
    simplex = np.vstack([at, at + np.diag(step)])
    found = scipy.optimize.minimize(
        lambda x: value(shape(x)), at, method="Nelder-Mead", options={**options, "initial_simplex": simplex}
    )
    return shape(found.x)


class Separation:
    """x (n, K) -> log(1/T(a|b) + 1/T(b|a)) and its slope, for `optimal.optimise`."""

    def __init__(self, known: Known, basis: Basis, sigma: Array, turn_over: Array, a: Term, b: Term) -> None:
        self.known, self.basis, self.sigma, self.v = known, basis, sigma, turn_over
        self.terms = (a, b)
        self.warm: dict[str, Term] = {}
        self.t = np.arange(0.0, basis.period, 1 / RATE_HZ)
        self.rows = Rows(known.model, sigma, turn_over)
        self.B = basis.at(self.t)[:3]

    def motion(self, x: Array) -> Motion:
        return as_motion([b @ x.T for b in self.B], self.t, self.v)

    def both(self, x: Array, warm: bool = False) -> tuple[Imitation, Imitation]:
        """(a against b, b against a)."""
        project = Projector(self.known, self.motion(x), self.sigma)
        found = []
        for a, b in (self.terms, self.terms[::-1]):
            its = imitation(
                project, a, self.warm.get(b.label, b) if warm else b, warm and b.label in self.warm
            )
            self.warm[b.label] = its.other
            found.append(its)
        return found[0], found[1]

    def __call__(self, x: Array) -> tuple[float, Array]:
        found = [(its, a) for its, a in zip(self.both(x, warm=True), self.terms) if not its.same]
        rates = np.array([max(its.rate, 1e-12) for its, _ in found])
        total = (1 / rates).sum()
        slopes = (self._slope(x, a, its) / rate**2 for (its, a), rate in zip(found, rates))
        return float(np.log(total)) if found else 0.0, -sum(slopes, np.zeros_like(x)) / max(total, 1e-300)

    def _slope(self, x: Array, a: Term, its: Imitation) -> Array:
        """dT/dx at fixed parameters: 2 r' dE, E = F_a - W d - F_b."""
        weight = 2 * ROWS_HZ / len(self.t) * its.residual  # (N, C)
        q, dq, ddq = (b @ x.T for b in self.B)
        back = self.rows.back(q, dq, ddq, -weight[:, :, None] * its.d)
        out = sum(g.T @ b for g, b in zip(back, self.B))
        for term, sign in ((a, 1.0), (its.other, -1.0)):
            joints = (
                range(len(x))
                if not plain(term)
                else [j for j in (term.place.joint, term.place.source) if j is not None]
            )
            here = torque_of(term, self.motion(x), self.known, {})  # type: ignore[arg-type]
            for j in joints:
                for k in range(x.shape[1]):
                    step = 1e-5 * max(abs(x[j]).max(), 0.1)
                    moved = x.copy()
                    moved[j, k] += step
                    change = torque_of(term, self.motion(moved), self.known, {}) - here  # type: ignore[arg-type]
                    out[j, k] += sign * float(np.sum(weight * change / self.sigma)) / step
        return out


def seconds_needed(rate: float, alpha: float = ALPHA) -> float:
    """s of a motion with T = rate per second until 1 - alpha of all decisions are right and sure."""
    z = scipy.stats.norm.isf(alpha)
    return float((z + np.sqrt(z * z + 2 * np.log(1 / alpha))) ** 2 / rate) if rate > 0 else float("inf")


def proof(a: Term, b: Term) -> str | None:
    """The identity that makes b an imitation of a, shown symbolically; None where none was found.

    Looked for: a's terms as combinations of b's and of 1, dq, ddq, sign dq of the joint, with rational
    coefficients, for own-joint terms without states."""
    if not (plain(a) and plain(b)) or a.place.joint != b.place.joint or a.effect.state or b.effect.state:
        return None
    S = SIGNALS
    names = {"q", "dq", "ddq", "sign_dq"}
    if not (a.effect.needs | b.effect.needs) <= names or a.effect.nonlinear != b.effect.nonlinear:
        return None
    theirs = [b.effect.terms[name] for name in b.linear] + [sp.Integer(1), S.dq, S.ddq, S.sign_dq]
    rng = np.random.default_rng(3)
    signals = {name: rng.uniform(-2, 2, 60) for name in ("q", "dq", "ddq")}
    symbols = [S.q, S.dq, S.ddq, S.sign_dq]
    numbers = [*signals.values(), np.sign(signals["dq"])]
    fixed = {sp.Symbol(name, real=True): sp.Rational(repr(v)) for name, v in a.theta.items()}
    columns = [np.broadcast_to(sp.lambdify(symbols, e.subs(fixed))(*numbers), 60) for e in theirs]
    told = []
    for name in a.linear:
        mine = a.effect.terms[name]
        y = np.broadcast_to(sp.lambdify(symbols, mine.subs(fixed))(*numbers), 60)
        found = np.linalg.lstsq(np.stack(columns, 1), y, rcond=1e-10)[0]
        exact = sum(
            (sp.nsimplify(round(c, 9), rational=True) * e for c, e in zip(found, theirs)), sp.Integer(0)
        )
        both = (mine - exact).subs(sp.Abs(S.dq), S.dq * S.sign_dq)
        if sp.simplify(sp.expand(both).subs(S.sign_dq**2, 1)) != 0:
            return None
        told.append(f"{mine} = {exact}")
    return "; ".join(told)
