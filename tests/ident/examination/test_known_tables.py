"""A robot file that is of another robot than the recordings, where the right one comes with the package."""

from importlib.resources import files

import pytest
import yaml
from planted import ON_RECORDINGS, asked_of, measured, strangers_log

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.robot.known_tables import known_tables

pytestmark = ON_RECORDINGS


def _said(study):
    return list(known_tables(prepare_study(study), asked_of(study), ()))


def _of(robot):
    def change(log):
        table = files("modelgen").joinpath("robots", f"{robot}.yaml").read_text(encoding="utf-8")
        log.robot = yaml.safe_load(table)

    return change


@pytest.mark.long
@pytest.mark.parametrize(
    ("robot", "other"),
    [
        ("ur10e", "kuka_kr300"),  # lengths 9.15 times too large were told, or another clock
        ("franka_panda", "rokae_xmate3pro"),  # another zero of q3, or q2 turned
        ("rokae_xmate3pro", "kuka_lwr4p"),
    ],
)
def test_the_right_table_is_named(tmp_path, robot, other):
    (told,) = examine_fit(
        prepare_study(strangers_log(tmp_path, robot, (100, False, False, False), _of(other)))
    )
    assert told.check == "wrong_robot" and told.message.startswith(f"the table of {robot} ")
    assert f"write robot: {robot}" in told.remedy


@pytest.mark.first_case
def test_a_row_that_is_another_one_is_named(tmp_path):
    def change(log):
        log.robot["links"][3]["alpha"] = "pi/2"

    (told,) = _said(strangers_log(tmp_path, "ur10e", (100, False, False, False), change))
    assert "which is another in link 4: so taken" in told.check.message


@pytest.mark.parametrize("robot", ["ur10e", "kuka_kr300", "franka_panda", "kuka_lwr4plus", "airbot_play"])
def test_robots_as_they_are_have_their_own_tables(robot):
    assert not _said(measured(robot))
