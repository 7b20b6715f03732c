"""What no hypothesis explains: torques that have nothing to do with the model, or runs with other runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.hypothesis import NOTHING, Asked
from ident.examination.quick import FLOOR, Assignment, Normal, Sample, added, solve
from ident.examination.stretches import ByItself

UNLIKE = 0.3  # error of a channel from which another robot's is thought of
HALF = 0.5  # of what any other recording leaves when it is left out: that one is the odd one
ODD, TIMES = 0.12, 3.0  # error of a channel that is odd: at least, and against what it is elsewhere
PARTLY, PARTLY_TIMES = 0.5, 6.0  # error of a channel, and against the others', from which it is said


def _unrelated(names: tuple[str, ...], message: str, remedy: str) -> Check:
    return Check("unrelated_torque", names, message, remedy)


def unexplained(asked: Asked) -> Iterator[Check]:
    """Channels, or all of them, of which the model explains nothing; validate runs that nothing predicts."""
    quick, fit = asked.quick, asked.fit
    seen = np.flatnonzero(np.isfinite(fit.error))
    if not len(seen):
        return
    error = fit.error[seen]
    empty = [int(c) for c in seen if fit.error[c] > NOTHING]
    everything = asked.names(range(len(quick.columns.channels)))
    nothing = np.median(error) > 0.6 and error.min() > UNLIKE and len(seen) > 1
    if nothing or (len(seen) == 1 and error[0] > NOTHING):
        yield Check(
            "wrong_robot",
            everything,
            f"the model explains little of these torques (errors of {100 * error.min():.0f} to "
            f"{100 * error.max():.0f} % of each): another robot's or another run's signals, or a wrong "
            "robot file",
            "check the robot, and that positions and torques belong to one run",
        )
        return
    if empty and len(seen) > 1:
        names = asked.names(empty)
        yield _unrelated(
            names,
            f"the model explains nothing of {listed(names)}: noise, another signal, a sign that "
            "changes on the way, or a joint that carries next to no torque",
            f"check the columns, or leave them out with {asked.left_out(empty)}",
        )
    usual = float(np.median(error))
    some = [
        int(c)
        for c in seen
        if c not in empty
        and fit.error[c] > max(PARTLY, PARTLY_TIMES * usual)
        and (fit.validate is None or not fit.validate[c] < PARTLY)
    ]
    if some and len(seen) > 2:
        names = asked.names(some)
        yield _unrelated(
            names,
            f"the model explains only a part of {listed(names)} (errors of "
            f"{listed(f'{100 * fit.error[c]:.0f} %' for c in some)}, the other torques about "
            f"{100 * usual:.0f} %): noise, another signal for a while, a magnitude without its sign, or "
            "something large that the model lacks",
            f"look at its plot, or leave it out with {asked.left_out(some)}",
        )
    if fit.validate is not None and np.isfinite(fit.validate).any():
        held = fit.validate[np.isfinite(fit.validate)]
        if np.median(held) > max(1.0, 3 * float(np.median(error))):
            yield _contradiction(asked, everything, float(np.median(error)), float(np.median(held)))


def odd_beside(error: np.ndarray, own: np.ndarray) -> np.ndarray:
    """(C,) bool: torques of which one robot for all leaves far more, error (C,), than one for each, own."""
    return np.asarray(error > np.fmax(ODD, TIMES * own))


def contradicting(asked: Asked) -> Iterator[Check]:
    """Torques that are explained, and predicted, each by itself and not together, by none of the faults that
    are asked. (A KR 300's without friction in the model are explained by themselves, and not predicted.)"""
    own, error = asked.alone, asked.fit.error
    odd = [c for c in asked.seen if odd_beside(error, own)[c]]
    if odd and asked.fit.validate is not None and asked.quick.validate is not None:
        held = ByItself.by(asked.quick, asked.how).errors(asked.quick.validate)
        odd = [c for c in odd if odd_beside(asked.fit.validate, held)[c]]
    if not odd:
        return
    names = asked.names(odd)
    have, its = ("have", "they are") if len(odd) > 1 else ("has", "it is")
    before, after = (listed(f"{100 * x:.0f} %" for x in each[odd]) for each in (own, error))
    yield _unrelated(
        names,
        f"{listed(names)} {have} something that the other torques contradict: by itself {its} explained to "
        f"{before}, with one robot for all to {after}. A signal (its sign, unit, place, zero or time), the "
        "robot file or something that acts on it (a load, a contact) is not as it is told, and no check "
        "tells which",
        "check the columns of all joints and the robot file",
    )


def _contradiction(asked: Asked, names: tuple[str, ...], error: float, held: float) -> Check:
    """The fitted recordings do not predict the judged ones. Which is the odd one, only a third one tells."""
    samples = asked.quick.samples
    odd = odd_one(samples, asked.how)
    others = "another robot, load, sign or unit"
    said = f"what identify explains ({100 * error:.0f} % error) does not predict validate at all "
    said += f"({100 * held:.0f} %)"
    remedy = "check that these recordings are of the same robot in the same state"
    if odd is not None and odd.role == "identify":
        said += (
            f"; without this recording all others agree: {others} here, a contact or a signal that changes"
        )
        return Check("wrong_robot", names, said, f"{remedy}, or leave this one out", recording=odd.label)
    by_role = [[s.label for s in samples if s.role == role] for role in ("identify", "validate")]
    if odd is not None and len(by_role[1]) == 1:
        said += f": {others} there, or motions that have nothing in common"
        return Check("wrong_robot", names, said, remedy, recording=odd.label)
    said += f": {others} in one of {listed(by_role[0])} and {listed(by_role[1])} or in all, these do not "
    return Check("wrong_robot", names, f"{said}tell, or motions that have nothing in common", remedy)


def odd_one(
    samples: Sequence[Sample], how: Assignment, channels: Sequence[int] | None = None
) -> Sample | None:
    """The recording without which all others are fitted together with half of what is left without any other,
    in the geometric mean of the channels; None where there is none, or where two contradict each other and
    there is no third."""
    known = [(s, Normal.of(s)) for s in samples]
    if len(known) < 3:
        return None
    left = []
    for k in range(len(known)):
        rest = added([normal for i, (_, normal) in enumerate(known) if i != k])
        error = solve(rest, None, how).error
        error = error if channels is None else error[list(channels)]
        seen = error[np.isfinite(error)]
        left.append(float(np.exp(np.mean(np.log(np.fmax(seen, FLOOR))))) if len(seen) else np.inf)
    best = int(np.argmin(left))
    return known[best][0] if left[best] < HALF * min(left[:best] + left[best + 1 :]) else None
