"""Torques that are smoothed in one recording alone, beside recordings as they are."""

import pytest
import scipy.signal
from planted import ON_RECORDINGS, measured, strangers_log

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_tables
from ident.examination.tables.limits import reads_currents
from ident.examination.tables.smoother_here import smoother_here

pytestmark = ON_RECORDINGS


@pytest.mark.parametrize(
    ("robot", "names"), [("rokae_xmate3pro", ["tau_l2"]), ("ur10e", [f"i{j}" for j in range(1, 7)])]
)
def test_what_is_smoothed_in_one_recording(tmp_path, robot, names):
    """Of both nothing was said, though 9.7 % were left for 3.3, and 6.4 for 4.8."""

    def change(log):
        low = scipy.signal.butter(2, 1.0, fs=100, output="sos")
        table = log.tables["run3"]
        table |= {name: scipy.signal.sosfiltfilt(low, table[name]) for name in names}

    study = strangers_log(tmp_path, robot, (100, False, False, True), change)
    (said,) = [check for check in examine_tables(prepare_study(study)) if check.check == "smoothed_torque"]
    assert list(said.signals) == names and said.recording == "run3"
    assert "far smoother than in the other recordings" in said.message


@pytest.mark.parametrize("robot", ["ur10e", "airbot_play", "barrett_wam_2dof", "kinova_gen3_joint7_friction"])
def test_recordings_as_they_are(robot):
    prepared = prepare_study(measured(robot))
    assert not list(smoother_here(prepared.streams, reads_currents(prepared)))
