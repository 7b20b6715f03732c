"""How much of a joint's inertia is its drive's, where the rigid model cannot tell.

On the first joints the drive's inertia is regrouped into the link's (ZZ1R = ZZ1 + Iam1 + ...). A rigid robot
does not need the split, but the torque that the gear passes on does: tau_link = rigid torque - Iam ddq. An
elasticity or a friction that follows tau_link therefore shows it. The split is chosen by the likelihood of
the fitted rows, between no drive inertia and all of it, and only for joints with such a finding.
"""

from dataclasses import replace

import scipy.optimize

from ident.diagnosis.model_view import ModelView
from ident.diagnosis.scoring import Columns
from ident.diagnosis.state import Found, State, objective, refit
from ident.diagnosis.terms import columns

WORTH = 2.0  # log-likelihood that a split must gain
LARGEST = 0.98  # of the joint's inertia


def settle_rotor(state: State) -> State:
    """The state with the drive inertia of every joint chosen whose found terms read tau_link."""
    view = state.context.view
    joints = {t.joint for t in state.terms if t.joint is not None and "tau_link" in t.effect.needs}
    for joint in sorted(joints):
        if regrouped(view, joint):
            state = _settled(state, joint)
    return state


def split_sensitivity(state: State, f: Found) -> Columns:
    """d(contribution)/d(drive inertia) of a found term that reads tau_link; {} where the split is known."""
    term, context = f.term, state.context
    if term is None or term.joint is None or "tau_link" not in term.effect.needs:
        return {}
    number = context.view.number(("ZZ",), term.joint)
    if number is None or not regrouped(context.view, term.joint):
        return {}
    step = 0.02 * abs(float(context.chi[number])) + 1e-9
    rotor = list(context.view.rotor or (0.0,) * context.view.n)
    rotor[term.joint] += step
    load = context.tau_link.copy()
    load[term.joint] -= step * context.rows.fine.ddq[:, term.joint]
    kept = {key: value for key, value in context.cache.items() if key[0] != "passed"}  # follows the split
    view = replace(context.view, rotor=tuple(rotor))
    moved = replace(context, view=view, tau_link=load, cache=kept)
    return {c: ((z - f.columns[c]) @ f.coefficients / step)[:, None] for c, z in columns(term, moved).items()}


def regrouped(view: ModelView, joint: int) -> bool:
    """True where only the motor's torque is measured and its drive inertia stands in a link parameter."""
    label = str(joint + 1)
    return (
        f"tau_m{label}" in view.channels
        and f"tau_l{label}" not in view.channels
        and f"Iam{label}" not in view.model.parameters
        and view.number(("ZZ",), joint) is not None
    )


def _settled(state: State, joint: int) -> State:
    number = state.context.view.number(("ZZ",), joint)
    assert number is not None
    whole = float(state.context.chi[number])
    if whole <= 0.0:
        return state
    best, least = state, objective(state)

    def loss(inertia: float) -> float:
        nonlocal best, least
        trial = _with_rotor(state, joint, inertia)
        value = objective(trial)
        if value < least - WORTH or (best is not state and value < least):
            best, least = trial, value
        return value

    scipy.optimize.minimize_scalar(
        loss, bounds=(0.0, LARGEST * whole), method="bounded", options={"maxiter": 9, "xatol": 0.01 * whole}
    )
    return best


def _with_rotor(state: State, joint: int, inertia: float) -> State:
    view = state.context.view
    rotor = list(view.rotor or (0.0,) * view.n)
    rotor[joint] = inertia
    context = replace(state.context, view=replace(view, rotor=tuple(rotor)))
    return refit(replace(state, context=context), list(state.found))
