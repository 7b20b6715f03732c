"""A position from another zero that little of the torques shows, planted in measured recordings."""

import re

import numpy as np
import pytest
from planted import ON_RECORDINGS, asked_of, measured, parted, planted, strangers_log

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.fits.stretches import all_rows
from ident.examination.rivals.other_zeros import other_zeros
from ident.examination.rivals.rivals import of_positions, rivals
from ident.examination.undone import unsettled

pytestmark = ON_RECORDINGS


@pytest.mark.long
@pytest.mark.parametrize(("robot", "j", "degrees", "at"), [("franka_panda", 3, 10, (6.5, 9.8))])
def test_of_a_measured_robot(tmp_path, robot, j, degrees, at):
    """4 % were foretold for 2, and nothing was said."""
    change = lambda c: {k: (x + np.deg2rad(degrees) * (k == f"q{j}"))[::5] for k, x in c.items()}  # noqa: E731
    (told,) = examine_fit(prepare_study(parted(planted(tmp_path, change, measured(robot)), *at)))
    assert (told.check, told.signals) == ("position_zero", (f"q{j}",))
    size = float(told.message.split("another zero, ")[1].split()[0])
    assert size == pytest.approx(np.deg2rad(degrees), rel=0.3)


@pytest.mark.first_case
@pytest.mark.parametrize("robot", ["ur10e", "kuka_kr300", "barrett_wam_2dof", "kuka_lwr4plus", "airbot_play"])
def test_robots_as_they_are_start_from_none(robot):
    assert not list(other_zeros(asked_of(measured(robot))))


def test_a_zero_that_explains_a_part_of_something_else(tmp_path):
    """Of a Barrett whose file has a link too long, and whose second torque is noise, a first zero."""

    def change(log):
        log.robot["links"][1]["d"] += 0.3
        for table in log.tables.values():
            noise = 3 * np.std(table["tau_m2"]) * np.sin(1e9 * 0.3998384329525977 * table["t"] ** 2)
            table["tau_m2"] = table["tau_m2"] + noise

    study = strangers_log(tmp_path, "barrett_wam_2dof", (0, False, True, True), change)
    assert not list(other_zeros(asked_of(study)))


@pytest.mark.long
def test_it_is_told_between_which_ones_it_is(tmp_path):
    """Of a rokae's second position, 10 degrees off, 13 were told, and nothing of what else it may be."""

    def change(log):
        for table in log.tables.values():
            table["q2"] = table["q2"] + np.deg2rad(10)

    study = strangers_log(tmp_path, "rokae_xmate3pro", (0, False, False, True), change)
    (told,) = other_zeros(asked_of(study))
    low, high = map(float, re.search(r"rad off \((\S+) to (\S+) by these torques", told.message).groups())
    assert told.signals == ("q2",) and low < np.deg2rad(10) < high < 3 * low + 0.1


@pytest.mark.long
def test_a_zero_by_which_stretches_gain_unlike_amounts(tmp_path):
    """Of an AIRBOT's third position, 30 degrees off, nothing was said: all of twenty stretches gain, one of
    them a thousand times as much as another."""

    def change(log):
        for table in log.tables.values():
            table["q3"] = table["q3"] + np.pi / 6

    (told,) = other_zeros(asked_of(strangers_log(tmp_path, "airbot_play", (100, False, False, True), change)))
    assert told.check == "position_zero" and "q3 starts from another zero, 0.53 rad off" in told.message


@pytest.mark.long
def test_a_zero_of_a_radian(tmp_path):
    """0.82 rad were told: no step went beyond 0.9."""
    change = lambda c: {k: (x + (k == "q3"))[::5] for k, x in c.items()}  # noqa: E731
    (told,) = other_zeros(asked_of(parted(planted(tmp_path, change, measured("franka_panda")), 6.5, 9.8)))
    assert unsettled([told]) == (told,)
    assert told.message.startswith("q3 starts from another zero, 0.98 rad off (")


