"""A position in another unit, and what only looks like one."""

import numpy as np
import pyarrow as pa
import pytest
import yaml
from planted import ON_RECORDINGS, asked_of, measured, parted, planted, strangers_log
from two_links import TWO_LINKS

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.positions.units import degrees, geared
from ident.examination.undone import undoing, unsettled
from ident.twin import simulate


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "two_links.yaml"
    path.write_text(TWO_LINKS)
    return path


def _checks(arm, effect):
    made = simulate(arm, effects=(effect,), seed=3)
    runs = [ident.Recording(pa.table(dict(r.columns)), r.use, name=r.label) for r in made.recordings]
    study = ident.Study(robot=str(arm), recordings=runs)
    return [c for c in ident.fit(study).checks if c.check == "angle_unit"]


@pytest.mark.parametrize(("turned", "open_"), [((1, 2), True), ((2,), False)])
def test_a_diagnosis_begins_with_positions_that_no_arm_has_in_rad(arm, turned, open_):
    """One joint may go beyond two turns, and not all that move."""
    (run, *_) = simulate(arm, seed=3).recordings
    columns = {name: x for name, x in run.columns.items() if not name.startswith("dq")}
    for j in turned:
        columns[f"q{j}"] = 40.0 * columns[f"q{j}"] / np.abs(columns[f"q{j}"]).max()
    (stream,) = prepare_study(
        ident.Study(robot=str(arm), recordings=[ident.Recording(pa.table(columns), "identify", name="run")])
    ).streams
    (told,) = (c for c in stream.checks if c.check == "angle_unit")
    assert (told.open, told.signals) == (open_, tuple(f"q{j}" for j in turned))
    assert ([*unsettled([told])] != []) == open_


@pytest.mark.parametrize("largest", [40.0, 700.0])
def test_a_position_in_whole_numbers_is_in_counts(arm, largest):
    """Of a KR 300's sixth in counts of 4096 a turn degrees were told, its motor or another signal."""
    (run, *_) = simulate(arm, seed=3).recordings
    columns = {name: x for name, x in run.columns.items() if not name.startswith("dq")}
    columns["q2"] = np.rint(largest * columns["q2"] / np.abs(columns["q2"]).max())
    study = ident.Study(robot=str(arm), recordings=[ident.Recording(pa.table(columns), "identify")])
    with pytest.raises(ident.Error, match="q2 looks like an encoder's counts, or degrees"):
        prepare_study(study)


@pytest.mark.first_case
@pytest.mark.parametrize("stiffness", [1.0, 5.0, 20.0])
@pytest.mark.parametrize("joint", [1, 2])
def test_a_spring_is_no_position_in_another_unit(arm, joint, stiffness):
    """sin(q / 2) is nearly k q."""
    assert not _checks(arm, f"spring:{joint}:k={stiffness},q0=0")


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(("joint", "factor"), [(2, 2.0)])
def test_a_measured_position_in_another_unit_is_told(tmp_path, joint, factor):
    names = {f"{d}q{joint}" for d in ("", "d", "dd")}
    study = planted(tmp_path, lambda c: {k: factor * v if k in names else v for k, v in c.items()})
    (said,) = [c for c in examine_fit(prepare_study(study)) if c.check == "angle_unit"]
    assert said.signals == (f"q{joint}",) and f"scale: {1 / factor:g}" in said.remedy
    assert said.message.count("times too large") == 1  # "or 2.01 times too large"


