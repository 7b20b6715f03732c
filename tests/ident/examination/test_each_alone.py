"""Every measured recording fitted alone, as a person who has only that one would: its data are not blamed.

Of single joints, of poses, of a few seconds most of a robot is not seen; that is said, and no other reason is
made up. Friction of a joint at rest is anything up to that of motion: a UR10e's resting torques were told to
be late, a position that rests to be another's, a first moment that is not seen to be one in N mm.
"""

import pytest
from planted import DATA, ON_RECORDINGS, measured

from ident.estimation.fit import fit_study
from ident.recordings.study import RecordingEntry

pytestmark = ON_RECORDINGS
SAID = {
    "poor_excitation",
    "coarse_signal",
    "resting_joint",
    "spike",
    "time_stamps",
}  # how well the data show the robot
TOLD = {
    "dualarm_v2_7dof": "sensors of one sign beside others of the other",
    "kuka_lwr4plus/traj_a_run1": "joints 6 and 7 move alike and carry next to nothing: told as exchanged",
}
FILES = [
    (path.parent.name, path)
    for path in sorted(DATA.glob("*/*.parquet"))
    if not {path.parent.name, f"{path.parent.name}/{path.stem}"} & TOLD.keys()
]


@pytest.mark.first_case
@pytest.mark.parametrize(("robot", "path"), FILES, ids=[f"{robot}-{path.stem}" for robot, path in FILES])
def test_a_recording_alone_is_not_blamed(robot, path):
    study = measured(robot).with_(recordings=(RecordingEntry(file=str(path)),))
    assert not [check.sentence for check in fit_study(study).checks if check.check not in SAID]
