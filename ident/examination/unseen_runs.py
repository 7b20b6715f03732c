"""Faults of the runs that decide nothing (`use: test`): told, and neither undone nor fitted.

Each is held against the others as a run that judges, where these foretell it badly, and what names it then is
told. (Of a robot one of whose torques was turned in the test run only that one's errors said that something
was different there.)
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from ident.equations.prepared import Prepared
from ident.errors import RecordingError
from ident.examination.asking import asked_of
from ident.examination.check import Check
from ident.examination.examine import examine_fit
from ident.examination.fits.quick import gain_of
from ident.examination.rivals.carried import CARRIED

KEPT = "a test run decides nothing and is read as it is; to change that, "


def examine_unseen(prepared: Prepared) -> Iterator[Check]:
    """Of a study in which nothing was found without them."""
    for k, stream in enumerate(prepared.streams):
        if stream.role == "test" and _foretold_badly(judging := _judging(prepared, k), stream.label):
            try:
                found = examine_fit(judging)
            except RecordingError as error:
                found = error.checks
            for check in found:
                if is_of(check, stream.label):
                    remedy = f"{KEPT}{check.remedy}" if check.remedy else ""
                    yield replace(
                        check,
                        recording=stream.label,
                        outcome="warned",
                        remedy=remedy,
                        explains=False,
                        open=False,
                    )


def is_of(check: Check, label: str) -> bool:
    """Also of a check of several recordings, which its message names."""
    return check.recording == label or bool(re.search(rf"(?<!\w){re.escape(label)}(?!\w)", check.message))


def _judging(prepared: Prepared, k: int) -> Prepared:
    """With the k-th recording among those that judge."""
    streams = list(prepared.streams)
    streams[k] = replace(streams[k], role="validate")
    return replace(prepared, streams=tuple(streams))


def _foretold_badly(judging: Prepared, label: str) -> bool:
    asked = asked_of(judging)
    if asked is None:
        return False
    its = [s for s in asked.quick.samples if s.role == "identify" or s.label == label]
    fit = asked.quick.of(its).fit(asked.how)
    return fit.validate is not None and gain_of(fit.validate, fit.error) > CARRIED
