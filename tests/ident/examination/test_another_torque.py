"""Torques of one recording, read otherwise."""

import numpy as np
import pyarrow as pa
from small_arm import ARM

import ident
from ident.equations.prepared import prepare_study
from ident.examination.fits.quick import quick_of
from ident.examination.fits.samples import take
from ident.examination.one_recording.another_torque import Sums
from ident.twin import PlannedRun, simulate


def test_no_number_times_a_torque_leaves_less_than_is_said_to_be_left(tmp_path):
    """By trying them: what the recording's own factor of 1.5 takes is found among them."""
    (tmp_path / "small.yaml").write_text(ARM)
    plan = (PlannedRun("run1", "identify", 12.0), PlannedRun("run2", "identify", 9.0))
    runs = []
    for its in simulate(tmp_path / "small.yaml", runs=plan, seed=4).recordings:
        times = 1.5 if its.label == "run1" else 1.0
        table = pa.table(dict(its.columns) | {"tau_m2": times * its.columns["tau_m2"]})
        runs.append(ident.Recording(table, its.use, name=its.label))
    prepared = prepare_study(ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs))
    quick = quick_of(prepared.columns, take(prepared.streams, prepared.banks, prepared.columns, "identify"))
    sums = Sums.of(quick, quick.plain())
    plain, times = sums.least_errors(0)
    for c in range(3):
        own = np.arange(3) == c
        for factor in [-1.0, *np.geomspace(0.1, 10.0, 61), 1 / 1.5]:
            error = sums.fits(0, [((0, 1, 2), np.where(own, factor, 1.0))])[0].error
            assert (error >= np.where(own, times, plain) - 1e-9).all()
    undone = sums.fits(0, [((0, 1, 2), np.array([1.0, 1 / 1.5, 1.0]))])[0].error
    assert undone[1] < 1.2 * times[1] < 0.2 * plain[1]
