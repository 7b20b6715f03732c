"""A position that wraps and was smoothed or resampled over its leaps, and torques that nothing explains."""

from types import SimpleNamespace

import numpy as np
import pytest
from planted import ON_RECORDINGS, strangers_log

from ident.equations.prepared import prepare_study
from ident.errors import RecordingError
from ident.examination.examine import examine_fit
from ident.examination.tables.excerpt import Excerpt
from ident.examination.tables.smoothed_wraps import smoothed_wraps


def _told(t, x):
    excerpt = Excerpt()
    excerpt.take((np.arange(len(t)), t, x[:, None]))
    return list(smoothed_wraps(SimpleNamespace(n=1, prismatic=[False], signals=["q1"]), excerpt))


def _wrapped(x):
    return np.mod(x, 2 * np.pi)


@pytest.mark.parametrize("rate", [50, 200, 1000])
def test_a_smoothed_wrap_is_told_with_its_row(rate):
    t = np.arange(0, 20, 1 / rate)
    q = 2 * np.sin(t) + 0.5
    at = np.flatnonzero(np.abs(np.diff(_wrapped(q))) > 3)
    taps = max(2, rate // 50)  # two rows at 50 Hz
    smooth = np.convolve(np.pad(_wrapped(q), taps // 2, mode="edge"), np.ones(taps) / taps, "same")[: len(t)]
    (check,) = _told(t, smooth)
    assert check.outcome == "refused" and f"{len(at)} times" in check.message
    assert abs(check.rows[0] - at[0]) < 2 * taps + 4


def test_fast_and_far_motions_are_no_wraps():
    t = np.arange(0, 20, 1 / 200)
    once = np.pi * (1 + np.tanh((t - 10) / 0.1))  # one turn from rest to rest, in some tenths of a second
    for q in (once, 3.1 * np.sin(6 * t), np.rad2deg(2 * np.sin(3 * t)), 2 * np.sin(t), 3 * t):
        assert not _told(t, q)


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_measured_position_smoothed_over_its_wraps(tmp_path):
    """Of an AIRBOT's third one 57 % of the torques were left, and nothing was said."""

    def smoothed(log):
        for table in log.tables.values():
            q = table["q3"]
            wrapped = np.pad(_wrapped(q - np.median(q)), 2, mode="edge")
            table["q3"] = np.convolve(wrapped, np.ones(5) / 5, "valid")

    with pytest.raises(RecordingError, match="q3 goes by a whole turn within"):
        prepare_study(strangers_log(tmp_path, "airbot_play", (0, False, True, False), smoothed))


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_torques_that_are_explained_badly_by_no_fault_that_is_asked_are_told_so(tmp_path):
    """An AIRBOT's third position backwards in time: half of most torques was left, and nothing was said."""

    def backwards(log):
        for table in log.tables.values():
            table["q3"] = table["q3"][::-1].copy()

    study = strangers_log(tmp_path, "airbot_play", (0, False, False, False), backwards)
    (told,) = examine_fit(prepare_study(study))
    assert told.check == "unrelated_torque" and "no check tells which" in told.message
