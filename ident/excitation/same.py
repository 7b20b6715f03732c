"""What one effect does another one does too, in any motion: shown symbolically.

An effect's torques lie in the span of its columns and of those that the model has of its joint already: 1,
dq, ddq, sign dq. Where every column of one lies in the span of the other's, as an identity in the signals and
in the shape parameters that both have, no motion tells them apart that way round. The same holds in the limit
of a shape parameter that only the other has, as of a time constant far beyond any recording.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import sympy as sp

from ident.equations.terms import Term
from modelgen.effects.effect import SIGNALS as S
from modelgen.effects.effect import Effect

POINTS = 80  # at which coefficients are read, before the identity is shown
Numbers = Mapping[sp.Symbol, sp.Rational]


def proof(a: Term, b: Term) -> str | None:
    """The identity by which b does what a does; None where none was found.

    Looked for with rational coefficients and whatever the values of shape parameters that both have, else at
    the values that they have here."""
    if not _comparable(a, b):
        return None
    if a.effect.state and dict(a.effect.updates) != dict(b.effect.updates):
        return None  # their states are not one
    shared = set(a.theta) & set(b.theta)
    if all(b.bounds[name][0] <= a.theta[name] <= b.bounds[name][1] for name in shared if name in b.bounds):
        found = _identity(a, b, {}, _numbers({n: v for n, v in b.theta.items() if n not in shared}))
        if found is not None:
            return found
    return _identity(a, b, _numbers(a.theta), _numbers(b.theta))


def proof_in_limit(a: Term, b: Term) -> str | None:
    """The identity by which b does what a does once a shape parameter that a lacks is large; None where none
    was found. How near its bounds let b come to it is not said here."""
    if not _comparable(a, b) or a.effect.state or b.effect.state:
        return None
    own = [name for name in b.free if name not in a.theta and np.isfinite(b.bounds[name][1])]
    rest = _numbers({n: v for n, v in b.theta.items() if n not in a.theta})
    for name in own:
        x = sp.Symbol(name, real=True)
        others = {symbol: value for symbol, value in rest.items() if symbol != x}
        far = {n: _limit(b.effect.terms[n].subs(others), x, b.bounds[name][1]) for n in b.linear}
        if any(e is None for e in far.values()):
            continue
        found = _identity(a, b, {}, others, {n: e for n, e in far.items() if e is not None})
        if found is not None:
            return f"{found} where {name} is large"
    return None


def _comparable(a: Term, b: Term) -> bool:
    """Whether the torques of both are their terms, in the same signals, of which the load may be one."""
    where = [(t.place.joint, t.place.source, t.place.side) for t in (a, b)]
    return all(type(t.effect).columns is Effect.columns for t in (a, b)) and where[0] == where[1]


def _limit(term: sp.Expr, x: sp.Symbol, bound: float) -> sp.Expr | None:
    """A term's limit at large x, None where it grows, vanishes or none is found."""
    if x not in term.free_symbols:
        return term
    y = sp.Symbol(f"{x}_inverse", real=True)
    with np.errstate(all="ignore"):
        inverse = sp.powsimp(term.subs(x, 1 / y))
        end = inverse.subs(y, 0)
    if end.is_zero or end.has(sp.nan, sp.zoo, sp.oo, sp.Abs(y)):
        return None
    return end


def _numbers(theta: Mapping[str, float]) -> Numbers:
    return {sp.Symbol(name, real=True): sp.Rational(repr(round(v, 9))) for name, v in theta.items()}


def _identity(
    a: Term, b: Term, of_a: Numbers, of_b: Numbers, terms: Mapping[str, sp.Expr] | None = None
) -> str | None:
    """`terms`: limits of b's own, which are written."""
    model = [sp.Integer(1), S.dq, S.ddq, S.sign_dq]
    written, theirs = (
        [its[name].subs(of_b) for name in b.linear] + model
        for its in (b.effect.terms, terms or b.effect.terms)
    )
    told = []
    for name in a.linear:
        mine = a.effect.terms[name].subs(of_a)
        symbols = sorted(set().union(*(e.free_symbols for e in [mine, *theirs])) | {S.dq, S.sign_dq}, key=str)
        rng = np.random.default_rng(3)
        drawn = {s: rng.uniform(-2, 2, POINTS) if s in SIGNALS else np.full(POINTS, 1.37) for s in symbols}
        drawn[S.sign_dq] = np.sign(drawn[S.dq])
        at = [drawn[s] for s in symbols]
        y, *columns = (np.broadcast_to(sp.lambdify(symbols, e)(*at), POINTS) for e in [mine, *theirs])
        if not np.isfinite([y, *columns]).all():
            return None
        span = np.stack(columns, 1)
        weights = np.linalg.lstsq(span, y, rcond=1e-10)[0]
        if np.abs(span @ weights - y).max() > 1e-7 * np.abs(y).max(initial=0.0):
            return None  # no need to ask what is slow to answer
        shares = [sp.nsimplify(round(w, 7), rational=True) for w in weights]
        same, shown = (sum((w * e for w, e in zip(shares, its)), sp.Integer(0)) for its in (theirs, written))
        both = (mine - same).subs(sp.Abs(S.dq), S.dq * S.sign_dq)
        if sp.simplify(sp.expand(both).subs(S.sign_dq**2, 1)) != 0:
            return None
        told.append(_written(mine, shown))
    return "; ".join(told)


def _written(mine: sp.Expr, same: sp.Expr) -> str:
    """An identity in words' length: a sum that stands inside |.| is called x."""
    inside = next((e.args[0] for e in mine.atoms(sp.Abs) if e.args[0].is_Add), None)
    if inside is None:
        return f"{mine} = {same}"
    x = sp.Symbol("x", real=True)
    return f"{mine.subs(inside, x)} = {same.subs(inside, x)} with x = {inside}"


SIGNALS = {value for value in vars(S).values() if isinstance(value, sp.Symbol)}
