"""A position that stands still for a while, or a recording, in which the torques say that its joint did not.

A joint that is held asks for what its position says: the others' torques are then foretold as elsewhere. That
an encoder or a message stopped a logged velocity tells (stopped.py) unless that stopped, too. (Of a UR10e and
a Franka one of whose joints stood still in half of each run 110 and 4 % were left for 5 and 1 %, and nothing
was said.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.fits.hypothesis import Asked
from ident.examination.fits.samples import Sample
from ident.examination.rivals.recordings_apart import recordings_apart
from ident.examination.tables.repeats import STILL_S, TRAVELLED
from ident.signals.runs import runs_of

NONE, GOES = 1e-6, 0.1  # of a joint's fastest: a rate that is none, and one with which it goes on
LEAST = 60  # samples
STILL = "\0"  # between a recording's name and when it is still
ALL_ALONG = "all along"


def stopped_meanwhile(asked: Asked) -> Iterator[Check]:
    """Where the fitted rest does not foretell the torques of a stretch in which one position stands still."""
    rates = np.max([np.abs(s.dq).max(axis=0) for s in asked.quick.samples], axis=0)
    reach = np.ptp(np.concatenate([s.q for s in asked.quick.samples]), axis=0)
    for joint in np.flatnonzero((reach > TRAVELLED) & (rates > 0)).tolist():
        parted = [_parted(s, joint, rates) for s in asked.quick.samples]
        pieces = [part for parts in parted for part in parts]
        if not any(STILL in part.label for part in pieces) or not any(_fitted(parts) for parts in parted):
            continue
        quick = asked.quick.of(pieces)
        for apart in recordings_apart(quick, asked.how):
            label, *still = apart.sample.label.split(STILL)
            if not still:
                continue
            name, when = f"q{asked.joints[joint]}", still[0]
            odd = [c for c in apart.odd if asked.quick.columns.joint_of[c] != joint] or list(apart.odd)
            here, there = (100 * float(np.nanmax(e[odd])) for e in (apart.error, apart.usual))
            yield Check(
                "dead_channel",
                (name,),
                f"{name} stands still {when} while other joints move, and {listed(asked.names(odd))} "
                f"{'do' if len(odd) > 1 else 'does'} not go with that (error {here:.0f} %, elsewhere "
                f"{there:.0f} %): an encoder or a message that stopped, a value held",
                "leave the recording out"
                if when == ALL_ALONG
                else "leave the stretch out with from: and to:",
                recording=label,
            )


def _fitted(parts: list[Sample]) -> bool:
    return parts[0].role == "identify" and STILL not in parts[0].label


def _parted(s: Sample, joint: int, rates: np.ndarray) -> list[Sample]:
    """A recording without the longest stretch in which the joint stands still, and that stretch, which may be
    all of it. (Of a UR10e's third, not recorded in one of two fitted runs, 19 % were left for 4.)"""
    still = np.abs(s.dq[:, joint]) < NONE * rates[joint]
    runs = runs_of(still)
    if not len(runs):
        return [s]
    begin, stop = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    goes = np.delete(np.abs(s.dq[begin:stop]).max(axis=0) > GOES * rates, joint)
    seconds = float(s.t[stop - 1] - s.t[begin])
    others = len(s.t) - (stop - begin)
    if stop - begin < LEAST or 0 < others < LEAST or seconds < STILL_S or not goes.any():
        return [s]
    rest = np.flatnonzero((np.arange(len(s.t)) < begin) | (np.arange(len(s.t)) >= stop))
    when = f"from {s.t[begin]:.3g} to {s.t[stop - 1]:.3g} s" if others else ALL_ALONG
    held = replace(s.rows(slice(begin, stop)), label=f"{s.label}{STILL}{when}", role="validate")
    return [s.rows(rest), held] if others else [held]
