"""What a check of signals is before it is one: a hypothesis, with what it explains."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ident.equations.columns import Columns
from ident.examination.check import FEW, Check, column_line, instead, listed, nothing_tells
from ident.examination.fits.quick import FLOOR, Assignment, Fit, Quick, gains_of
from ident.examination.tables.signals import MOVED

CLEARLY = 0.7  # gain: one channel's error is halved
EXPLAINED = 0.5  # error of a torque above which no fault of it is believed: something else is missing
NOTHING = 0.85  # error of a channel that the model does not explain
SWAPPED = 1.4  # gain by other positions
SAME = 1.1  # times an error that is as it was
FIRST = "where it is the first"
WHICH = ", these recordings do not tell which"
BAD, BAD_TOGETHER = 0.3, 0.125  # error of one channel, or of the median one


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What would be different, how much better it fits, and the check that says so. words: the same beside
    another that explains as much; own: the blamed joint's own friction says so, or every torque by itself,
    whatever else is missing; each: of a base or a table, the gain of torques with bodies of their own; ahead:
    no line undoes it, and it explains more than the one that it is told beside."""

    gain: float
    how: Assignment
    check: Check
    quick: Quick | None = None  # with other motions
    words: str = ""
    own: bool = False
    each: float = 0.0
    ahead: bool = False

    def beside(self, others: Sequence[Hypothesis]) -> Hypothesis:
        """With others that these recordings do not tell from it. The line of this one stays the first, so
        that what is asked next can be asked without it, unless one without a line explains more; those of the
        others are YAML's comment. (Of an LWR4+ with half of its fourth torque in the fifth one the fifth
        position, "10 times too large", was undone, and 86 to 100 % of the others had no name.)"""
        message = self.check.message
        said = f", or {message}"  # a position beside its torque, twice
        others = list({its.words: its for its in others if f", or {its.words}" not in said}.values())
        if not others:
            return self
        head = message.split(WHICH)[0]
        end = min((k for k in (head.find(": "), head.find("; ")) if k > 0), default=len(head))
        words = [its.words for its in others]
        if message[:end].count(", or ") + len(words) > FEW:
            fallen = message[end:].removeprefix(WHICH).lstrip(":; ")
            return replace(self, check=nothing_tells([message[:end], *words], fallen, self.check.recording))
        also = instead(words)
        lines = dict.fromkeys(its.check.remedy for its in others if its.check.remedy)
        lines.pop(self.check.remedy, None)
        check = replace(
            self.check,
            message=f"{message[:end]}{also}{WHICH}{message[end:].removeprefix(WHICH)}",
            remedy=(f"{FIRST}, " if any(its.ahead for its in others) else "")
            + self.check.remedy
            + (f"  # or {' or '.join(lines)}, where it is that" if lines else ""),
            open=True,
        )
        return replace(self, check=check)


@dataclass(frozen=True, slots=True)
class Asked:
    """What is asked for faults: recordings, what is undone of their torques already, the fit of both; the
    study's columns, whether it reads currents, N m per unit of what is recorded of a channel (C,), the joints
    whose velocities are logged (they agree with their positions, or the table would be refused), torques
    that are clipped anywhere, and the steps (n,) within which turns of joints that are slow for them are
    hidden."""

    quick: Quick
    how: Assignment
    fit: Fit
    maps: Mapping[str, Any]
    currents: bool
    gains: np.ndarray
    velocities: frozenset[str] = frozenset()
    clipped: frozenset[str] = frozenset()
    hidden: np.ndarray = field(default_factory=lambda: np.zeros(0))
    gravity: tuple[float, float, float] | None = None  # of the study, where it has one

    def of_robot(self, its: Hypothesis) -> bool:
        """Whether it is of the robot (its base, an axis) and leaves torques and motion as they are: no fit of
        these recordings stands behind it."""
        return its.quick is None and its.how == self.how

    def after(self, its: Hypothesis) -> Asked:
        """The same once this one is undone."""
        quick = its.quick or self.quick
        return replace(self, quick=quick, how=its.how, fit=quick.fit(its.how))

    @property
    def alone(self) -> np.ndarray:
        return self.quick.alone(self.how)

    @property
    def seen(self) -> list[int]:
        """Channels of which there are rows."""
        return np.flatnonzero(self.quick.identify.rows > 10).tolist()

    @property
    def joints(self) -> list[str]:
        return [str(joint) for joint in self.quick.columns.need.joints]

    def still(self, signals: Iterable[str], recording: str = "") -> tuple[str, ...]:
        """Those of them that are positions, and stand still in all recordings, or in that one."""
        its = [s for s in self.quick.samples if recording in ("", s.label)]
        reach = np.max([np.ptp(s.q, axis=0) for s in its], axis=0)
        resting = {f"q{joint}" for joint, moved in zip(self.joints, reach) if moved < MOVED}
        return tuple(name for name in signals if name in resting)

    def name(self, c: int) -> str:
        return signal_of(self.quick.columns, c, self.currents)

    def names(self, channels: Iterable[int]) -> tuple[str, ...]:
        return tuple(self.name(c) for c in channels)

    def line(self, changes: Mapping[str, Mapping[str, Any]]) -> str:
        """The study's `columns:` line with these changes; what is done to a position is done to its velocity,
        which would contradict it."""
        twins = {
            f"d{name}": {k: f"d{x}" if k == "of" else x for k, x in change.items() if k != "offset"}
            for name, change in changes.items()
            if name.startswith("q") and {name[1:], change.get("of", name)[1:]} <= self.velocities
        }
        twins = {name: change for name, change in twins.items() if change}
        return column_line(self.maps, {**changes, **twins})

    def left_out(self, channels: Sequence[int]) -> str:
        """The study's `channels:` line without these."""
        names = self.quick.columns.channels
        return f"channels: [{', '.join(name for c, name in enumerate(names) if c not in channels)}]"

    def better(self, other: Fit, least: float) -> bool:
        return other.gain_over(self.fit) > least and other.holds_over(self.fit) > 0.5 * least

    def along(
        self,
        moved: Quick,
        told: Callable[[Fit], Check],
        words: str = "",
        how: Assignment | None = None,
        least: float = SWAPPED,
    ) -> Iterator[Hypothesis]:
        """Other positions, where they explain so much more."""
        taken = how or self.how
        other = moved.fit_beside(self.quick, taken)
        if self.better(other, least):
            yield Hypothesis(other.gain_over(self.fit), taken, told(other), moved, words)


