"""Two effects that are one: the identity that says so, shown symbolically."""

from __future__ import annotations

import numpy as np
import sympy as sp

from ident.equations.terms import Term, plain
from modelgen.effects.effect import SIGNALS


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
