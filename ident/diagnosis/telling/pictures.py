"""What gave a finding away: the residual without it against the signal that it follows, and the finding's
own torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ident.diagnosis.evidence.state import State
from ident.diagnosis.rows.terms import Term

POINTS = 1500


@dataclass(frozen=True, slots=True)
class Picture:
    """x, before, effect (k,): signal, torque that the model without the effect leaves, torque of the
    effect."""

    channel: str
    against: str
    unit: str
    x: np.ndarray = field(repr=False)
    before: np.ndarray = field(repr=False)
    effect: np.ndarray = field(repr=False)


def picture(state: State, term: Term | None, c: int, variables: Sequence[str] = ()) -> Picture | None:
    """Rows of all recordings that it acts in, thinned evenly."""
    found = next(
        (
            f
            for f in state.found
            if (f.term is term if term is not None else f.term is None and f.variables == tuple(variables))
        ),
        None,
    )
    joint = state.model.channels[c].joint
    labels = state.problem.robot.joint_labels
    own = np.zeros(len(state.rows.t))
    if found is not None and c in found.columns:
        own = found.columns[c] @ found.sizes[: found.columns[c].shape[1]]
    elif term is not None:
        return None
    name, unit, x = _signal(state, term, joint, labels[joint], variables)
    seen = state.rows.use[c]
    if term is not None and term.place.recording is not None:
        seen = seen & (state.rows.recording == state.rows.names.index(term.place.recording))
    on = np.flatnonzero(seen)
    pick = on[:: max(1, len(on) // POINTS)]
    before = state.residual[c] + own
    return Picture(state.model.channels[c].name(labels), name, unit, x[pick], before[pick], own[pick])


def _signal(
    state: State, term: Term | None, joint: int, label: str, variables: Sequence[str]
) -> tuple[str, str, np.ndarray]:
    """The signal that tells most: rate, position, load or time."""
    needs = term.effect.needs if term is not None else set()
    kinds = {name.rstrip("0123456789") for name in variables}
    prismatic = state.problem.robot.link(state.problem.robot.moving[joint]).sigma == 1
    unit = "m" if prismatic else "rad"
    moved = term is not None and term.place.joint is None
    if moved or "t" in needs or kinds == {"t"}:
        return "t", "s", state.rows.t
    if {"dq", "sign_dq"} & set(needs) or "dq" in kinds:
        return f"dq{label}", f"{unit}/s", _at_rows(state, lambda s: s.dq[:, joint])
    if "q" in needs or "q" in kinds:
        return f"q{label}", unit, _at_rows(state, lambda s: s.q[:, joint])
    if "ddq" in needs:
        return f"ddq{label}", f"{unit}/s^2", _at_rows(state, lambda s: s.ddq[:, joint])
    return "t", "s", state.rows.t


def _at_rows(state: State, of: object) -> np.ndarray:
    parts = [of(s)[s.every - 1 :: s.every][: s.rows] for s in state.segments]  # type: ignore[operator]
    return np.concatenate(parts)
