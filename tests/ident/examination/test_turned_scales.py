"""A torque of the motor's side of a gear that reverses."""

import pytest
from planted import ON_RECORDINGS, measured, parted, planted

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.long
def test_a_torque_turned_and_divided_by_thirty(tmp_path):
    """The sixth torque of a Franka was unexplained."""
    study = planted(tmp_path, lambda c: c | {"tau_l5": c["tau_l5"] / -30}, measured("franka_panda"))
    checks = examine_fit(prepare_study(parted(study, 6.5, 9.8)))
    turned = [c for c in checks if c.check == "torque_sign" or "other sign" in c.message]
    assert turned and all(c.signals == ("tau_l5",) for c in turned)
