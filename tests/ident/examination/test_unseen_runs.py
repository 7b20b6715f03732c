"""Faults of a run that decides nothing, of a simulated arm."""

import numpy as np
import pytest
from recordings import recording, write_parquet, write_study

from ident.estimation.fit import fit_study
from ident.examination.check import Check
from ident.examination.unseen_runs import is_of
from ident.recordings.study import load_study


def _fit(folder, change):
    for use, seed in (("identify", 1), ("validate", 2), ("test", 3)):
        columns, _ = recording(seed=seed)
        write_parquet(folder / f"{use}.parquet", change(columns) if use == "test" else columns)
    entries = [{"file": f"{use}.parquet", "use": use} for use in ("identify", "validate", "test")]
    return fit_study(load_study(write_study(folder, entries)))


@pytest.mark.parametrize(
    ("change", "check", "signals"),
    [
        (lambda c: c | {"tau_m3": -c["tau_m3"]}, "torque_sign", ("tau_m3",)),
        pytest.param(
            lambda c: c | {"tau_m2": 3 * c["tau_m2"]}, "torque_scale", ("tau_m2",), marks=pytest.mark.long
        ),
        (lambda c: c, None, ()),
    ],
)
def test_a_fault_of_a_test_run_is_told_and_nothing_else_changes(tmp_path, change, check, signals):
    """Of a UR10e with its third current turned there the summary said that something is different."""
    fit = _fit(tmp_path, change)
    told = [c for c in fit.checks if c.recording == "test" and c.outcome == "warned"]
    assert [(c.check, c.signals) for c in told] == ([(check, signals)] if check else [])
    assert all("decides nothing and is read as it is" in c.remedy for c in told)
    assert not fit.deciding or fit.deciding == tuple(c for c in fit.checks if c not in told)
    if check:
        clean = tmp_path / "clean"
        clean.mkdir()
        np.testing.assert_array_equal(_fit(clean, lambda c: c).estimate.chi, fit.estimate.chi)


def test_what_a_table_shows_of_a_test_run_stands_before_nothing(tmp_path):
    """A position that is late there was to be settled first, "as all else is told with it in the data"."""
    fit = _fit(tmp_path, lambda c: c)
    late = [
        Check("channel_delay", ("q4",), "late", recording=run, open=True) for run in ("test", "validate", "")
    ]
    assert fit.deciding_of(late) == tuple(late[1:])


@pytest.mark.parametrize(
    ("recording", "message", "its"),
    [
        ("run 1", "", True),
        ("", "in run 1, run 2 the first torque is turned", True),
        ("", "in run 10 the first torque is turned", False),
        ("run 2", "", False),
    ],
)
def test_a_check_of_several_recordings_is_of_those_that_it_names(recording, message, its):
    assert is_of(Check("torque_sign", ("tau_m1",), message, recording=recording), "run 1") is its
