"""A position with another joint's in it: an elbow that is counted from the horizontal, a wrist's drive that
turns with the joint before it.

    p_j = q_j + s q_i,  so  q_j = p_j - s q_i,  and by power  tau_i = tau_p,i + s tau_p,j

where the torques are those of the same drives. (Of a UR10e and an AIRBOT with q2 + q3 in the place of q3 "q2
looks 10 times too large" was told, of the difference "q3 looks 2 times too large".)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from ident.examination.check import Check
from ident.examination.fits.hypothesis import CLEARLY, Asked, Hypothesis, falls
from ident.examination.fits.quick import Columns, Fit, Quick
from ident.examination.fits.samples import Sample
from ident.examination.fits.stretches import RARE, Explained, all_rows, steadily
from ident.examination.torques.smooth_torques import SmoothTorques


def coupled_positions(asked: Asked) -> Iterator[Hypothesis]:
    """Each turning joint's position with that of the joint before it added or taken off, alone or with the
    torques of such drives."""
    every = held(asked.quick.columns)
    smooth = {its.j: SmoothTorques(asked, [its.j - 1, its.j]) for its in every}
    for its, drives in product(every, (False, True)):
        yield from _coupled(asked, its, drives, smooth[its.j])


@dataclass(frozen=True, slots=True)
class Held:
    """Joint j's position (by its place) holds that of the joint before it, with a sign."""

    j: int
    sign: float
    own: str
    before: str

    @property
    def words(self) -> str:
        return f"{self.own} has {self.before} {'added' if self.sign > 0 else 'taken off'}"

    @property
    def remedy(self) -> str:
        taken = "-" if self.sign > 0 else "+"
        return f"write {self.own} {taken} {self.before} in the place of {self.own} into the log"

    def without(self, columns: Columns, s: Sample, power: np.ndarray | None = None) -> Sample:
        """Along the joint's own position, with torques times power (C, C)."""
        mix = np.eye(len(columns.need.joints))
        mix[self.j, self.j - 1] = -self.sign
        return s.mixed(columns, mix, np.eye(len(columns.channels)) if power is None else power)


def held(columns: Columns) -> list[Held]:
    """All that turning joints behind turning ones may hold."""
    joints = [str(joint) for joint in columns.need.joints]
    turning = [joint not in columns.model.prismatic for joint in joints]
    places = [j for j in range(1, len(turning)) if turning[j] and turning[j - 1]]
    return [Held(j, sign, f"q{joints[j]}", f"q{joints[j - 1]}") for j in places for sign in (1.0, -1.0)]


def held_too(quick: Quick) -> Iterator[tuple[str, str, Quick]]:
    """Each such position in words, of all recordings ("") or of one, and the recordings without what it holds
    too."""
    labels = [s.label for s in quick.samples]
    for its in held(quick.columns):
        own = [its.without(quick.columns, s) for s in quick.samples]
        yield its.words, "", quick.of(own)
        for k, label in enumerate(labels if len(labels) > 1 else ()):
            mixed = [own[k] if i == k else s for i, s in enumerate(quick.samples)]
            yield its.words.replace(" ", f" of {label} ", 1), label, quick.of(mixed)


def _coupled(asked: Asked, its: Held, drives: bool, smooth: SmoothTorques) -> Iterator[Hypothesis]:
    quick, how, j = asked.quick, asked.how, its.j
    power = np.eye(len(how.order))
    pairs = []
    channels = list(zip(quick.columns.joint_of, quick.columns.need.channels))
    for c, k in product(range(len(channels)), repeat=2) if drives else ():
        if channels[c][0] == j - 1 and channels[k][0] == j and channels[c][1].side == channels[k][1].side:
            power[how.order[k], how.order[c]] = its.sign * how.factor[k] / how.factor[c]
            times = float(asked.gains[k] / asked.gains[c])
            pairs.append((asked.name(c), f"{'' if times == 1 else f'{times:.4g} '}{asked.name(k)}"))
    if drives and not pairs:
        return
    what, added = ("sum", "+") if its.sign > 0 else ("difference", "-")
    also = "".join(f", {c} {added} {k} in that of {c}" for c, k in pairs)

    def told(other: Fit) -> Check:
        return Check(
            "coupled_position",
            (its.own, *(c for c, _ in pairs)),
            f"{its.own} looks recorded as the {what} of {its.own} and {its.before}: counted from the base, "
            f"or of a drive that turns with joint {asked.joints[j - 1]}; so taken, {falls(asked.fit, other)}",
            f"{its.remedy}{also}",
        )

    moved = quick.of([its.without(quick.columns, s, power) for s in quick.samples])
    for hypothesis in asked.along(moved, told, f"{its.own} has {its.before} in it", least=CLEARLY):
        plain = Explained.by(all_rows(quick), how)
        other = Explained.less(all_rows(moved), how, plain.quick)
        if steadily(plain, other, RARE):
            yield from smooth.less_than(hypothesis)
