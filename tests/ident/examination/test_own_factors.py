"""Torques in currents: each is times a number of its own, in a measured recording of a Franka."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, measured, parted, planted, strangers_log

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit

pytestmark = ON_RECORDINGS
IN_MA = 1000 / np.random.default_rng(5).uniform(3, 12, 7)  # of a N m of each joint


def _said(folder, factors):
    def change(columns):
        return columns | {f"tau_l{j}": k * columns[f"tau_l{j}"] for j, k in enumerate(factors, 1)}

    study = parted(planted(folder, change, measured("franka_panda")), 6.5, 9.8)
    return examine_fit(prepare_study(study))


@pytest.mark.long
def test_no_torque_alone_is_told_of_torques_in_currents(tmp_path):
    """Of the fifth 0.63 times what it is was told."""
    (said,) = _said(tmp_path, IN_MA)
    assert "each torque is times a number of its own" in said.message and "tau_l5" not in said.message


@pytest.mark.long
def test_what_the_fitted_rows_tell_of_torques_in_currents(tmp_path):
    """The second was told to be 1.4 times too small, then that nothing tells the rest."""
    (said,) = _said(tmp_path, (87, 61, 92, 55, 230, 180, 310))
    assert said.check == "torque_scale" and not said.signals
    assert said.message.startswith("each torque is times a number of its own")


@pytest.mark.long
def test_torques_behind_a_joint_in_another_unit_are_told_together(tmp_path):
    """Nothing was said: no one factor explains enough of it."""
    (said,) = _said(tmp_path, (1, 1, 1, 3, 3, 3, 3))
    assert (said.check, said.signals) == ("torque_scale", tuple(f"tau_l{j}" for j in range(4, 8)))
    low, high = (float(x) for x in said.message.split("(")[1].split(")")[0].split(" to "))
    assert low < 3 < high


@pytest.mark.long
def test_what_is_told_of_a_factor_allows_for_what_the_arm_lacks(tmp_path):
    """This arm's sixth torque gains by a factor as it is: 1.6 to 1.9 was told of one of 2."""
    (said,) = _said(tmp_path, (1, 1, 1, 1, 1, 0.5, 1))
    low, high = (float(x) for x in said.message.split("(")[1].split(")")[0].split(" to "))
    assert said.signals[0] == "tau_l6" and low < 2 < high


@pytest.mark.long
@pytest.mark.parametrize("joint", [2, 4])
def test_one_torque_of_another_scale_is_told_alone(tmp_path, joint):
    (said,) = _said(tmp_path, np.where(np.arange(1, 8) == joint, 2.0, 1.0))
    assert (said.check, said.signals) == ("torque_scale", (f"tau_l{joint}",))


@pytest.mark.long
def test_one_torque_of_another_scale_beside_a_delay(tmp_path):
    """Of an AIRBOT's it was told that each is times a number of its own, and nothing of the fourth."""

    def change(log):
        for table in log.tables.values():
            for j in range(1, 7):
                size = 3.0 if j == 4 else 1.0
                table[f"tau_m{j}"] = size * np.interp(table["t"] - 0.3, table["t"], table[f"tau_m{j}"])

    study = strangers_log(tmp_path, "airbot_play", (50, False, False, True), change)
    said = examine_fit(prepare_study(study))
    assert {c.check for c in said} == {"channel_delay", "torque_scale"}
    (told,) = (c for c in said if c.check == "torque_scale")
    assert told.signals[0] == "tau_m4" and told.message.startswith("tau_m4 is 3.")
