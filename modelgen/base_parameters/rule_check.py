"""Exact check of regrouping rules: W_st chi_st = W chi at fresh rational states.

Points of the unit circle can be rational, c = (1 - t^2)/(1 + t^2) and s = 2t/(1 + t^2), and so can rates and
accelerations; the Newton-Euler recursion then gives W_st in the field of the robot's geometry, named lengths
included, and the check is == 0. Where the geometry has irrational numbers (a twist of pi/3, or of 0.3) it is
evaluated with 100 digits instead and must cancel to 60. Either way it is independent of how the rules were
found (energies, in `regrouping`).
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

from sympy.polys.domains import QQ

from modelgen.base_parameters.regrouping import exact_geometry
from modelgen.base_parameters.rules import Rules
from modelgen.dynamics.models import standard_regressor
from modelgen.exact.numbers import CANCELLED, MP, digits
from modelgen.geometry.kinematics import Number, State
from modelgen.geometry.robot import Robot


def exact_cos_sin(t: Number) -> tuple[Number, Number]:
    """A rational point of the unit circle."""
    return (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)


def rational_state(robot: Robot, seed: int, lift: Callable[[Number], Number] = lambda x: x) -> State:
    """A random state whose numbers are all rational; `lift` converts them."""
    rng = random.Random(seed)

    def number() -> Number:
        return QQ(rng.choice((-1, 1)) * rng.randint(1, 30), rng.randint(1, 7))

    c, s = zip(*(exact_cos_sin(number()) for _ in range(robot.n)), strict=True)
    q, dq, ddq = ([number() for _ in range(robot.n)] for _ in range(3))
    return State(*([lift(x) for x in numbers] for numbers in (c, s, q, dq, ddq)))


def broken_columns(rules: Rules, seed: int = 0, states: int = 2) -> tuple[str, ...]:
    """Standard parameters whose column is not what the rules claim; () if all are right.

    For all chi_st, W_st chi_st = W chi exactly when every column agrees.
    """
    geometry, exact = exact_geometry(rules.robot)
    lift: Callable[[Number], Number] = digits if exact.irrational else lambda x: x
    geometry = geometry.mapped(lift)
    claims = {
        p.name: {kept: lift(exact.number(c)) for kept, c in rules.columns[p.name].items()}
        for p in rules.standard
    }
    broken = []
    for k in range(states):
        state = rational_state(rules.robot, seed + k, lift)
        sign = [1 if rate > 0 else -1 for rate in state.dq]
        W = standard_regressor(rules.robot, geometry, rules.model, state, sign, rules.standard)
        largest = max(abs(x) for column in W.values() for x in column) if exact.irrational else 0
        for name, combination in claims.items():
            terms = [W[name], *([-c * x for x in W[kept]] for kept, c in combination.items())]
            if not all(_cancel(row, largest) for row in zip(*terms, strict=True)):
                broken.append(name)
    return tuple(dict.fromkeys(broken))


def _cancel(terms: Sequence[Number], largest: Number) -> bool:
    total = sum(terms)
    return abs(total) <= CANCELLED * largest if isinstance(total, MP.mpf) else not total
