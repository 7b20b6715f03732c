"""The best Fourier motion of a criterion under limits: IPOPT inside CasADi, from several random starts.

Position, rate, acceleration and jerk are linear in the coefficients and held at every instant (motion.py).
The torque is held on a grid, for the largest dry friction of either sign, the way to boxes and between the
robot's bodies on a finer one; both are looked at afterwards at 1 kHz (holding.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ident.excitation.external import Steps, external
from ident.excitation.holding import NEAR, Holding
from ident.excitation.motion import Basis, FourierMotion, Planned
from ident.progress import Progress, silent
from modelgen.effects.frames import frames

Array = np.ndarray
Objective = Callable[[Array], tuple[float, Callable[[], Array]]]  # x (n, K) -> value, the way to its slope
FINER = 3  # times the instants of the grid at which bodies and boxes are looked at
FINEST = 20  # times the instants at which positions are, where the start is next to a limit
MARGIN = 0.98  # of the torque limits on the grid
ROUNDS, AGAIN, SLACK = 3, 15, 1.002  # of iterations where limits do not hold between the instants of the grid


@dataclass(frozen=True)
class Optimum:
    """The best motion and its value, each start's value before and after, whether it was cut short."""

    motion: Planned
    value: float
    starts: tuple[tuple[float, float], ...]
    stopped: bool = False


def random_motion(
    holding: Holding, basis: Basis, rest: Array, duration: float, rng: np.random.Generator, fixed: bool
) -> FourierMotion:
    """A feasible motion of random coefficients, as large as the limits allow."""
    bounds = holding.bounds
    x = rng.normal(size=(len(rest), basis.size))
    x[:, 0] = 0.0
    q, dq, ddq, jerk = (np.abs(B @ x.T).max(axis=0) for B in basis.at(basis.grid))
    x *= np.min([bounds.half / q, bounds.dq / dq, bounds.ddq / ddq, bounds.jerk / jerk], axis=0)[:, None]
    if not fixed:  # place it in the middle of the range
        swing = basis.at(basis.grid)[0] @ x.T
        x[:, 0] = np.clip(bounds.middle - (swing.max(0) + swing.min(0)) / 2, bounds.low, bounds.high)
    else:  # as large as there is room on either side
        swing = basis.at(basis.finer(FINER))[0] @ x.T
        room = np.minimum((bounds.high - rest) / swing.max(0), (rest - bounds.low) / -swing.min(0))
        x *= np.clip(room, 0.0, 1.0)[:, None]
        x[:, 0] = rest
    return holding.drawn(basis, x, rest, duration, final=False)


def optimise(
    holding: Holding,
    basis: Basis,
    duration: float,
    objective: Objective,
    *,
    start: Array | None = None,
    seed: int = 0,
    starts: int = 2,
    iterations: int = 60,
    first: FourierMotion | None = None,
    progress: Progress = silent,
    stop: Callable[[], bool] = lambda: False,
) -> Optimum:
    """The smallest value of the objective. `start` (n,) fixes where it begins; `stop` is asked at times."""
    rng = np.random.default_rng([seed, 14])
    rest = holding.rest(start, rng)
    solve = _solver(holding, basis, objective, start, iterations, stop)
    best: tuple[float, FourierMotion] | None = None
    told = []
    for number in range(starts):
        if stop() and best is not None:
            break
        begin = first if first is not None and number == 0 else None
        if begin is None:
            tries = [random_motion(holding, basis, rest, duration, rng, start is not None) for _ in range(8)]
            begin = min(tries, key=lambda motion: objective(motion.x)[0])
        before = objective(begin.x)[0]
        tell = partial(_tell, progress, number, starts)
        x, used = solve(begin.x, tell, 1.0), 1.0
        ways = [holding.drawn(basis, x, rest, duration)]
        for _ in range(ROUNDS):  # drawn to rest it would lose what it won
            over, _ = holding.use(FourierMotion(basis, x, duration))
            if over <= 1 or stop():
                break
            used *= SLACK * over
            x = solve(x, tell, used)
            ways.append(holding.drawn(basis, x, rest, duration))
        values = [objective(found.x)[0] for found in ways]
        for motion, value in (*zip(ways, values), (begin, before)):
            if best is None or (value < best[0] and holding.touching(motion) is None):
                best = (value, motion)
        told.append((before, min(values)))
    assert best is not None
    return Optimum(best[1], best[0], tuple(told), stop())


