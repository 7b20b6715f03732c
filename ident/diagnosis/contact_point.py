"""Where on the last link a contact acts: at the origin of its frame unless the torques say otherwise.

The origin needs no parameter. A point elsewhere has three, which the torques show only as far as the arm
turns while it is pushed; it is taken when the likelihood of the fitted rows is worth it.
"""

from ident.diagnosis.state import Found, State, objective, refine, refit
from ident.diagnosis.terms import columns

WORTH = 10.0  # log-likelihood that three coordinates must gain
STEPS = 4


def settle_contact(state: State) -> State:
    """The state with the point of its last finding, if that is a contact, moved where it fits better."""
    last = state.found[-1]
    if (
        last.term is None
        or last.term.effect.name != "external_force"
        or (last.lent and not state.folds.by_recording)
    ):
        return state
    term = last.term.at(px=0.0, py=0.0, pz=0.0)
    moved = Found(term, columns(term, state.context), last.coefficients)
    trial = refine(refit(state, [*state.found[:-1], moved]), STEPS)
    return trial if objective(trial) < objective(state) - WORTH else state
