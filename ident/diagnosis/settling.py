"""How friction turns over is settled anew beside what was found; a torque that comes late needs care."""

from ident.diagnosis.state import State, objective, refine, refit, resettle, sharpen

MOST_SETTLINGS = 10  # a delay and the turn-over of the signs take turns until both stand still
LATE = ("time_delay",)


def resettle_fully(state: State) -> State:
    """The state with its friction signs chosen again until they and what was found stand still.

    Where a torque comes late, a second attempt starts from friction that turns over at once: the delay and
    the turn-over swallow each other's part, and taking turns alone ends half-way.
    """
    settled = _taking_turns(state)
    view = state.context.view
    late = {view.joint_of[c] for t in state.terms if t.effect.name in LATE for c in t.channels}
    if late:
        other = _taking_turns(sharpen(state, sorted(late)))
        settled = min((settled, other), key=objective)
    return refine(settled) if settled.bank is not state.bank else settled


def _taking_turns(state: State) -> State:
    settled = state
    delayed = any(t.effect.name in LATE for t in state.terms)
    for _ in range(MOST_SETTLINGS):
        current = refit(settled, list(settled.found)) if delayed else settled
        settled = resettle(current)
        if settled is current:
            break
    return settled
