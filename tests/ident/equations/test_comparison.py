"""What is compared of measured and modelled torque."""

import numpy as np
from recordings import recording, write_parquet, write_study

from ident.estimation.fit import fit_study
from ident.recordings.study import load_study


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
