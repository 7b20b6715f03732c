"""What is compared of measured and modelled torque."""

import numpy as np
from recordings import recording, write_parquet, write_study

from ident.equations.comparison import Squares
from ident.estimation.fit import fit_study
from ident.recordings.study import load_study
from ident.report.numbers import finite
from ident.report.wording import percent, worse_elsewhere


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
