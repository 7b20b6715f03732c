"""A spring that a model lacks is no factor of its joint's torque."""

from planted import asked_of
from small_arm import ARM

from ident.examination.fits.stretches import all_rows
from ident.examination.rivals.rivals import rivals
from ident.examination.rivals.scales import scales
from ident.recordings.study import load_study
from ident.twin import PlannedRun, Sensors, simulate, write_simulation

RUNS = (PlannedRun("run1", "identify", 9.0), PlannedRun("run2", "validate", 6.0))


def test_it_is_told_from_a_factor(tmp_path):
    """Of an arm with sensors, whose second drive a spring of 7.7 N m/rad pulled, tau_m2 was told to be 1.1
    times too small, and that was undone."""
    (tmp_path / "robot.yaml").write_text(ARM)
    made = simulate(
        tmp_path / "robot.yaml", "C", ("spring:2:k=4",), seed=3, sensors=Sensors(rate_hz=200.0), runs=RUNS
    )
    asked = asked_of(load_study(write_simulation(made, tmp_path / "arm")))
    told = [rival.words for rival in rivals(asked, all_rows(asked.quick), asked.how)]
    assert "the model lacks a spring on joint 2" in told
    assert not list(scales(asked))
