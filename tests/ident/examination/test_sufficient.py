"""What is told has to explain enough: of either half, of more torques than one, and of what judges."""

from importlib.resources import files

import numpy as np
import pytest
import yaml
from planted import ON_RECORDINGS, asked_of, measured, parted, planted

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.fits.unexplained import contradicting

pytestmark = ON_RECORDINGS


def _told(folder, name, file, begin, seconds, change=lambda c: c, **keys):
    """Checks of six tenths of these seconds, and of two that judge."""
    study = measured(name)
    entry = next(e for e in study.recordings if e.file.startswith(file))
    parts = (("identify", 0.0, 0.6), ("validate", 0.6, 0.8))
    runs = [
        entry.model_copy(
            update={"use": u, "name": u, "from_s": begin + a * seconds, "to_s": begin + b * seconds}
        )
        for u, a, b in parts
    ]
    study = study.with_(recordings=tuple(runs), filter=type(study.filter)(), **keys)
    return examine_fit(prepare_study(planted(folder, change, study)))


@pytest.mark.long
def test_four_seconds_of_late_torques(tmp_path):
    """Of an LWR4+ the fifth joint was told to turn the other way, beside two other causes."""

    def late(c):
        return c | {k: np.interp(c["t"] - 0.02, c["t"], x) for k, x in c.items() if k.startswith("tau")}

    checks = _told(tmp_path, "kuka_lwr4plus", "traj_b", 11.1, 7.0, late)
    assert {c.check for c in checks} <= {"unrelated_torque"}  # "or motions that have nothing in common"


@pytest.mark.long
def test_an_axis_that_one_torque_alone_feels(tmp_path):
    """Two joints of an LWR4+ were told to be exchanged, by the last torque, which is hardly any."""
    path = files("modelgen").joinpath("robots", f"{measured('kuka_lwr4plus').robot}.yaml")
    table = yaml.safe_load(path.read_text(encoding="utf-8"))
    table["links"][5]["alpha"] = f"-({table['links'][5]['alpha']})"
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(table))
    robot = str(tmp_path / "robot.yaml")
    said = _told(tmp_path, "kuka_lwr4plus", "traj_a", 0.0, 25.8, robot=robot)
    assert all("do not show how the base is mounted" in check.message for check in said)


@pytest.mark.long
def test_positions_that_are_late_in_what_judges_too(tmp_path):
    """Of an AIRBOT a share of another torque was told, a scale, a drift and a square. That so few seconds do
    not show which way is down may be said."""

    def late(c):
        c = {k: x for k, x in c.items() if not k.startswith("dq")}
        return c | {k: np.interp(c["t"] - 0.02, c["t"], x) for k, x in c.items() if k[0] == "q"}

    said = _told(tmp_path, "airbot_play", "identify_a", 6.3, 13.4, late)
    assert all("do not show how the base is mounted" in check.message for check in said)


def test_two_joints_in_each_other_s_place(tmp_path):
    """Any torque of both positions explains more of a Barrett's rows that it is fitted to, and three factors
    were told."""

    def exchanged(c):
        return {k.translate(str.maketrans("12", "21")): x for k, x in c.items()}

    (check,) = examine_fit(prepare_study(planted(tmp_path, exchanged, measured("barrett_wam_2dof"))))
    assert check.check == "swapped_signals" and "the joints look recorded in another order" in check.message


@pytest.mark.long
def test_motors_beside_sensors_that_contradict_each_other(tmp_path):
    """A dual arm's sensors 1 and 3 are turned against the others and their motors. With two positions
    exchanged beside it the fourth one was told to be turned, too, and by it three currents; then two of
    these, though they go with their dry friction."""

    def exchanged(c):
        turn = str.maketrans("25", "52")
        return {k.translate(turn) if k[0] == "q" or k[:2] == "dq" else k: x for k, x in c.items()}

    channels = (*(f"tau_l{j}" for j in range(1, 5)), *(f"tau_m{j}" for j in range(1, 8)))
    checks = _told(tmp_path, "dualarm_v2_7dof", "identify_b", 0.0, 24.0, exchanged, channels=channels)
    signs = [c for c in checks if c.check == "torque_sign"]
    assert [c.signals for c in signs] == [("tau_l1", "tau_l3")]
    assert "unrelated_torque" in {c.check for c in checks}


@pytest.mark.long
def test_joints_that_are_all_logged_one_place_further(tmp_path):
    """Of an LWR4+ the first two positions looked swapped, or two torques, after which a quarter was left."""

    def further(c):
        c = {k: x[::5] for k, x in c.items() if not k.startswith("dq")}
        c["t"] = np.sort(c["t"] + 0.0025 * np.random.default_rng(7).normal(size=len(c["t"])))
        return c | {f"{p}{j}": c[f"{p}{j % 7 + 1}"] for p in ("q", "tau_l") for j in range(1, 8)}

    checks = _told(tmp_path, "kuka_lwr4plus", "traj_a", 1.0, 24.13, further)
    assert not any("swapped" in c.message for c in checks) and checks


def test_torques_that_all_recordings_contradict_and_the_fitted_one_takes(tmp_path):
    """A Franka's fitted run takes its first position turned on a base that is off, and foretells the other at
    200 %; by themselves its torques are explained to 1 and 5 % of both, by one robot to 23 and 26."""
    turned = lambda c: {k: -x[::5] if k in ("q1", "dq1") else x[::5] for k, x in c.items()}  # noqa: E731
    study = planted(tmp_path, turned, measured("franka_panda"))
    tilt = np.deg2rad(8)
    study = parted(study, 6.5, 9.8).with_(gravity=(9.81 * np.sin(tilt), 0.0, -9.81 * np.cos(tilt)))
    (told,) = contradicting(asked_of(study))
    assert told.check == "unrelated_torque" and {"tau_l1", "tau_l3"} <= set(told.signals)