def _tell(progress: Progress, number: int, starts: int, share: float) -> None:
    progress(f"motion {number + 1} of {starts}", (number + share) / starts)


def _solver(
    holding: Holding,
    basis: Basis,
    objective: Objective,
    start: Array | None,
    iterations: int,
    stop: Callable[[], bool],
) -> Callable[[Array, Callable[[float], None], float], Array]:
    """x0 (n, K), progress, used -> x (n, K) by IPOPT, the best point that it saw inside the limits at its
    end; used: share of a limit that x0 takes at most, above one where it is nearly the best and the limits
    are to be drawn in by so much."""
    import casadi as ca

    bounds, n, K = holding.bounds, len(holding.bounds.low), basis.size
    B = basis.at(basis.grid)
    limits = (bounds.half, bounds.dq, bounds.ddq, bounds.jerk)
    scale = np.min([half / np.abs(b[:, 1:]).max() for half, b in zip(limits[1:], B[1:])], axis=0)  # (n,)
    times = _times(holding, basis, start)
    Q, rows = basis.at(basis.finer(times))[0], []
    sizes = (basis.tighter(times), *[basis.tighter()] * 3)
    for joint in range(n):
        unit = np.column_stack((np.full(len(Q), bounds.half[joint]), Q[:, 1:] * scale[joint]))
        kinds = [unit, *(np.column_stack((np.zeros(len(b)), b[:, 1:] * scale[joint])) for b in B[1:])]
        rows.append(np.vstack([kind / (limit[joint] * s) for kind, limit, s in zip(kinds, limits, sizes)]))
    linear = ca.diagcat(*(ca.sparsify(ca.DM(part)) for part in rows))

    def plain(z: Any) -> Array:
        """x (n, K) of the solver's unknowns, all about one in size; joint by joint."""
        z = np.array(z, dtype=float).reshape(n, K)
        x = z * scale[:, None]
        x[:, 0] = bounds.middle + z[:, 0] * bounds.half
        return x

    factor = np.hstack([bounds.half[:, None], np.tile(scale[:, None], (1, K - 1))])
    memo: list[Any] = [None, None]  # the slope is asked for after the value, where a step is taken

    def both(z: Any) -> tuple[float, Callable[[], Array]]:
        x = plain(z)
        if memo[0] is None or not np.array_equal(memo[0], x):
            memo[:] = [x, objective(x)]
        return memo[1]

    value = external("value", n * K, 1, lambda z: both(z)[0], lambda z: both(z)[1]() * factor)
    z = ca.MX.sym("z", n * K)
    g, low, high = [linear @ z], [-np.ones(linear.shape[0])], [np.ones(linear.shape[0])]
    kept = [value]
    if holding.limited:
        torque = _torque(holding, basis, plain, factor)
        kept.append(torque)
        g.append(torque(z))
        low.append(-np.full(torque.shape[0], MARGIN))
        high.append(np.full(torque.shape[0], MARGIN))
    if holding.obstacles:
        clear = _clearance(holding, basis, plain, factor)
        kept.append(clear)
        g.append(clear(z))
        low.append(np.zeros(clear.shape[0]))
        high.append(np.full(clear.shape[0], np.inf))
    steps = Steps(n * K, sum(len(part) for part in low), stop)
    options: dict[str, Any] = {
        "ipopt.hessian_approximation": "limited-memory",
        "ipopt.limited_memory_max_history": 6,
        "ipopt.limited_memory_aug_solver": "extended",  # one solve of the large system for each of its pairs
        "ipopt.max_iter": iterations,
        "ipopt.tol": 1e-4,
        "ipopt.acceptable_tol": 1e-3,
        "ipopt.acceptable_iter": 8,
        "ipopt.mu_strategy": "adaptive",
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "print_time": False,
        "iteration_callback": steps.function,
        "error_on_fail": False,
    }
    problem: Any = {"x": z, "f": value(z), "g": ca.vertcat(*g)}
    near: dict[str, Any] = {"ipopt.mu_strategy": "monotone", "ipopt.mu_init": 1e-4, "ipopt.max_iter": AGAIN}
    near |= dict.fromkeys(("ipopt.bound_push", "ipopt.slack_bound_push"), 1e-6)
    solvers = [ca.nlpsol("excite", "ipopt", problem, {**options, **its}) for its in ({}, near)]
    bound = np.full((n, K), np.inf)
    bound[:, 0] = 1.0
    lbz, ubz = -bound, bound.copy()
    if start is not None:
        lbz[:, 0] = ubz[:, 0] = (start - bounds.middle) / bounds.half

    def solve(x0: Array, progress: Callable[[float], None], used: float) -> Array:
        lbg, ubg = np.concatenate(low), np.concatenate(high)
        if used > 1:
            at = linear.shape[0]
            lbg[at:], ubg[at:] = np.where(lbg[at:] < 0, lbg[at:] / used, used - 1), ubg[at:] / used
        steps.begin(progress, iterations, lbg, ubg)
        z0 = np.hstack([((x0[:, 0] - bounds.middle) / bounds.half)[:, None], x0[:, 1:] / scale[:, None]])
        found = solvers[used > 1](x0=z0.ravel(), lbx=lbz.ravel(), ubx=ubz.ravel(), lbg=lbg, ubg=ubg)
        del kept[3:]  # what CasADi calls must live as long as the solver
        return plain(found["x"] if steps.best is None else steps.best)

    return solve


