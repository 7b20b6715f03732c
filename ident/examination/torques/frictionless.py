"""Torques of drives in which no friction shows: what a controller asks for before it adds friction, or what
it logs less what it adds against it.

A drive rubs. (Of a UR10e's torques without their friction, what was left of it where joints turn was told as
three laws of friction, and nothing else was said.)
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.fits.hypothesis import BAD, CLEARLY, Asked
from ident.examination.fits.stretches import RARE, Explained, all_rows, beyond_chance
from modelgen.geometry.names import ParameterName

FRICTION = ("Fvm", "Fcm", "Fvl", "Fcl", "Fvc", "Fcc")  # kinds of the model's parameters
EITHER_WAY = 0.1  # of all that a joint goes
MOST = 0.5  # of the torques, of which more than this show none


def frictionless(asked: Asked) -> Iterator[Check]:
    """Said where of most motors' torques stretch by stretch no more is explained with friction than without,
    and clearly more is ruled out, though the model explains most of them: of one alone a joint that hardly
    rubs, or hardly moves, is not told from it. Sensors behind the gear may feel none. (Of a Barrett whose
    second encoder stopped midway, or with the rows of its table exchanged, both were said to show none: what
    was left of them hid it.)"""
    columns, how = asked.quick.columns, asked.how
    names = [ParameterName.of(name) for name in columns.parameters]
    rubs = np.array([name is not None and name.kind in FRICTION for name in names])
    motors = [c for c in asked.seen if columns.need.channels[c].side == "motor"]
    motors = [c for c in motors if c not in columns.gain_columns and _moves(asked, c)]
    if not rubs.any() or len(motors) < 2:
        return
    whole = all_rows(asked.quick)
    felt = Explained.by(whole, how)
    bare = Explained.by(whole.of([s.lacking(rubs) for s in whole.samples]), how)
    logs = np.concatenate([0.5 * np.log(np.maximum(b, 1e-300) / np.maximum(f, 1e-300))
                           for b, f in zip(bare.stretches, felt.stretches)])  # fmt: skip
    gained = felt.gains_over(bare)
    silent = [c for c in motors if gained[c] < CLEARLY and not beyond_chance(logs[:, c], RARE)]
    silent = [c for c in silent if beyond_chance(CLEARLY - logs[:, c], RARE)]  # and that it is none is shown
    explained = [c for c in motors if bare.fit.error[c] < BAD]  # else something else is wrong
    if min(len(silent), len(explained)) > MOST * len(motors):
        said = asked.names(silent)
        sizes = [100 * float(np.exp(np.mean(np.log(x.fit.error[silent])))) for x in (felt, bare)]
        yield Check(
            "friction_compensated",
            said,
            f"{listed(said)} show no friction: without it the model explains them about as well (an error of "
            f"{sizes[1]:.0f} %, with it {sizes[0]:.0f} %, geometric means), as torques that are logged less "
            "what a controller adds against it, or before it is added, or simulated ones",
            "log the torques or currents that the drives give; a law of friction is that of what was left",
        )


def _moves(asked: Asked, c: int) -> bool:
    """Whether its joint goes both ways, each at least a tenth of all that it goes, so that friction is no
    offset. (Of a UR10e that moves its last joint and goes to its pose before, the others showed none.)"""
    joint = asked.quick.columns.joint_of[c]
    rates = np.concatenate([s.dq[:, joint] * (s.weight[:, c] > 0) for s in asked.quick.samples])
    forth, back = np.maximum(rates, 0.0).sum(), np.maximum(-rates, 0.0).sum()
    return bool(min(forth, back) > EITHER_WAY * (forth + back))