def test_a_number_that_steps_did_not_come_to_is_none():
    """Of 1.5 rad -0.73 were left where they ended."""
    asked = asked_of(parted(measured("franka_panda"), 6.5, 9.8))
    quick = all_rows(asked.quick.moved(offset=np.where(np.arange(7) == 1, 1.5, 0.0)))
    each = [its for its in of_positions(quick, quick.fit(asked.how), asked.how) if its.joint == 1]
    assert not next(its for its in each if its.check == "position_zero").settled


@pytest.mark.long
@pytest.mark.parametrize("j", [2, 3])
def test_a_zero_of_which_one_torque_says_most(tmp_path, j):
    """17 % were left of an AIRBOT's fifth torque for 8, and nothing was said; nor is the second position told
    for the third, which says as much but for a fiftieth."""
    change = lambda c: {k: (x + np.deg2rad(10) * (k == f"q{j}"))[::2] for k, x in c.items()}  # noqa: E731
    (told,) = other_zeros(asked_of(planted(tmp_path, change, measured("airbot_play"))))
    assert f"q{j} starts from another zero, 0.1" in told.message
    assert ("q2 starts" in told.message) == ("q3 starts" in told.message)


@pytest.mark.long
def test_two_positions_from_other_zeros_are_no_torque_without_bodies(tmp_path):
    """Of an LWR4+'s fifth torque it was told that it shows friction alone, or does not feel gravity."""

    def change(log):
        for table in log.tables.values():
            table["q2"], table["q3"] = table["q2"] - 0.2, table["q3"] + 0.2

    study = strangers_log(tmp_path, "kuka_lwr4plus", (100, False, False, True), change)
    (told, *_) = examine_fit(prepare_study(study))
    assert (told.check, told.signals) == ("position_zero", ("q2",))
    assert float(told.message.split("another zero, ")[1].split()[0]) == pytest.approx(-0.2, rel=0.3)


SWUNG = """\
name: swung
convention: mdh
gravity: [6, 0, -8]
links:
  - {joint: revolute, antecedent: 0, alpha: 1.234, d: 0, theta: q1 - pi/2, r: 0.25}
  - {joint: prismatic, antecedent: 1, alpha: 1.234, d: -0.3, theta: -pi/2, r: q2 + 0.25}
  - {joint: fixed, antecedent: 2, alpha: pi/2, d: 0, theta: pi/3, r: 0.4}
  - {joint: revolute, antecedent: 3, alpha: pi, d: -0.3, theta: q3, r: 0}
"""


@pytest.mark.long
@pytest.mark.parametrize("gear", ["joint_elasticity", "hysteretic_gear"])
def test_a_gear_that_bends_is_no_other_position(tmp_path, gear):
    """(q1 was told to be 1.05 to 1.1 times too small in 8 of 12 such cases.)"""
    (tmp_path / "robot.yaml").write_text(SWUNG)
    twin = ident.simulate(
        tmp_path / "robot.yaml", effects=[f"{gear}:1"], duration=30, rate_hz=200, noise=1.0, seed=47
    )
    checks = ident.fit(twin.study).document()["checks"]
    assert not {"angle_unit", "position_zero"} & {check["check"] for check in checks}


def test_beside_a_zero_stand_joints_in_each_others_place(tmp_path):
    """Of a UR10e at 100 Hz with its last two joints exchanged the fourth position was told to start 1.5 rad
    off: that explains less than the exchange does."""

    def change(log):
        for table in log.tables.values():
            for a, b in [(f"{kind}5", f"{kind}6") for kind in ("q", "dq", "i")]:
                table[a], table[b] = table[b], table[a]

    asked = asked_of(strangers_log(tmp_path, "ur10e", (100, False, True, False), change))
    whole = all_rows(asked.quick)
    plain = whole.fit(asked.how)
    gains = {r.words: r.explained.fit.gain_over(plain) for r in rivals(asked, whole, asked.how)}
    zeros = [gain for words, gain in gains.items() if "another zero" in words and words[0] == "q"]
    exchange = "joints 5 and 6 are exchanged, positions and torques"
    assert gains[exchange] > max(zeros)
    assert all(exchange in check.message for check in other_zeros(asked))
