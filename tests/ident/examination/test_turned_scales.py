"""A torque of the motor's side of a gear that reverses."""

import pytest
from planted import ON_RECORDINGS, measured, parted, planted

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(("robot", "name"), [("airbot_play", "tau_m5"), ("franka_panda", "tau_l5")])
def test_a_torque_turned_and_divided_by_thirty(tmp_path, robot, name):
    """Of a Franka the sixth torque was unexplained; of an AIRBOT the fourth is not the turned one."""
    study = planted(tmp_path, lambda c: c | {name: c[name] / -30}, measured(robot))
    checks = examine_fit(prepare_study(parted(study, 6.5, 9.8) if robot == "franka_panda" else study))
    turned = [c for c in checks if c.check == "torque_sign" or "other sign" in c.message]
    assert turned and all(c.signals == (name,) for c in turned)
