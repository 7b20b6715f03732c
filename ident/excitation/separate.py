"""The motion that tells two effects apart: T-optimal design (Atkinson and Fedorov, Biometrika 62(1), 1975).

What of effect a no model with effect b can imitate is, in noise,

    T(a|b) = rows/s * min over d, theta, size of the mean over time |(F_a - W d - F_b(theta, size)) / sigma|^2

with the base parameters d and all parameters of b refitted. The motion makes 1/(1/T(a|b) + 1/T(b|a)) large,
which is next to the smaller of the two. At the inner optimum its slope is that of the residual at fixed
parameters (Danskin): exact through W, by differences through the effects, which may have any form and memory.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
import scipy.optimize
import scipy.signal

from ident.diagnosis.telling.deciding import SoFar, seconds_either_way, seconds_needed
from ident.equations.terms import Term, plain, torque_of
from ident.excitation.information import Rows
from ident.excitation.known import ROWS_HZ, Known, as_motion
from ident.excitation.motion import Basis
from ident.excitation.same import proof_in_limit
from ident.excitation.so_far import Before, nothing
from modelgen.effects.effect import Effect
from modelgen.effects.place import Motion

Array = np.ndarray
RATE_HZ = 50.0  # at which a motion is designed
SAME = 1e-4  # share of what is visible of an effect below which it is imitated
NEAR = 1e-2  # the same where one contains the other in a limit, which bounds keep it from reaching
TURNS, STILL = 6, 1e-6  # a size that changes less from turn to turn, relative, is that of its columns
SHAPES = 60  # starting shapes that are tried
OTHER = 0.3  # share of a torque: a first step of a shape that changes more is halved
HALVINGS = 30
TRIES, CLOSE, EXACT = 60, 0.01, 1e-7  # a search ends by so many a number, or next to its best: steps, share
CLEAR = 1e-8  # of the largest eigenvalue of W'W: with less its square roots are not known well enough


@dataclass(frozen=True)
class Imitation:
    """Effect a against the best of b: T per second, the base parameters and b that imitate it, what is left.

    `visible`: T of a against the base model alone, per second; `period` s of the motion."""

    rate: float
    visible: float
    d: Array  # (b,)
    other: Term
    residual: Array  # (N, C) over sigma
    period: float

    @property
    def rates(self) -> Array:
        """(N,) T per second along the period."""
        return ROWS_HZ * np.sum(self.residual**2, axis=1)

    @property
    def seconds(self) -> float:
        """Until a diagnosis decides, rightly in 1 - ALPHA of all cases; whole motions, at least one."""
        return max(seconds_needed(self.rates, self.period), self.period)

    @property
    def same(self) -> bool:
        return self.rate <= SAME * self.visible


def contained(a: Term, its: Imitation) -> bool:
    """Whether the other one does what a does: in this motion all of it, or all in a proven limit and here all
    but what bounds leave."""
    near = its.rate <= NEAR * its.visible
    return its.same or (near and proof_in_limit(a, its.other) is not None)


def seconds_of(both: Sequence[Imitation], same: Sequence[bool], so_far: SoFar) -> float:
    """s of a motion until two suspects are told apart: what the second cannot imitate of the first, what the
    first cannot of the second; whole motions, at least one."""
    ways = [None if alike else its.rates for its, alike in zip(both, same)]
    return max(seconds_either_way(ways, both[0].period, so_far), both[0].period)


class Projector:
    """Least squares over the base parameters along one motion, rows weighted by sigma (C,).

    `band_hz`: rows are low-passed, as an identification does, and one in `every` is kept."""

    def __init__(
        self, known: Known, motion: Motion, sigma: Array, band_hz: float | None = None, every: int = 1
    ) -> None:
        self.known, self.motion, self.sigma, self.every = known, motion, sigma, every
        self.filter = scipy.signal.butter(4, band_hz, fs=motion.rate_hz, output="sos") if band_hz else None
        self.solve(self.seen(known.regressor(motion)))

    def solve(self, W: Array) -> None:
        """Of the weighted rows W (rows, b), an orthonormal basis and the way back to the parameters."""
        self.W, length = W, np.linalg.norm(W, axis=0)
        length[length == 0] = 1.0
        scaled = W / length
        s, V = np.linalg.eigh(scaled.T @ scaled)
        if s[0] > CLEAR * s[-1]:  # a quarter of the time, and `off` projects twice
            self.Q, self.back = scaled @ (V / np.sqrt(s)), V / np.sqrt(s) / length[:, None]
            return
        U, s, V = np.linalg.svd(scaled, full_matrices=False)
        clear = s > 1e-10 * s.max(initial=1e-300)
        self.Q, self.back = U[:, clear], (V[clear].T / s[clear]) / length[:, None]

    @cached_property
    def rms(self) -> Array:
        """(C,) of the robot's own torque, weighted."""
        return np.sqrt(np.mean(self.known.torque(self.motion) ** 2, axis=0)) / self.sigma

    @property
    def instants(self) -> int:
        """Instants of the kept rows."""
        return len(self.W) // len(self.sigma)

    def seen(self, torque: Array) -> Array:
        """(rows, ...) of torques (N, C, ...): filtered, thinned, weighted."""
        if self.filter is not None:
            moving = np.flatnonzero(torque.any(axis=tuple(k for k in range(torque.ndim) if k != 1)))
            low = scipy.signal.sosfiltfilt(self.filter, torque[:, moving], axis=0)
            torque = np.zeros_like(torque[self.every // 2 :: self.every])
            torque[:, moving] = low[self.every // 2 :: self.every]  # most effects act on one channel
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
            change = term.effect.torque_change(
                term.place, term.theta, self.motion, self.known, self.known.chi
            )
            out = np.concatenate((out, change[..., None]), axis=2)
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
        for _ in range(1 if plain(term) else TURNS):  # columns may be secants that go with the size
            C = project.off(project.columns(term))
            aim = left - C[:, len(low) :].sum(axis=1)
            C = C[:, : len(low)]
            if len(low):
                size, before = scipy.optimize.lsq_linear(C, aim, (low, high), method="bvls").x, term.size
                aim, term = aim - C @ size, replace(term, size=tuple(map(float, size)))
                if np.allclose(size, before, STILL, 0.0):
                    break
        return aim, term

    last = b.size  # of the shape before: that of the next one is next to it

    def left_by(theta: Mapping[str, float]) -> tuple[Array, Term]:
        nonlocal last
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            residual, term = solved(replace(b, theta=dict(theta), size=last))
        if not np.isfinite(residual).all():
            return np.full_like(left, 1e150), term
        last = term.size
        return residual, term

    def power(tried: tuple[Array, Term]) -> float:
        return float(tried[0] @ tried[0])

    shapes = [dict(b.theta)]
    if b.free and not warm:
        shapes.append(_as_of(a, b))
        channel = min(b.place.rows(project.known.channels), default=0)
        like = torque_of(a, project.motion, project.known, {})[:, channel]  # type: ignore[arg-type]
        shapes += list(b.effect.starts(b.place, [project.motion], [like], project.known))[:SHAPES]
    shapes = [shape for k, shape in enumerate(shapes) if shape not in shapes[:k]]
    found = sorted(map(left_by, shapes), key=power)
    best = found[0]
    if b.free and warm:
        best = left_by(_polished(lambda shape: left_by(shape)[0], _Shape(best[1], project.torque)))
    elif b.free:
        enough = EXACT * float(left @ left)
        for _, near in found[:2]:
            refined = _refined(lambda shape: power(left_by(shape)), _Shape(near, project.torque), enough)
            best = min(best, left_by(refined), key=power)
    residual, other = best
    d = project.back @ (project.Q.T @ (Y - project.torque(other)))
    return Imitation(
        per_second * float(residual @ residual),
        per_second * float(left @ left),
        d,
        other,
        residual.reshape(project.instants, -1),
        len(project.motion.t) / project.motion.rate_hz,
    )


def _as_of(a: Term, b: Term) -> dict[str, float]:
    """b's shape with what it shares of a's: what contains the other may be there already."""
    shared = {name: a.theta[name] for name in b.free if name in a.theta}
    return {**b.theta, **{n: float(np.clip(v, *b.bounds[n])) for n, v in shared.items()}}


class _Shape:
    """Shape parameters inside their bounds as free numbers (k,), on a log scale where they are positive.

    step (k,): a first one, a small part of the range, and none that makes another torque (rows,) of it: a
    range may be wide because nothing is known of the parameter."""

    def __init__(self, near: Term, torque: Callable[[Term], Array]) -> None:
        self.near, box = near, near.bounds
        self.logs = np.array([box[name][0] > 0 for name in near.free])
        self.low, self.high = (np.array([box[name][k] for name in near.free]) for k in (0, 1))
        at = np.clip([near.theta[name] for name in near.free], self.low, self.high)
        self.at = np.where(self.logs, np.log(np.maximum(at, 1e-300)), at)
        self.step = np.where(self.logs, 0.1, 0.02 * (self.high - self.low))
        here = torque(near)
        for k, way in enumerate(np.eye(len(self.step))):
            for _ in range(HALVINGS):
                moved = torque(replace(near, theta=self(self.at + self.step * way))) - here
                if not moved @ moved > OTHER**2 * (here @ here):
                    break
                self.step[k] /= 2

    def __call__(self, x: Array) -> dict[str, float]:
        y = np.where(self.logs, np.exp(np.where(self.logs, x, 0.0)), x)
        y = np.clip(y, self.low, self.high)
        return {**self.near.theta, **dict(zip(self.near.free, map(float, y)))}


def _refined(value: Callable[[Mapping[str, float]], float], shape: _Shape, enough: float) -> dict[str, float]:
    """From near a minimum to it, by a simplex whose ends differ by no more than `enough` then."""
    k = len(shape.at)
    simplex = np.vstack([np.zeros(k), np.eye(k)])
    options = {"maxfev": TRIES * k, "xatol": CLOSE, "fatol": enough, "initial_simplex": simplex}
    found = scipy.optimize.minimize(
        lambda x: value(shape(shape.at + x * shape.step)), simplex[0], method="Nelder-Mead", options=options
    )
    return shape(shape.at + found.x * shape.step)


def _polished(residual: Callable[[Mapping[str, float]], Array], shape: _Shape) -> dict[str, float]:
    """From next to a minimum to it: a few Gauss-Newton steps, by differences, none that raises it."""
    x, r = shape.at, residual(shape(shape.at))
    for _ in range(3):
        J = np.stack([(residual(shape(x + h)) - r) / h.sum() for h in np.diag(1e-3 * shape.step)], axis=1)
        step = np.clip(-np.linalg.lstsq(J, r, rcond=1e-8)[0], -3 * shape.step, 3 * shape.step)
        trial = residual(shape(x + step))
        if not trial @ trial < r @ r:
            break
        x, r, before = x + step, trial, r
        if trial @ trial > (1 - 1e-6) * (before @ before):
            break
    return shape(x)


class Separation:
    """x (n, K) -> log of the sum of 1/T over every two terms, each against the other, and its slope, for
    `optimal.optimise`: next to the worst told of them. Any of them may be the true one. What `decides` found
    to be contained in another one is not asked for, in whatever motion comes of the search."""

    def __init__(
        self, known: Known, basis: Basis, sigma: Array, turn_over: Array, terms: Sequence[Term]
    ) -> None:
        self.known, self.basis, self.sigma, self.v = known, basis, sigma, turn_over
        self.terms = tuple(terms)
        self.warm: dict[tuple[str, str], Term] = {}
        self.contained = [False] * len(self.pairs)
        self.t = np.arange(0.0, basis.period, 1 / RATE_HZ)
        self.rows = Rows(known.model, sigma, turn_over)
        self.B = basis.at(self.t)[:3]

    @property
    def pairs(self) -> list[tuple[Term, Term]]:
        return [both for a, b in combinations(self.terms, 2) for both in ((a, b), (b, a))]

    def motion(self, x: Array) -> Motion:
        return as_motion([b @ x.T for b in self.B], self.t, self.v)

    def each(self, x: Array, warm: bool = False, motion: Motion | None = None) -> list[Imitation]:
        """Of every pair, what of the first the second cannot imitate; `motion`: instead of that of x."""
        return self._imitated(self.pairs, motion or self.motion(x), warm)

    def _imitated(self, pairs: Sequence[tuple[Term, Term]], motion: Motion, warm: bool) -> list[Imitation]:
        project = Projector(self.known, motion, self.sigma)
        found = []
        for a, b in pairs:
            key = (a.label, b.label)
            its = imitation(project, a, self.warm.get(key, b) if warm else b, warm and key in self.warm)
            self.warm[key] = its.other
            found.append(its)
        return found

    def decides(self, x: Array) -> bool:
        """Whether any of them can be told apart, by the motion of x; that one contains another is a property
        of the two, settled here and left out from now on. Dry friction turns over at once for that: what a
        smooth sign alone parts is parted by its width."""
        t = self.t + 0.5 / RATE_HZ  # at rest, where the motion begins, nothing has a sign
        sharp = as_motion([b @ x.T for b in self.basis.at(t)], t)
        each = self.each(x, motion=sharp)
        self.contained = [contained(a, its) for (a, _), its in zip(self.pairs, each)]
        return not all(self.contained)

    def seconds(self, each: Sequence[Imitation], so_far: Before = nothing) -> float:
        """Until every two are told apart that can be; infinite where none can."""
        found = []
        for at in range(0, len(each), 2):
            a, b = self.pairs[at]
            both, same = each[at : at + 2], self.contained[at : at + 2]
            if not all(same):
                found.append(seconds_of(both, same, so_far(a.label, b.label)))
        return max(found, default=np.inf)

    def __call__(self, x: Array) -> tuple[float, Callable[[], Array]]:
        asked = [pair for pair, out in zip(self.pairs, self.contained) if not out]
        found = [(its, a) for its, (a, _) in zip(self._imitated(asked, self.motion(x), True), asked)]
        rates = np.array([max(its.rate, 1e-12) for its, _ in found])
        return float(np.log((1 / rates).sum())), lambda: self._back(x, found, rates)

    def _back(self, x: Array, found: Sequence[tuple[Imitation, Term]], rates: Array) -> Array:
        total, states = (1 / rates).sum(), [b @ x.T for b in self.B]
        out = np.zeros_like(x)
        imitating, imitated = [], {term.label: (term, np.zeros(1)) for term in self.terms}
        for (its, a), rate in zip(found, rates):
            weight = -2 * ROWS_HZ / len(self.t) / (rate**2 * total) * its.residual  # (N, C)
            imitating.append((its.other, -weight))
            imitated[a.label] = a, imitated[a.label][1] + weight
            back = self.rows.back_through_torque(states[0], states[1], states[2], -weight, its.d)
            out += sum(g.T @ b for g, b in zip(back, self.B))
        for term, weight in (*imitating, *imitated.values()):
            if weight.any():
                out += self._slope(x, states, term, weight)
        return out

    def _slope(self, x: Array, states: Sequence[Array], term: Term, weight: Array) -> Array:
        """weight' dF / dx of a term's torque at fixed parameters."""
        out, here = np.zeros_like(x), self._torque(term, states)
        own = [j for j in (term.place.joint, term.place.source) if j is not None]
        joints = own if plain(term) else range(len(x))
        if _instant(term):
            for j, k in ((j, k) for j in joints for k in range(3)):
                moved = list(states)
                step = 1e-5 * max(abs(moved[k][:, j]).max(), 0.1)
                moved[k] = moved[k].copy()
                moved[k][:, j] += step
                change = (weight * (self._torque(term, moved) - here) / self.sigma).sum(axis=1)
                out[j] += change @ self.B[k] / step
            return out
        for j, k in ((j, k) for j in joints for k in range(x.shape[1])):
            step = 1e-5 * max(abs(x[j]).max(), 0.1)
            y = x.copy()
            y[j, k] += step
            change = self._torque(term, [B @ y.T for B in self.B]) - here
            out[j, k] += float(np.sum(weight * change / self.sigma)) / step
        return out

    def _torque(self, term: Term, states: Sequence[Array]) -> Array:
        return torque_of(term, as_motion(states, self.t, self.v), self.known, {})  # type: ignore[arg-type]


def _instant(term: Term) -> bool:
    """An instant's torque is that of the joints' states then: no memory."""
    its = type(term.effect)
    return its.columns is Effect.columns and not term.effect.state and its.states is Effect.states
