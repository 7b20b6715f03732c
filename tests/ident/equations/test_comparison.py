"""What is compared of measured and modelled torque."""

import tracemalloc

import numpy as np
import pytest
from recordings import recording, write_parquet, write_study

from ident.equations.comparison import Fitted, Squares, compare_torques
from ident.equations.prepared import prepare_study
from ident.estimation.fit import fit_study
from ident.recordings import held
from ident.recordings.study import load_study
from ident.report.numbers import finite
from ident.report.wording import percent, worse_elsewhere

pytestmark = pytest.mark.unexamined


def _errors(folder, change):
    columns, _ = recording(seconds=40.0)
    write_parquet(folder / "run.parquet", change(columns))
    fit = fit_study(load_study(write_study(folder, [{"file": "run.parquet"}])))
    return fit.full_rate_error["identify"], fit.relative_error["identify"]


def test_what_was_put_in_for_lost_samples_is_not_compared(tmp_path):
    """A second of a torque that was lost doubled its printed error, though the fit gave it no weight."""

    def lost(c):
        tau = c["tau_m3"].copy()
        tau[4000:4200] = np.nan
        return c | {"tau_m3": tau}

    for whole, holed in zip(_errors(tmp_path, lambda c: c), _errors(tmp_path, lost)):
        for name, value in whole.items():
            assert abs(holed[name] / value - 1) < 0.1, name


def test_of_a_torque_that_reads_0_there_is_no_share():
    """Of a run that was frozen before it moved 1.03e+154 % was told."""
    squares = Squares.empty(("tau_m1", "tau_m2"), {"run": "identify", "next": "validate"})
    torque = np.column_stack([np.ones(9), 2 * np.ones(9)])
    squares.add("run", torque, 0.9 * torque)
    squares.add("next", torque * [1, 0], 0.9 * torque)
    errors = {role: finite(its) for role, its in squares.by_role().items()}
    assert errors["validate"]["tau_m2"] is None and abs(errors["validate"]["tau_m1"] - 10) < 1e-9
    assert all(abs(value - 10) < 1e-9 for value in errors["identify"].values())
    assert worse_elsewhere(errors) and percent(errors["validate"]["tau_m2"]) == "–"


def test_what_is_drawn_holds_no_more_than_it_draws(tmp_path, monkeypatch):
    """Every n-th row was a view of all rows: of 10 h they would have been 9 GB. Compared with no model at
    all, whose error is then the torque."""
    monkeypatch.setattr(held, "NUMBERS", 0)  # blocks that are kept for the next pass
    columns, _ = recording(seconds=30.0)
    every = len(columns["t"]) / 200 + 1
    peaks = []
    for times in (8, 16):
        long = {name: np.tile(x, times) for name, x in columns.items()}
        long["t"] += np.repeat(np.arange(times) * every, len(columns["t"]))
        write_parquet(tmp_path / f"run{times}.parquet", long)
        study = load_study(write_study(tmp_path, [{"file": f"run{times}.parquet"}]))
        prepared = prepare_study(study)
        nothing = Fitted(None, np.zeros(len(prepared.columns.parameters)))
        tracemalloc.start()
        found = compare_torques(prepared, nothing, nothing, 2.0)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert found.full_rate.by_role()["identify"]["total"] == pytest.approx(100)
        assert np.isfinite(found.curves[0].measured[:, 0]).sum() > 1000
    assert peaks[1] - peaks[0] < 2e6  # 48,000 rows more of 15 numbers are 5.8 MB
