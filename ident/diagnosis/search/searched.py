"""What a diagnosis searches: the catalogue's effects, at the places that no check explains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ident.diagnosis.search.candidates import Library
from ident.examination.check import Check
from ident.examination.undone import unsettled
from modelgen.effects import catalogue
from modelgen.effects.place import Layout


def searched(layout: Layout, room: float, joints: Sequence[object], checks: Sequence[Check]) -> Library:
    """room [bytes]: what their columns may take."""
    return Library(
        list(catalogue().values()), without_explained(layout, checks), room, frictionless(joints, checks)
    )


def frictionless(joints: Sequence[object], checks: Sequence[Check]) -> frozenset[int]:
    """Places of the joints whose torques were logged less friction: what is left of it where they turn round
    is no law of theirs. (Of a UR10e's sixth a Stribeck curve that fades as it warms was told.)"""
    told = {name for check in checks if check.check == "friction_compensated" for name in check.signals}
    return frozenset(k for k, joint in enumerate(joints) if told & {f"tau_m{joint}", f"i{joint}"})


def without_explained(layout: Layout, checks: Sequence[Check]) -> Layout:
    """The places of a study without those on recordings that a check explains: what is of one recording alone
    is explained there. (Beside "in this recording tau_m2 and tau_m3 look swapped" a body of 0.35 kg m on an
    AIRBOT's second link was told.)

    Nor with those on the others where a recording contradicts them, or they it, and nothing undoes it: what
    is of one of these alone is seen against that one. (Of a Franka homed a quarter turn off in the run that
    judges a body was told in the fitted one, and 9.5 % were left of a third for 1.8.)"""
    explained = {check.recording for check in checks if check.explains and check.outcome == "warned"}
    contradicted = {c.recording for c in unsettled(checks) if c.recording and not c.hint}
    kept = (r for r in layout.recordings if not contradicted or r in contradicted)
    return replace(layout, recordings=tuple(r for r in kept if r not in explained))
