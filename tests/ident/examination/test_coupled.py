"""Positions with another joint's in them."""

import numpy as np
import pyarrow as pa
import pytest
from planted import ON_RECORDINGS, measured, planted, strangers_log
from small_arm import ARM

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.fits.hypothesis import explains
from ident.twin import simulate


@pytest.mark.parametrize(("sign", "line"), [(1, "write q3 - q2 in"), (-1, "write q3 + q2 in")])
@pytest.mark.parametrize("drives", [False, True])
@pytest.mark.first_case
def test_an_elbow_that_is_counted_from_the_base(tmp_path, sign, line, drives):
    """With the torques of drives that turn so, by power: tau2 dq2 + tau3 dq3 is what it was."""
    (tmp_path / "small.yaml").write_text(ARM)
    runs = []
    for its in simulate(tmp_path / "small.yaml", seed=5).recordings:
        c = dict(its.columns)
        q, tau = c["q3"] + sign * c["q2"], c["tau_m2"] - sign * c["tau_m3"]
        c = {k: v for k, v in c.items() if not k.startswith(("dq", "ddq"))} | {"q3": q}
        table = pa.table(c | ({"tau_m2": tau} if drives else {}))
        runs.append(ident.Recording(table, its.use, name=its.label))
    checks = ident.fit(ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs)).checks
    (check,) = [c for c in checks if c.check != "poor_excitation"]
    assert (check.check, check.signals) == ("coupled_position", ("q3", "tau_m2") if drives else ("q3",))
    also = f", tau_m2 {'+' if sign > 0 else '-'} tau_m3 in that of tau_m2" if drives else ""
    assert check.remedy == f"{line} the place of q3 into the log{also}"


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(("robot", "j", "i", "sign"), [("ur10e", 3, 2, -1)])
def test_of_a_measured_robot(tmp_path, robot, j, i, sign):
    """q2 looked ten times too large, of the difference q3 twice."""

    def change(c):
        made = {f"{d}q{j}": c[f"{d}q{j}"] + sign * c[f"{d}q{i}"] for d in ("", "d", "dd") if f"{d}q{j}" in c}
        return c | made

    study = planted(tmp_path, change, measured(robot))
    if robot == "ur10e":
        keep = ("excite_a_50s", "excite_c_30s")
        study = study.with_(recordings=tuple(e for e in study.recordings if e.label in keep))
    (check,) = examine_fit(prepare_study(study))
    assert check.check == "coupled_position" and check.signals == (f"q{j}",)
    assert f"q{j} {'-' if sign > 0 else '+'} q{i}" in check.remedy


@pytest.mark.first_case
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.long
def test_in_one_recording_of_a_measured_robot(tmp_path, sign):
    """Of the difference q3 was two times too large in that run."""

    def change(c):
        made = {f"{d}q3": c[f"{d}q3"] + sign * c[f"{d}q2"] for d in ("", "d", "dd") if f"{d}q3" in c}
        return c | made if np.ptp(c["t"]) > 40 else c

    (check,) = examine_fit(prepare_study(planted(tmp_path, change)))
    assert (check.check, check.signals, check.recording) == ("coupled_position", ("q3",), "excite_a_50s")
    assert f"q3 {'-' if sign > 0 else '+'} q2" in check.remedy


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_wrist_that_turns_with_the_joint_before_it_is_told_by_its_own_torque(tmp_path):
    """An AIRBOT's last position moves one torque of six, and nothing was said."""

    def both(c):
        return c | {"q6": c["q6"] + c["q5"], "dq6": c["dq6"] + c["dq5"]}

    study = measured("airbot_play")
    study = study.with_(recordings=tuple(e for e in study.recordings if e.file != "identify_c.parquet"))
    checks = examine_fit(prepare_study(planted(tmp_path, both, study)))
    assert [(c.check, c.signals) for c in checks] == [("coupled_position", ("q6",))]


@pytest.mark.parametrize(("left", "noise"), [(0.02, 0.56), (0.02, 0.8), (0.15, 0.56), (0.02, 0.45)])
def test_a_torque_that_is_noise_beside_others_that_are_explained(left, noise):
    """It hardly changes beside others that fall to a tenth; it does where they fall by a third."""
    before, after = np.array([0.2, 0.3, 0.2, 0.5]), np.array([left, left, left, noise])
    assert explains(before, after) == (noise < 0.5 or (noise == 0.56 and left == 0.02))
    assert not explains(before, np.array([0.6, 0.6, 0.7, 0.9]))


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_beside_a_torque_that_is_noise(tmp_path):
    """Of an LWR4+ two positions were to be exchanged, with the line for it, by which 22 % are left for 10."""

    def change(log):
        for table in log.tables.values():
            table["q2"], table["dq2"] = table["q2"] + table["q1"], table["dq2"] + table["dq1"]

    study = strangers_log(tmp_path, "kuka_lwr4plus", (50, False, True, False), change)
    (check, *_) = examine_fit(prepare_study(study))
    assert check.check == "coupled_position" and check.remedy.startswith("write q2 - q1 in the place of q2")
