"""A length of a robot file that is another one, and robots as they are."""

import pytest
from planted import ON_RECORDINGS, asked_of, measured, strangers_log

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.robot.lengths import lengths

pytestmark = ON_RECORDINGS


def _said(study):
    return list(lengths(prepare_study(study), asked_of(study)))


def test_a_length_that_is_too_large(tmp_path):
    """Of a Franka's second link 17 % were foretold for 3, and nothing was said."""

    def change(log):
        log.robot["links"][1]["r"] = f"{log.robot['links'][1]['r']} + 0.3"

    (told,) = _said(strangers_log(tmp_path, "franka_panda", (50, False, True, True), change))
    assert told.check.message.startswith("the robot file's link 2: r is about 0.3 m too large: ")


@pytest.mark.first_case
@pytest.mark.parametrize("robot", ["ur10e", "kuka_kr300", "barrett_wam_2dof", "kuka_lwr4plus", "airbot_play"])
def test_robots_as_they_are_have_the_lengths_of_their_files(robot):
    assert not _said(measured(robot))


@pytest.mark.long
def test_a_length_is_no_clock(tmp_path):
    """Of an LWR4+'s fourth link with 0.3 m too much all stamps were told to be 5 times too small."""

    def change(log):
        log.robot["links"][3]["d"] = f"{log.robot['links'][3].get('d', 0)} + 0.3"

    study = strangers_log(tmp_path, "kuka_lwr4plus", (0, False, False, True), change)
    (told,) = examine_fit(prepare_study(study))
    assert told.message.startswith("the robot file's link 4: d is about 0.3")
