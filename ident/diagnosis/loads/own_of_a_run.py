"""What a run's own could be instead of a load on it: parameters of the model, a drive's friction, another
zero of a joint's position, another factor of its torque; columns in the rows of a window alone."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import chain

import numpy as np

from ident.diagnosis.evidence.metric import Columns
from ident.diagnosis.evidence.state import State
from ident.diagnosis.evidence.sufficiency import NEARLY
from ident.diagnosis.rows.terms import Term
from modelgen.effects.place import Place
from modelgen.geometry.names import ParameterName


def own_columns(state: State, inside: np.ndarray, chosen: Iterable[int]) -> dict[int, np.ndarray]:
    """Of the model's parameters those chosen, free in a window (M,)."""
    free = np.sort(list(chosen))
    out = {}
    for c, (places, values) in enumerate(state.rows.base):
        z = np.zeros((len(inside), len(free)))
        mine = np.isin(places, free)
        z[:, np.searchsorted(free, places[mine])] = values[:, mine] * inside[:, None]
        out[c] = z
    return out


def drives_of(state: State) -> list[tuple[int, ...]]:
    """Places of the parameters of each joint's drive among the model's; what is no body's is a drive's."""
    drives: dict[str, tuple[int, ...]] = {}
    for k, name in enumerate(state.problem.columns.parameters):
        parsed = ParameterName.of(name)
        if parsed is None or not parsed.of_body:
            joint = "" if parsed is None else parsed.label
            drives[joint] = (*drives.get(joint, ()), k)
    return list(drives.values())


def own_friction(
    state: State, inside: np.ndarray, says: Callable[[Columns], float]
) -> tuple[dict[int, np.ndarray], float | None]:
    """The drives that foretell most (`says`, nats) where their parameters are the window's own, joint after
    joint, and what they say; none where no drive of its own foretells anything. (All of a rokae's seven at
    once, of three seconds: each half foretold the other worse than with none, and a weight that they stood
    beside, too.)"""
    chosen, told = _first_best(drives_of(state), lambda its: own_columns(state, inside, chain(*its)), says)
    return own_columns(state, inside, [*chain(*chosen)]), told


def _first_best(
    left: Sequence[tuple[int, ...]],
    columns: Callable[[Sequence[tuple[int, ...]]], Columns],
    says: Callable[[Columns], float],
    most: int | None = None,
) -> tuple[list[tuple[int, ...]], float | None]:
    """Of alternatives those that together say most, `most` at most, taken one after the other, the one that
    says most beside those before it first; what they say, None where none says anything."""
    left, told = list(left), None
    chosen: list[tuple[int, ...]] = []
    while left and (most is None or len(chosen) < most):
        nats, its = max((says(columns([*chosen, its])), its) for its in left)
        if nats <= (0.0 if told is None else told):
            break
        told = nats
        chosen.append(its)
        left.remove(its)
    return chosen, told


def zero_columns(state: State, joint: int, place: Place, inside: np.ndarray) -> dict[int, np.ndarray]:
    """{channel: (M, 1)} torque that the model gains per rad (m) of a joint's position, in the rows `inside`
    (M,) of a place's recording; {} where it gains none."""
    parts = []
    for segment, motion in zip(state.segments, state.motions):
        if segment.label != place.recording:
            parts.append(np.zeros((segment.rows, state.rows.channels)))
            continue
        slope = state.model.slopes(motion, joint)[0]
        made = [
            segment.decimate(slope[:, [c]], channel.joint) for c, channel in enumerate(state.model.channels)
        ]
        parts.append(np.hstack(made))
    whole = np.concatenate(parts) * state.rows.scale.T * inside[:, None]
    return {c: whole[:, [c]] for c in range(state.rows.channels) if np.any(whole[:, c])}


def factor_columns(state: State, channels: Iterable[int], inside: np.ndarray) -> dict[int, np.ndarray]:
    """{channel: (M, 1)} torque of channels as the model has it, in the rows `inside` (M,)."""
    return {c: ((state.rows.Y[c] - state.residual[c]) * inside)[:, None] for c in channels}


def one_number(
    state: State, term: Term, inside: np.ndarray
) -> tuple[list[dict[int, np.ndarray]], list[dict[int, np.ndarray]]]:
    """What a run may have of its own by one number in the place of a load: of every joint another zero, but
    for that of one joint, which is such a number itself; of every channel another factor, or of all of them
    one. (Of an AIRBOT's torques, all 20 % too large in one run, a body of 0.13 kg was told on its last
    link.)"""
    zeros: list[dict[int, np.ndarray]] = []
    if term.place.joint is None:
        joints = (zero_columns(state, joint, term.place, inside) for joint in range(state.model.robot.n))
        zeros = [z for z in joints if z]
    every = range(state.rows.channels)
    return zeros, [factor_columns(state, its, inside) for its in (*((c,) for c in every), every)]


def is_zeros(
    inside: np.ndarray, channels: int, most: int, says: Callable[[Columns], float], nats: float, tau: float
) -> bool:
    """Whether torques that count from another zero in the rows `inside` (M,) say as much (`says`, nats) as a
    load of `most` numbers does there, by fewer, or more by as many: taken one after the other, the one that
    says most first. (A hum of 50 Hz in samples of 50 Hz is a constant, another in each run: of a clean arm a
    force of 0.03 N on all of one was told by 218.0 nats, of which two zeros say 218.5.)"""
    every = [(c,) for c in range(channels)]
    chosen, told = _first_best(every, lambda its: _constants(inside, [*chain(*its)]), says, most)
    return told is not None and told > nats + (tau if len(chosen) == most else 0.0)


def _constants(inside: np.ndarray, channels: Sequence[int]) -> dict[int, np.ndarray]:
    """{channel: (M, k)} a constant of each of k channels in some rows (M,)."""
    unit = np.eye(len(channels))
    return {c: inside[:, None] * unit[k] for k, c in enumerate(channels)}


def says_as_much(
    zeros: Sequence[Columns],
    factors: Sequence[Columns],
    says: Callable[[Columns], float],
    nats: float,
    tau: float,
) -> bool:
    """Whether another zero says nearly as much (`says`, nats) as a load does, or another factor more, by more
    than what columns are wrong by (NEARLY). A load on one run is ordinary, a factor of one run is not: where
    these cannot be told apart it is a load. (Of a UR10e's third joint 5 degrees off in one run a body on the
    third link said 107 nats, that joint's zero 169; of 2 kg on that link they say 355 and 15. A weight on an
    LWR4+'s second link says 1540, its torque's factor there 1557; of a TX40's second torque, 15 % too large
    in one run, a body said 98, and the factor 165.)"""
    if max(map(says, zeros), default=-np.inf) > NEARLY * nats - tau:
        return True
    return NEARLY * max(map(says, factors), default=-np.inf) > nats + tau


def numbers(columns: Columns) -> int:
    """How many sizes these columns have."""
    return int(next(iter(columns.values())).shape[1])
