"""A base's gravity is told with how well it is known, beside another zero of a joint, too."""

import re

import numpy as np
import pyarrow as pa
import pytest
from planted import ON_RECORDINGS, measured, planted, strangers_log
from small_arm import ARM

import ident
from benchmarks.planted_faults import tilted
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.fits.quick import quick_of
from ident.examination.fits.samples import take
from ident.examination.fits.stretches import all_rows
from ident.examination.robot.gravity import direction
from ident.twin import PlannedRun, simulate
from modelgen.geometry.kinematics import Geometry

LEVEL = np.array([0.0, 0.0, -9.81])


def _told(study, start):
    made = prepare_study(study)
    columns, roles = made.columns, ("identify", "validate")
    samples = [s for role in roles for s in take(made.streams, made.banks, columns, role)]
    whole = all_rows(quick_of(columns, samples))
    return direction(Geometry.of(columns.model.geometry), whole, whole.plain(), np.array(start))


def _degrees(one, other):
    return np.degrees(np.arccos(one @ other / np.linalg.norm(one) / np.linalg.norm(other)))


def _simulated(robot, seconds, zero):
    plan = (PlannedRun("run1", "identify", seconds), PlannedRun("run2", "validate", seconds))
    runs = [(its, dict(its.columns)) for its in simulate(robot, runs=plan, seed=5).recordings]
    return [ident.Recording(pa.table(c | {"q2": c["q2"] + zero}), its.use, name=its.label) for its, c in runs]


@pytest.mark.first_case
@pytest.mark.parametrize("zero", [0.0, 0.3])
def test_gravity_of_a_simulated_arm_is_where_it_is_said_to_be(zero):
    told = _told(ident.Study(robot="ur10e", recordings=_simulated("ur10e", 20.0, zero)), (9.0, 0.0, 3.9))
    assert _degrees(told.gravity, LEVEL) <= told.within <= 3


def test_where_first_moments_make_up_for_gravity_that_is_turned_over_it_is_not_known(tmp_path):
    """Inertia hardly shows beside friction of a small arm."""
    truth = np.array([3.4, -4.8, -7.85])
    (tmp_path / "tilted.yaml").write_text(ARM.replace("[0, 0, -9.81]", str(truth.tolist())))
    (tmp_path / "level.yaml").write_text(ARM)
    runs = _simulated(tmp_path / "tilted.yaml", 20.0, 0.0)
    told = _told(ident.Study(robot=str(tmp_path / "level.yaml"), recordings=runs), LEVEL)
    assert min(_degrees(told.gravity, g) for g in (truth, -truth)) < 0.5 and told.within == 180


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_what_one_recording_has_elsewhere_all_rows_find(tmp_path):
    """By the fitted seconds of a rokae on a wall whose second joint has another zero gravity was told that is
    120 degrees off."""
    study = planted(tmp_path, lambda c: c | {"q2": c["q2"] + 0.3}, measured("rokae_xmate3pro"))
    told = _told(study.with_(filter=type(study.filter)()), (-8.27, 1.98, 4.9))
    assert _degrees(told.gravity, LEVEL) <= told.within <= 5


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_an_axis_of_the_base_is_told_where_gravity_is_hardly_known(tmp_path):
    """Of a few seconds of a TX40 on a wall a gravity was told that is 7 degrees off."""
    study = planted(tmp_path, lambda c: c | {"q2": c["q2"] + 0.3}, measured("staubli_tx40"))
    checks = examine_fit(prepare_study(study.with_(gravity=(9.81, 0, 0), filter=type(study.filter)())))
    (said,) = [c for c in checks if c.check == "base_orientation"]
    assert said.remedy == "gravity: [0, 0, -9.81]"
    assert 7 < float(re.search(r"within (\d+) degree", said.message)[1]) < 30


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_six_joints_may_not_show_which_way_up_the_base_is(tmp_path):
    """An AIRBOT's first moments made up for gravity upside down, 6.2 % were 7.5, and nothing was said."""
    turned = lambda log: tilted(180)(log.study, log.base)  # noqa: E731
    study = strangers_log(tmp_path, "airbot_play", (100, False, False, True), turned)
    (check,) = examine_fit(prepare_study(study))
    assert check.check == "poor_excitation" and "gravity turned by 180 degrees" in check.message


@pytest.mark.long
@pytest.mark.parametrize(
    ("told", "words"),
    [
        ([0, 0, 9.81], "gravity is turned by 180 degrees against the study's"),
        ([0, 0, 0], "gravity is not zero, as the study's is: these torques feel what the arm weighs"),
    ],
)
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_gravity_of_a_study_is_told_as_its_own(tmp_path, told, words):
    """The robot file's, which was right, was told to be 180 degrees off, and none to be off by 90."""

    def change(log):
        log.study["gravity"] = told

    (said,) = examine_fit(
        prepare_study(strangers_log(tmp_path, "airbot_play", (0, False, True, False), change))
    )
    assert said.message.startswith(words) and said.remedy == "gravity: [0, 0, -9.81]"