def _times(holding: Holding, basis: Basis, start: Array | None) -> int:
    """How much finer a grid holds positions: so that a fixed start is inside its tighter limits."""
    if start is None:
        return 1
    share, times = float(np.max(np.abs(start - holding.bounds.middle) / holding.bounds.half)), 1
    while not share < basis.tighter(times) and times < FINEST:
        times += 1
    return times


def _torque(holding: Holding, basis: Basis, plain: Callable[[Any], Array], factor: Array) -> Any:
    """Motor torques without dry friction on the grid, as shares of what they may reach."""
    import casadi as ca

    model, B = holding.model, basis.at(basis.grid)[:3]
    assert model is not None
    n, N = model.n, B.shape[1]
    states = [ca.SX.sym(name, n) for name in ("q", "dq", "ddq")]
    zero = np.zeros((N, n))
    tau = model.casadi("torque")(*states, _without_dry(holding))
    slope = ca.Function("slope", states, [ca.densify(ca.jacobian(tau, ca.vertcat(*states)))]).map(N)
    share = holding.smooth[:, None, None]

    def values(z: Any) -> Array:
        q, dq, ddq = (b @ plain(z).T for b in B)
        return model.torque(q, dq, ddq, holding.chi, sign=zero) / holding.smooth

    def slopes(z: Any) -> Array:
        J = np.array(slope(*((b @ plain(z).T).T for b in B)))
        J = J.reshape(n, N, 3, n)  # torque, instant, derivative, joint
        return np.einsum("aids,dik->iask", J, B) / share * factor

    return external("torque", factor.size, N * n, values, slopes)


def _clearance(holding: Holding, basis: Basis, plain: Callable[[Any], Array], factor: Array) -> Any:
    """Metres to boxes and between capsules at the grid's instants, over NEAR."""
    M = FINER * len(basis.grid)
    robot, B = holding.robot, basis.at(np.arange(M) * basis.period / M)[0]
    assert robot is not None
    memo: list[Any] = [None, None]

    def both(z: Any) -> tuple[Array, Array]:
        x = plain(z)
        if memo[0] is None or not np.array_equal(memo[0], x):
            f = frames(robot, B @ x.T)
            parts = [its.smooth(f) for its in holding.obstacles]
            value, slope = (np.concatenate([part[k] for part in parts], axis=1) for k in (0, 1))
            rows = np.einsum("imj,ik->imjk", slope, B) / NEAR * factor
            memo[:] = [x, (value / NEAR, rows)]
        return memo[1]

    count = both(np.zeros(factor.size))[0].size
    return external("clearance", factor.size, count, lambda z: both(z)[0], lambda z: both(z)[1])


def _without_dry(holding: Holding) -> Array:
    """chi without what goes with the sign of a rate."""
    model = holding.model
    assert model is not None
    one = np.full((model.n, model.n), 0.3)
    both = [model.regressor(one, one, one, sign=s * np.eye(model.n)) for s in (1, -1)]
    return np.where(np.abs(both[0] - both[1]).max(axis=(0, 1)) > 1e-9, 0.0, holding.chi)
