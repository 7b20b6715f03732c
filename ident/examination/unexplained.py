"""What no hypothesis explains: torques that have nothing to do with the model, or runs with other runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.hypothesis import NOTHING, Asked
from ident.examination.quick import Quick

UNLIKE = 0.3  # error of a channel from which another robot's is thought of
PARTLY, PARTLY_TIMES = 0.5, 6.0  # error of a channel, and against the others', from which it is said


def _unrelated(names: tuple[str, ...], message: str, remedy: str) -> Check:
    return Check("unrelated_torque", names, message, remedy)


def _without(quick: Quick, which: Sequence[int]) -> str:
    """The `channels:` line that leaves channels out."""
    return f"channels: [{', '.join(n for c, n in enumerate(quick.columns.channels) if c not in which)}]"


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
            f"check the columns, or leave them out with {_without(quick, empty)}",
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
            f"look at its plot, or leave it out with {_without(quick, some)}",
        )
    if fit.validate is not None and np.isfinite(fit.validate).any():
        held = fit.validate[np.isfinite(fit.validate)]
        if np.median(held) > max(1.0, 3 * float(np.median(error))):
            yield Check(
                "wrong_robot",
                everything,
                f"what identify explains ({100 * np.median(error):.0f} % error) does not predict "
                "validate at all "
                f"({100 * np.median(held):.0f} %): another robot, load, sign or unit there, or motions that "
                "have nothing in "
                "common",
                "check that these recordings are of the same robot in the same state",
                recording=", ".join(s.label for s in quick.samples if s.role == "validate"),
            )
