"""What checks say of torques that are not as they should be, held against what was found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from ident.examination.check import Check
from ident.examination.fits.hypothesis import BAD

Percents = Mapping[str, Mapping[str, float]]  # of recordings: of channels

# torques that are not as they should be, whatever the cause
UNKNOWN = ("unrelated_torque", "wrong_robot", "torque_step", "torque_zero", "changes_meanwhile")
ANSWERED = 0.5  # of their error: with less of it left they may be explained


def unanswered(checks: Iterable[Check], before: Percents, after: Percents) -> tuple[Check, ...]:
    """Checks that torques are not what motion and model ask for, of a cause that no check tells, to which all
    that was found is no answer: half of their error or more is left by it, or so much that nothing explains
    them; {recording: {channel: percent}} without it and with it. (Of an LWR4+ whose torques are in reverse
    order in one run a body was told that it has there, and 70 % were left; of one whose torques leap by a
    quarter in the middle of each run contacts from other moments on.)"""
    doubts = (c for c in checks if c.check in UNKNOWN and c.outcome == "warned" and not c.open)
    return tuple(c for c in doubts if c.signals and not _answered(c, before, after))


def _answered(check: Check, before: Percents, after: Percents) -> bool:
    """By the error of its signals, in their geometric mean and in their median."""
    runs = [check.recording] if check.recording in before else list(before)
    names = [name for signal in check.signals for name in _compared(signal, before[runs[0]])]
    if not names:
        return False
    had, left = (
        np.array([np.sqrt(np.nanmean(np.square([its[run][name] for run in runs]))) for name in names])
        for its in (before, after)
    )
    known = (had > 0) & (left > 0)
    share = np.exp(np.mean(np.log(left[known] / had[known]))) if known.any() else 1.0
    return bool(share < ANSWERED and np.median(left) < 100 * BAD)


def _compared(signal: str, channels: Iterable[str]) -> list[str]:
    """Channels that a recorded signal is in: its own, or of its joint where that is the difference of two."""
    kind, joint = read(signal)
    mine = [name for name in channels if read(name)[1] == joint]
    return [name for name in mine if name == f"{kind}{joint}"] or mine


def read(signal: str) -> tuple[str, int]:
    """Side and joint of a recorded signal; a current is its motor's torque."""
    kind = signal.rstrip("0123456789")
    return "tau_m" if kind == "i" else kind, int(signal[len(kind) :] or 0)
