"""Joints that rest, or go one way, beside others that turn."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from small_arm import ARM

from ident.diagnosis import diagnose_study
from ident.recordings.study import load_study
from ident.twin import PlannedRun, Sensors, simulate, write_simulation


def resting(tmp_path, noise):
    """A study of a small arm whose third joint's encoder says that it rests."""
    (tmp_path / "robot.yaml").write_text(ARM)
    runs = (PlannedRun("run1", "identify", 14.0), PlannedRun("run2", "validate", 10.0))
    made = simulate(tmp_path / "robot.yaml", "A", (), seed=3, sensors=Sensors(rate_hz=200.0), runs=runs)
    study = load_study(write_simulation(made, tmp_path / "out"))
    for entry in study.recordings:
        path, rng = study.recording_path(entry), np.random.default_rng(1)
        columns = {name: np.asarray(c) for name, c in pq.read_table(path).to_pydict().items()}
        columns["q3"] = 0.3 + noise * rng.normal(size=len(columns["q3"]))
        columns = {name: c for name, c in columns.items() if name != "dq3"}
        pq.write_table(pa.table({name: pa.array(c) for name, c in columns.items()}), path)
    return study


@pytest.mark.parametrize("noise", [0.0, 1e-5])
@pytest.mark.long
def test_a_resting_joint_is_no_end(tmp_path, noise):
    """A joint without a reversal has no width to settle: it was asked for one."""
    d = diagnose_study(resting(tmp_path, noise))
    assert any(check.check == "resting_joint" for check in d.checks)
    assert not any(f.effect in ("stribeck_friction", "hysteresis") and f.joints == (3,) for f in d.findings)


@pytest.mark.long
def test_a_resting_joint_hides_nothing_of_the_others(tmp_path):
    """A channel without rows said minus infinity of every hypothesis: nothing was found on any joint."""
    d = diagnose_study(resting(tmp_path, 0.0).with_(without=("viscous_friction",)))
    told = {joint for f in d.findings if f.effect == "viscous_friction" for joint in f.joints}
    assert {1, 2} <= told
