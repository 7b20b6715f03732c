"""Shapes and signs that physics does not allow an effect to have: then it only describes something else."""

import numpy as np

from ident.diagnosis.state import Found
from ident.diagnosis.terms import Context, Term

FEWEST_WAVES = 1.5  # of a ripple within the joint's range; fewer are a spring or a bend, not a ripple
LEAST_BRISTLE = 0.2  # of the dry friction
NARROWEST_STRIBECK = 0.018  # of the largest rate
NAMED_TRAVEL = 4e-4  # rad; a shorter presliding is how any sign turns over (friction_sign)


def implausible(f: Found, context: Context) -> bool:
    """A found term that physics forbids, or whose shape says that it stands for something else."""
    return (
        not physical(f)
        or at_bound(f.term)
        or is_turn_over(f.term, context)
        or is_bend(f.term, context)
        or leaves_no_friction(f.term, context)
        or is_residue(f, context)
    )


def physical(f: Found) -> bool:
    """Coefficients have the signs that physics allows."""
    if f.term is None:
        return True
    signs = {q.name: q.sign for q in f.term.effect.linear}
    return not any(signs.get(n) == "positive" and a < 0 for n, a in zip(f.term.terms, f.coefficients))


def at_bound(term: Term | None) -> bool:
    """A nonlinear parameter at the end of its range: the shape is not this effect's."""
    if term is None:
        return False
    theta = term.effect.complete(term.theta)
    if term.effect.name == "hysteresis" and theta["width"] < 1.2 * NAMED_TRAVEL:
        return True
    for p in term.effect.nonlinear:
        if p.name == "travel" or p not in term.free:
            continue
        span = p.high - p.low
        if min(theta[p.name] - p.low, p.high - theta[p.name]) < 1e-3 * min(span, abs(theta[p.name]) + p.low):
            return True
    return False


def is_residue(f: Found, context: Context) -> bool:
    """A hysteresis of a small part of the dry friction: how the rest turns over is not quite right."""
    if f.term is None or f.term.effect.name != "hysteresis" or f.term.joint is None:
        return False
    number = context.view.number(("Fcm", "Fcl"), f.term.joint)
    return number is not None and float(f.coefficients[0]) < LEAST_BRISTLE * float(context.chi[number])


def is_turn_over(term: Term | None, context: Context) -> bool:
    """A Stribeck curve so narrow that it only describes how the sign turns over."""
    if term is None or term.effect.name != "stribeck_friction" or term.joint is None:
        return False
    top = float(np.abs(context.rows.fine.dq[:, term.joint]).max())
    return term.theta["vs"] < NARROWEST_STRIBECK * top


def is_bend(term: Term | None, context: Context) -> bool:
    """A ripple so slow that the joint's range holds hardly a wave of it."""
    if term is None or term.effect.name != "torque_ripple" or term.joint is None:
        return False
    waves = term.theta["wavenumber"] * float(np.ptp(context.rows.fine.q[:, term.joint])) / (2 * np.pi)
    return waves < FEWEST_WAVES


def leaves_no_friction(term: Term | None, context: Context) -> bool:
    """A warm-up that ends at a negative viscous friction: a slow change of another kind."""
    if term is None or term.effect.name != "thermal_friction" or term.joint is None:
        return False
    number = context.view.number(("Fvm", "Fvl"), term.joint)
    return number is not None and float(context.chi[number]) < 0.0