@pytest.mark.first_case
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(("joint", "factor", "long"), [(4, 2.0, False), (3, 0.5, True)])
def test_a_measured_position_in_another_unit_in_one_run(tmp_path, joint, factor, long):
    """Of the fourth one nothing was said, fitted or judged; of the third one that it is so in all."""
    names = {f"{d}q{joint}" for d in ("", "d", "dd")}
    here = lambda c: (np.ptp(c["t"]) > 40) == long  # noqa: E731
    change = lambda c: {k: factor * v if k in names and here(c) else v for k, v in c.items()}  # noqa: E731
    (said,) = examine_fit(prepare_study(planted(tmp_path, change)))
    recording = "excite_a_50s" if long else "excite_c_30s"
    assert (said.check, said.signals, said.recording) == ("angle_unit", (f"q{joint}",), recording)
    assert f"scale: {1 / factor:g}" in said.remedy


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.long
@pytest.mark.parametrize(("robot", "joint", "ratio"), [("kuka_lwr4plus", 4, -30.0)])
def test_a_measured_position_of_the_motors_side(tmp_path, robot, joint, ratio):
    """It was told that two positions look exchanged."""
    names = {f"{d}q{joint}" for d in ("", "d", "dd")}
    change = lambda c: {k: ratio * v if k in names else v for k, v in c.items()}  # noqa: E731
    study = measured(robot)
    (said,) = examine_fit(prepare_study(planted(tmp_path, change, study)))
    assert (said.check, said.signals) == ("angle_unit", (f"q{joint}",))
    told = yaml.safe_load(said.remedy)["columns"][f"q{joint}"]
    assert told["scale"] * told.get("sign", 1) * ratio == pytest.approx(1.0, abs=4 * said.spread)


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(("robot", "torque"), [("barrett_wam_2dof", "tau_m2"), ("kuka_lwr4plus", "tau_l2")])
def test_a_measured_joint_of_the_motors_side(tmp_path, robot, torque):
    """Of an LWR4+ its position was told as 258 times too large and turned, another torque as 347 times."""
    factors = {"q2": 100.0, "dq2": 100.0, torque: 0.01}
    change = lambda c: {k: factors.get(k, 1.0) * v for k, v in c.items()}  # noqa: E731
    asked = asked_of(planted(tmp_path, change, measured(robot)))
    (told,) = (h.check for h in geared(asked))
    assert told.signals == ("q2", torque) and "too large" in told.message
    columns = yaml.safe_load(told.remedy)["columns"]
    assert columns["q2"]["scale"] * 100 == pytest.approx(1.0, abs=4 * told.spread)
    assert columns[torque]["scale"] * columns["q2"]["scale"] == pytest.approx(1.0, rel=1e-3)


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("joints", [(3,), (1, 2, 3, 4, 5, 6)])
def test_measured_positions_in_turns(tmp_path, joints):
    """Nothing was said of either."""
    turns = {f"{d}q{j}" for j in joints for d in ("", "d", "dd")}
    study = planted(tmp_path, lambda c: {k: v / (2 * np.pi) if k in turns else v for k, v in c.items()})
    (said,) = examine_fit(prepare_study(study))
    assert (said.check, said.signals) == ("angle_unit", tuple(f"q{j}" for j in joints))
    scales = [its["scale"] for its in yaml.safe_load(said.remedy)["columns"].values()]
    assert scales == pytest.approx([2 * np.pi] * len(scales), rel=1e-5)


