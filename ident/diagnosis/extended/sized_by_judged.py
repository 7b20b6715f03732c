"""What is said of effects whose size no fitted row shows (by_rows_that_judge.py)."""

from __future__ import annotations

from ident.diagnosis.evidence.state import State, shown
from ident.diagnosis.extended.last_fit import is_told
from ident.estimation.fit import FitResult


def sized_by_judged(state: State, last: FitResult) -> list[str]:
    """A note for each effect that is told at a size which fitted rows alone do not show."""
    labels, out = state.problem.robot.joint_labels, []
    for f in state.found:
        if f.term is None or shown(state.rows, f.columns) or not is_told(last, f.term):
            continue
        joint = f.term.place.joint
        of = "" if joint is None else f" of joint {labels[joint]}"
        out.append(
            f"the size of {f.term.effect.name.replace('_', ' ')}{of} in {f.term.place.recording} is told by "
            "the runs that judge as well: their error with it is no prediction, that of a test run is"
        )
    return out