def not_recorded(still: Sequence[str], where: str = " in all recordings") -> Check:
    """Positions that stand still where their joints did not."""
    said, one = listed(still), len(still) == 1
    return Check(
        "dead_channel",
        tuple(still),
        f"{said} {'is' if one else 'are'} not where {'its joint was' if one else 'their joints were'}, and "
        f"{'stands' if one else 'stand'} still{where}: not recorded, or in another column",
        f"map the right column with columns: {{{still[0]}: {{column: ...}}}}",
    )


def signal_of(columns: Columns, c: int, currents: bool) -> str:
    """The study's name of the signal behind a channel."""
    name = columns.channels[c]
    return "i" + name[5:] if currents and name.startswith("tau_m") else name


def bad(fit: Fit) -> bool:
    """Whether a torque is explained so badly, or most are, that positions may be to blame."""
    error = fit.error[np.isfinite(fit.error)]
    return bool(error.max() > BAD or np.median(error) > BAD_TOGETHER)


def explains(before: np.ndarray, after: np.ndarray) -> bool:
    """Whether of torques with these errors some are explained, and all but those that are hardly touched,
    beside how much these are. (The last torque of an LWR4+ is mostly noise; for it no gravity was missed in
    the other six, nor a position told that holds another joint's, by which 1 to 8 % are left of others for 23
    to 60, and of it 55 for 50.)"""
    done = after <= EXPLAINED
    gains = gains_of(before, after)
    touched = np.log(SAME) * max(1.0, float(gains[done].mean())) if done.any() else 0.0
    seen = np.isfinite(after)
    return bool(done.any() and (done | (np.abs(gains) < touched))[seen].all())


def of_several(columns: Columns, before: Fit, after: Fit, joints: Collection[int]) -> bool:
    """Whether the torque of a blamed joint (by its place) itself speaks for another motion of it most, or
    several torques do: those of joints before it feel it, too. (Of an LWR4+ with an axis turned in its table
    joints 5 and 6 were told to be exchanged, and of a clean one the sixth position to start from another
    zero, by the last torque alone, which is hardly any.)"""
    gains = gains_of(before.error, after.error)
    most = int(np.argmax(gains))
    its_own = int(columns.joint_of[most]) in joints
    return not joints or its_own or bool(gains.sum() - gains[most] > 0.5 * CLEARLY)


def falls(before: Fit, after: Fit) -> str:
    """By the mean that decides, of the logarithms. (A spring's torque read in degrees: the mean of squares
    rose, and "the error falls from 19 to 21 %" was said.)"""
    seen = np.isfinite(before.error) & np.isfinite(after.error)
    a, b = (100 * float(np.exp(np.mean(np.log(np.maximum(x.error[seen], FLOOR))))) for x in (before, after))
    told = f"{a:.0f} to {b:.0f}" if round(a) != round(b) else f"{a:.1f} to {b:.1f}"
    return f"the torques' error falls from {told} % (geometric mean)"
