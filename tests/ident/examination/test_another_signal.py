"""A signal that is another one in one recording alone."""

from contextlib import nullcontext

import numpy as np
import pyarrow as pa
import pytest
from planted import ON_RECORDINGS, planted
from small_arm import ARM

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit, mended_study
from ident.twin import PlannedRun, simulate

POSITIONS = ("position_sign", "position_zero", "angle_unit", "swapped_signals", "base_orientation")


def said(checks):
    return [(c.check, c.signals, c.recording) for c in checks if c.check in POSITIONS]


def in_the_long_run(change):
    return lambda columns: columns | (change(columns) if np.ptp(columns["t"]) > 40 else {})


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(
    ("joint", "factor", "check"), [(2, -1.0, "position_sign"), (3, 57.29578, "angle_unit")]
)
def test_of_a_measured_robot_one_position_in_the_run_that_is_fitted(tmp_path, joint, factor, check):
    """Turned or in degrees in that run alone: it was told of all recordings, or was unknown."""
    names = [f"{d}q{joint}" for d in ("", "d", "dd")]
    change = in_the_long_run(lambda c: {name: factor * c[name] for name in names if name in c})
    study = planted(tmp_path, change)
    checks = examine_fit(prepare_study(study))
    assert said(checks) == [(check, (f"q{joint}",), "excite_a_50s")]
    turned, other = (entry.columns for entry in mended_study(study, checks).recordings)
    assert not other and turned[f"q{joint}"].sign * turned[f"q{joint}"].scale == pytest.approx(1 / factor)
    assert turned[f"dq{joint}"] == turned[f"q{joint}"].model_copy(update={"column": f"dq{joint}"})


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_of_a_measured_robot_one_torque_turned_in_the_run_that_is_fitted(tmp_path):
    """The run that judges was nothing like what the other said of its motion."""
    study = planted(tmp_path, in_the_long_run(lambda c: {"i2": -c["i2"]}))
    checks = examine_fit(prepare_study(study))
    assert [(c.check, c.signals, c.recording) for c in checks] == [("torque_sign", ("i2",), "excite_a_50s")]
    turned, other = (entry.columns for entry in mended_study(study, checks).recordings)
    assert turned["i2"].sign == -1 and not other


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_of_a_measured_robot_the_run_whose_joint_was_homed_anew(tmp_path):
    """20 degrees in the run that is fitted: the run that judges was blamed."""
    study = planted(tmp_path, in_the_long_run(lambda c: {"q2": c["q2"] + np.radians(20.0)}))
    assert said(examine_fit(prepare_study(study))) == [("position_zero", ("q2",), "excite_a_50s")]


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(("joint", "factor"), [(2, -1.0), (3, 57.29578)])
def test_of_a_measured_robot_one_position_in_all_runs(tmp_path, joint, factor):
    names = [f"{d}q{joint}" for d in ("", "d", "dd")]
    study = planted(tmp_path, lambda c: c | {name: factor * c[name] for name in names if name in c})
    with pytest.raises(ident.Error) if factor > 1 else nullcontext():
        assert not any(recording for _, _, recording in said(examine_fit(prepare_study(study))))


@pytest.mark.parametrize(
    "request_", ["position_zero:2:zero=1.5707963,recording=run1", "payload_change:m=2,recording=run1"]
)
def test_a_quarter_turn_in_one_run_is_told_and_a_load_is_none(tmp_path, request_):
    (tmp_path / "small.yaml").write_text(ARM)
    made = simulate(tmp_path / "small.yaml", effects=(request_,), seed=3)
    runs = [ident.Recording(pa.table(dict(r.columns)), r.use, name=r.label) for r in made.recordings]
    checks = ident.fit(ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs)).checks
    zero = request_.startswith("position")
    assert said(checks) == ([("position_zero", ("q2",), "run1")] if zero else [])


@pytest.mark.parametrize(("names", "check"), [(("tau_m2",), "torque_sign"), (("q2",), "position_sign")])
def test_one_signal_turned_in_the_only_fitted_run_which_is_explained_all_the_same(tmp_path, names, check):
    """A fit takes it up, and predicts the run that judges worse than nothing would."""
    (tmp_path / "small.yaml").write_text(ARM)
    plan = (PlannedRun("run1", "identify", 20.0), PlannedRun("run2", "validate", 15.0))
    made = simulate(tmp_path / "small.yaml", runs=plan, seed=4)
    runs = []
    for its in made.recordings:
        turned = {name: -its.columns[name] for name in names} if its.label == "run1" else {}
        runs.append(ident.Recording(pa.table(dict(its.columns) | turned), its.use, name=its.label))
    checks = ident.fit(ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs)).checks
    found = [c for c in checks if c.check in ("torque_sign", "position_sign")]
    assert [(c.check, c.signals, c.recording) for c in found] == [(check, names, "run1")]
    assert "do not tell" not in found[0].message
