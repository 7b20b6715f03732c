"""A torque that does not keep its zero: a drive that warms up, is reset, or zeroed anew in each recording.

Its zero may then go on straight lines between knots, so far apart that all joints go to and fro between two:
what a spring, a cable or a load adds comes back with positions, and no such line follows it. Half of the
stretches are fitted, the others, which lie between them, say whether it is so.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ident.examination.check import Check, instead
from ident.examination.fits.halves import by_halves
from ident.examination.fits.hypothesis import SAME, Asked
from ident.examination.fits.quick import CLUSTERS, Assignment, Quick
from ident.examination.fits.samples import Sample
from ident.examination.fits.stretches import all_rows
from ident.examination.fits.unexplained import by_each_recording
from ident.examination.rivals.rivals import rivals, unit_of
from ident.examination.tables.signals import MOVED
from ident.examination.torques.believed import FALLEN

MOST = 8  # lines in a recording
LEFT = 0.05  # of a torque, below which nobody asks why (of a clean arm's random walk, 1 % of it, it was told)


@dataclass(frozen=True, slots=True)
class Wandering:
    """Recordings with such zeros of a torque behind the model's columns, `lines` of each."""

    quick: Quick
    lines: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, whole: Quick, c: int, lines: tuple[np.ndarray, ...]) -> Wandering:
        ends = np.cumsum([0, *(x.shape[1] for x in lines)])
        samples = []
        for s, its, at in zip(whole.samples, lines, ends):
            more = np.zeros((*s.W.shape[:2], ends[-1]))
            more[c, :, at : at + its.shape[1]] = its
            samples.append(s.beside(more))
        return cls(whole.of(samples), lines)

    def apart(self, chi: np.ndarray) -> float:
        """N m by which the zeros of all recordings are apart at most."""
        return float(np.ptp(chi[len(chi) - sum(x.shape[1] for x in self.lines) :]))

    def size(self, chi: np.ndarray) -> float:
        """N m by which the zero wanders within a recording at most."""
        ends = np.cumsum([0, *(x.shape[1] for x in self.lines)])
        zeros = np.split(chi[len(chi) - ends[-1] :], ends[1:-1])
        return max(float(np.ptp(x)) for x in zeros if len(x))


def _lines(s: Sample) -> np.ndarray:
    """(N, knots) of a recording, none where no joint comes back."""
    lines = _returns(s)
    knots = np.linspace(s.t[0], s.t[-1], lines + 1)
    each = [np.interp(s.t, knots, hat) for hat in np.eye(lines + 1)]
    return np.stack(each, axis=1)[:, : lines and lines + 1]


def _returns(s: Sample) -> int:
    """How often all joints that move go from one end of their range to the other and back."""
    reach = np.ptp(s.q, axis=0)
    travel = (np.abs(s.dq[:-1]) * np.diff(s.t)[:, None]).sum(axis=0)
    return int(np.min((travel / (2 * np.maximum(reach, MOVED)))[reach > MOVED], initial=MOST))


def _zeros(s: Sample) -> np.ndarray:
    """(N, 1): one zero of a recording."""
    return np.ones((len(s.t), 1))


def wandering(asked: Asked) -> Iterator[Check]:
    """Of each torque whose zero, so moved, leaves clearly less of what did not fit it. (Of a UR10e whose
    first current jumps half way 25 % were left for 8, and nothing was said. Of eleven robots as they are it
    takes off a tenth at most; of six seconds of a KR 300, whose joints do not come back, half.) Fits of each
    recording have to leave more: else these are apart. (Of an AIRBOT with 5 kg in one of them two were told.)
    A zero of each recording is asked first. (Of an AIRBOT whose torques had lost their averages, recording by
    recording, the third was said to drift within them, by a twentieth of what these are apart.)
    """
    whole, how = all_rows(asked.quick), asked.how
    before, lines = whole.fit(how).error, tuple(map(_lines, whole.samples))
    zeros = tuple(map(_zeros, whole.samples)) if len(whole.samples) > 2 else ()
    each = by_each_recording(whole, how)
    for c in (c for c in asked.seen if before[c] > LEFT):
        apart = _moving(whole, how, c, zeros, before[c], SAME * each[c])
        its = apart or _moving(whole, how, c, lines, before[c], each[c])
        if its is None:
            continue
        fit, name = its.quick.fit(how), asked.name(c)
        near = [
            r for r in rivals(whole, how, asked.currents) if r.explained.fit.error[c] < SAME * fit.error[c]
        ]
        if apart and any(r.zero for r in near):
            continue  # of one recording alone, as it is told elsewhere
        left = {r.words: float(r.explained.fit.error[c]) for r in near}
        told = sorted(left, key=lambda words: left[words])
        where = f", as where {told[0]}{instead(told[1:])}" if told else ""
        fallen = f"its error falls from {100 * before[c]:.0f} to {100 * fit.error[c]:.0f} %{where}"
        if apart:
            yield Check(
                "torque_zero",
                (name,),
                f"{name} has another zero in each recording: with those, up to {its.apart(fit.chi):.2g} "
                f"{unit_of(whole, c)} apart, {fallen}: a sensor or a drive that was zeroed anew, averages "
                "that were taken off, or in some of them a load, a contact or another zero of a joint",
                "look at its plots, and give recordings a columns: of their own with its offset",
            )
            continue
        yield Check(
            "torque_zero",
            (name,),
            f"{name} does not keep its zero: where that may drift within a recording, by up to "
            f"{its.size(fit.chi):.2g} {unit_of(whole, c)}, {fallen}: "
            "a sensor or a drive that warms up or is reset, or for a time a load, a contact or another zero",
            "look at its plot, or use a part of the recording with from: and to:",
        )


def _moving(
    whole: Quick, how: Assignment, c: int, lines: tuple[np.ndarray, ...], before: float, least: float
) -> Wandering | None:
    """Recordings with these zeros of torque c, where all along they leave clearly less of it than before, and
    less than `least`."""
    if not any(x.shape[1] for x in lines):
        return None
    its = Wandering.of(whole, c, lines)
    if not its.quick.fit(how).error[c] < min(
        FALLEN * before, least
    ):  # as most: halves cost four times as much
        return None
    held = [gain for _, gain in by_halves(whole, how, its.quick, how, CLUSTERS, c)]
    known = min(held) > 0 and np.mean(held) >= -np.log(FALLEN)  # half of the rows knows a robot worse
    return its if known else None