@pytest.mark.first_case
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(
    ("robot", "to_a_rad", "joints", "words"),
    [
        ("ur10e", 200 / np.pi, range(1, 7), "the positions are in gon (63.7 to a rad, "),
        ("ur10e", 180 / np.pi, range(1, 7), "the positions are in degrees (57.3 to a rad, "),
        (
            "barrett_wam_2dof",
            1800 / np.pi,
            range(1, 3),
            "in a unit that is not told, or each times the ratio of its own gear",
        ),
        (  # the others hardly move beside it, or are in that unit
            "dualarm_v2_7dof",
            200 / np.pi,
            [2],
            "q2 is in degrees, or the motor's side of a gear of about that ratio (57.3 to a rad, ",
        ),
    ],
)
def test_measured_positions_in_a_unit(tmp_path, robot, to_a_rad, joints, words):
    """Of gon degrees were told, and of the last one that all positions are in them. Of a UR10e and an AIRBOT
    whose motors were recorded, behind gears of 51 to 101, that all of them are 97 to 107 times too large."""
    names = {f"{d}q{j}" for j in joints for d in ("", "d")}
    change = lambda c: {k: to_a_rad * v if k in names else v for k, v in c.items()}  # noqa: E731
    study, (first, second, *_) = measured(robot), measured(robot).recordings
    if robot == "dualarm_v2_7dof":
        runs = first, second.model_copy(update={"use": "validate"})
        sensors = tuple(f"tau_l{j}" for j in range(1, 5))
        study = study.with_(model="B", drive_gains=None, channels=sensors, recordings=runs)
    study = planted(tmp_path, change, study)
    if robot == "ur10e":
        study = parted(study.with_(recordings=(first,)), 30.0, 45.0)
    told = [h.check for h in degrees(asked_of(study))]
    (check,) = told
    scale = float(check.remedy.split("scale: ")[1].split("}")[0])
    assert words in check.message
    assert scale * to_a_rad == pytest.approx(1.0, rel=1e-4 if words.startswith("the positions") else 0.15)
    assert ("own gear's ratio" in check.remedy) == ("own" in check.message) == ("its own gear" in words)


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_the_gear_of_a_first_joint_that_only_inertia_tells(tmp_path):
    """Of a rokae's position times 100 degrees were told."""
    change = lambda c: {k: 100 * x if k in ("q1", "dq1") else x for k, x in c.items()}  # noqa: E731
    study = parted(planted(tmp_path, change, measured("rokae_xmate3pro")), 7.0, 9.7)
    (said,) = examine_fit(prepare_study(study))
    assert said.check == "angle_unit" and said.signals == ("q1",) and "degrees" not in said.message
    assert 0 < float(said.message.split("(")[1].split(" or more)")[0]) < 100


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_first_joint_in_degrees_with_the_other_sign(tmp_path):
    """It was told to be 1820 times too large, 59.8 or more, and nothing of its sign."""
    change = lambda c: {k: -180 / np.pi * x if k in ("q1", "dq1") else x for k, x in c.items()}  # noqa: E731
    (said,) = examine_fit(prepare_study(planted(tmp_path, change, measured("airbot_play"))))
    assert said.signals == ("q1",) and "and has the other sign" in said.message
    assert 0 < float(said.message.split("(")[1].split(" or more)")[0]) < 180 / np.pi
    assert said.remedy.count("sign: -1") == 2


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_where_no_gear_is_too_large_no_largest_one_is_told(tmp_path):
    """Only inertia tells how far an AIRBOT's first joint turns: times 121, it was told as 62 to 113 times."""
    change = lambda c: {k: 121 * x if k in ("q1", "dq1") else x for k, x in c.items()}  # noqa: E731
    study = measured("airbot_play")
    runs = tuple(next(e for e in study.recordings if e.use == use) for use in ("identify", "validate"))
    asked = asked_of(planted(tmp_path, change, study.with_(recordings=runs)))
    (told,) = (h.check for h in geared(asked))
    assert told.signals == ("q1",)
    assert 0 < float(told.message.split("(")[1].split(" or more)")[0]) < 121


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(
    ("joint", "ratio", "sign"), [(1, -101, "the other"), (5, -101, "the other"), (6, 50, "either")]
)
def test_a_measured_joint_of_the_motors_side_in_the_run_that_judges(tmp_path, joint, ratio, sign):
    """Joints 1 and 5 of a UR10e were told to look swapped, of its sixth the sign that it did not have."""

    def change(log):
        table = log.tables["run2"]
        table[f"q{joint}"], table[f"i{joint}"] = ratio * table[f"q{joint}"], table[f"i{joint}"] / ratio

    checks = examine_fit(prepare_study(strangers_log(tmp_path, "ur10e", (100, False, False, False), change)))
    assert [(c.check, c.signals, c.recording) for c in checks] == [
        ("angle_unit", (f"q{joint}", f"i{joint}"), "run2")
    ]
    assert f"times too large with {sign} sign and i{joint} as many times too small" in checks[0].message


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_of_motors_in_the_place_of_joints_nothing_is_told_of_the_base(tmp_path):
    """Of a TX40 behind gears of 51 to 101: that it may hang upside down, by 6 to 24 % for as much."""

    def change(log):
        for table in log.tables.values():
            for j, gear in enumerate((101, 101, 101, 80, 80, 51), 1):
                table[f"q{j}"] *= gear
                table[f"tau_m{j}"] /= gear

    study = strangers_log(tmp_path, "staubli_tx40", (100, False, False, False), change)
    prepared = prepare_study(study)
    assert all(c.check == "angle_unit" for stream in prepared.streams for c in stream.checks)
    assert not examine_fit(prepared)


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_position_in_degrees_beside_a_turned_torque(tmp_path):
    """Of an LWR4+ its fourth position was told to be exchanged with the seventh, whose motion is the same:
    degrees explained more, but did not halve what the turned torque left of the others."""

    def change(log):
        for table in log.tables.values():
            table["tau_l2"] = -table["tau_l2"]
            table |= {name: np.degrees(table[name]) for name in ("q4", "dq4")}

    checks = examine_fit(prepare_study(strangers_log(tmp_path, "kuka_lwr4plus", (0, 0, True, False), change)))
    assert [undoing(c) for c in checks] == [
        {"columns": {name: {"scale": 0.0174533} for name in ("q4", "dq4")}},
        {"columns": {"tau_l2": {"sign": -1}}},
    ]
