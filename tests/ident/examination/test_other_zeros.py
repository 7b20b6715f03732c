"""A position from another zero that little of the torques shows, planted in measured recordings."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, asked_of, measured, parted, planted

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.other_zeros import other_zeros

pytestmark = ON_RECORDINGS


@pytest.mark.parametrize(("robot", "j", "degrees", "at"), [("franka_panda", 3, 10, (6.5, 9.8))])
def test_of_a_measured_robot(tmp_path, robot, j, degrees, at):
    """4 % were foretold for 2, and nothing was said."""
    change = lambda c: {k: (x + np.deg2rad(degrees) * (k == f"q{j}"))[::5] for k, x in c.items()}  # noqa: E731
    (told,) = examine_fit(prepare_study(parted(planted(tmp_path, change, measured(robot)), *at)))
    assert (told.check, told.signals) == ("position_zero", (f"q{j}",))
    size = float(told.message.split("another zero, ")[1].split()[0])
    assert size == pytest.approx(np.deg2rad(degrees), rel=0.3)


@pytest.mark.parametrize("robot", ["ur10e", "kuka_kr300", "barrett_wam_2dof", "kuka_lwr4plus", "airbot_play"])
def test_robots_as_they_are_start_from_none(robot):
    assert not list(other_zeros(asked_of(measured(robot))))
