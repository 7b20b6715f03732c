"""A robot file whose rows are turned, or of the other Denavit-Hartenberg convention."""

from dataclasses import replace
from importlib.resources import files
from itertools import pairwise

import numpy as np
import pytest
import yaml
from planted import ON_RECORDINGS, asked_of, measured, parted, planted, strangers_log

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit, examine_tables
from ident.examination.robot.axes import OtherTables
from modelgen.geometry.kinematics import Geometry

pytestmark = ON_RECORDINGS


def _with_table(folder, study, change):
    path = files("modelgen").joinpath("robots", f"{study.robot}.yaml")
    table = yaml.safe_load(path.read_text(encoding="utf-8"))
    change(table["links"])
    (folder / "robot.yaml").write_text(yaml.safe_dump(table))
    return study.with_(robot=str(folder / "robot.yaml"))


def _told(folder, robot, change):
    study = measured(robot)
    if robot == "kuka_lwr4plus":
        b, a = study.recordings
        fitted, judged = (
            b.model_copy(update={"use": use, "name": use, "from_s": begin, "to_s": end})
            for use, begin, end in (("identify", None, 14.0), ("validate", 14.0, 19.0))
        )
        a = a.model_copy(update={"use": "identify", "name": "a", "to_s": 24.0})
        study = study.with_(recordings=(a, fitted, judged))
    quick = asked_of(_with_table(folder, study, change)).quick
    geometry = Geometry.of(quick.columns.model.geometry)
    geometry = replace(geometry, gravity=tuple(float(g) for g in geometry.gravity))
    return list(OtherTables(geometry, quick, quick.plain()).told())


def _a_row_higher(*keys):
    def change(links):
        for key in keys:
            values = [link.get(key, 0) for link in links]
            for link, value in zip(links, [*values[1:], 0]):
                link[key] = value

    return change


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("robot", "keys", "words"),
    [
        ("ur10e", ("alpha",), "alpha of every row belongs a row lower"),
        ("ur10e", ("alpha", "d"), "alpha and d of every row belong a row lower; "),
        ("kuka_lwr4plus", ("alpha", "d"), "of every row belong"),  # which has no d
    ],
)
def test_a_table_of_the_other_convention(tmp_path, robot, keys, words):
    """The joints were told to be in another order."""
    (told,) = _told(tmp_path, robot, _a_row_higher(*keys))
    assert words in told.check.message


@pytest.mark.long
def test_a_row_beside_a_torque_that_is_mostly_noise(tmp_path):
    """The last one of an LWR4+, which bodies of its own do not explain either: another's sign was told."""
    (told,) = _told(tmp_path, "kuka_lwr4plus", lambda links: links[1].update(theta="q2 + pi/2"))
    assert "link 2 (joint 2): theta is off by" in told.check.message


def test_a_row_on_the_base_is_another_mounting_of_it(tmp_path):
    """Of a UR10e with gravity along another axis in its study and its third current turned the first row of
    the robot file was told to be wrong."""
    (told,) = _told(tmp_path, "ur10e", lambda links: links[0].update(alpha="pi/2"))
    assert "link 1 (joint 1): alpha is off by" in told.check.message
    assert "or the base is mounted otherwise by as much" in told.check.message


def _rows_exchanged(links):
    for key in ("alpha", "d", "r"):
        one, other = (links[k].get(key, 0) for k in (1, 2))
        links[1][key], links[2][key] = other, one


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_rows_exchanged, "rows 2 and 3 are exchanged"),
        (
            lambda links: links[2].update(joint="prismatic", theta=0, r="q3"),
            "joint 3 slides there, not turns",
        ),
    ],
)
def test_rows_in_each_other_s_place_and_a_joint_of_the_other_kind(tmp_path, change, words):
    """A position and a torque of a Franka's second joint were told as turned, of its third joint nothing."""
    (told,) = _told(tmp_path, "franka_panda", change)
    assert words in told.check.message


def _of_one_run(fitted, judged):
    """Seconds of an LWR4+."""
    study = measured("kuka_lwr4plus")
    run = next(r for r in study.recordings if r.file.startswith("traj_b"))
    runs = [
        run.model_copy(update={"use": use, "name": use, "from_s": begin, "to_s": end})
        for use, (begin, end) in (("identify", fitted), ("validate", judged))
    ]
    return study.with_(recordings=tuple(runs), filter=type(study.filter)())


@pytest.mark.long
def test_a_torque_turned_beside_a_robot_s_own_contradictions_is_no_row(tmp_path):
    """Without an LWR4+'s fifth torque and the sixth a row leaves less of the others, hardly a quarter of what
    one robot does beyond bodies of their own."""
    turned = lambda c: c | {"tau_l5": -c["tau_l5"]}  # noqa: E731
    study = planted(tmp_path, turned, _of_one_run((12.0, 19.3), (19.3, 21.8)))
    assert all(said.check != "joint_axis" for said in examine_fit(prepare_study(study)))


@pytest.mark.long
def test_a_row_beside_torques_that_contradict_the_others_anyway(tmp_path):
    """The last ones of an LWR4+ do: its third torque was told as 3.5 times too small."""
    study = _of_one_run((1.0, 14.9), (14.9, 19.5))
    table = _with_table(tmp_path, study, lambda links: links[1].update(alpha="-pi/2"))
    (told,) = examine_fit(prepare_study(table))
    assert told.check == "joint_axis" and "link 2 (joint 2): alpha is off by pi" in told.message
    assert "without tau_l5, tau_l6, which the others contradict" in told.message


@pytest.mark.long
def test_what_rows_in_each_other_s_place_may_be_as_well(tmp_path, monkeypatch):
    """A rokae's second position and torque alone were told to have the other sign; of an LWR4+'s the fourth
    ones. (Where its table does not come with the package.)"""
    monkeypatch.setattr("ident.examination.believable.known_tables", lambda *_: ())
    study = _with_table(tmp_path, measured("rokae_xmate3pro"), _rows_exchanged)
    (told,) = examine_fit(prepare_study(study))
    assert not told.signals and "or the robot file's rows 2 and 3 are exchanged" in told.message


@pytest.mark.long
@pytest.mark.parametrize(("bits", "check"), [(12, "base_orientation"), (30, "torque_scale")])
def test_what_a_joint_of_the_other_kind_may_be_as_well(tmp_path, bits, check):
    """Six slow seconds of a KR 300: a base was told that is turned by 118 degrees, or a torque that is 54
    times too small, where the table has a sliding joint."""
    step, study = 2 * np.pi / 2**bits, measured("kuka_kr300")
    coarse = lambda c: {k: step * np.round(x / step) if k[0] == "q" else x for k, x in c.items()}  # noqa: E731
    study = parted(study.with_(recordings=study.recordings[:1]), 6.0, 8.0)
    slides = lambda links: links[2].update(joint="prismatic", theta=0, r="q3")  # noqa: E731
    (told,) = examine_fit(prepare_study(_with_table(tmp_path, planted(tmp_path, coarse, study), slides)))
    assert told.check == check and "or the robot file's joint 3 slides there, not turns" in told.message


@pytest.mark.long
def test_a_torque_to_which_another_is_added_is_measured_by_what_was_recorded(tmp_path):
    """Of an LWR4+ with its first two rows exchanged the second position was the sum of the first two: the
    second torque, ten times the first one, was added to that, and of the sum little was left."""

    def exchanged(links):
        for key in ("alpha", "d", "r"):
            links[0][key], links[1][key] = links[1].get(key, 0), links[0].get(key, 0)

    study = measured("kuka_lwr4plus")
    b, a = study.recordings
    parts = ((a, "identify", 1.0, 24.0), (b, "identify", None, 14.0), (b, "validate", 14.0, 19.0))
    runs = [
        entry.model_copy(update={"use": use, "name": f"{k}", "from_s": begin, "to_s": end})
        for k, (entry, use, begin, end) in enumerate(parts)
    ]
    study = _with_table(tmp_path, study.with_(recordings=tuple(runs)), exchanged)
    checks = examine_fit(prepare_study(study.with_(filter=type(study.filter)())))
    assert [c.check for c in checks][:1] == ["joint_axis"] and "rows 1 and 2 are exchanged" in checks[
        0
    ].message


def test_a_length_of_the_other_sign(tmp_path):
    """Of a TX40's gravity was told to be upside down, or the alpha of a link."""
    reverse = lambda links: links[2].update(d=f"-({links[2]['d']})")  # noqa: E731
    (told,) = _told(tmp_path, "ur10e", reverse)
    assert "link 3: d has the other sign" in told.check.message


@pytest.mark.long
def test_columns_that_are_named_as_those_before_them_are_no_other_table(tmp_path):
    """Of a UR10e's header that lost its first name: its joints are its second to its sixth, and no sixth."""

    def change(log):
        for name, c in log.tables.items():
            names = [key for key in c if key != "t"]
            log.tables[name] = c | {key: c[other] for key, other in pairwise(names)}

    prepared = prepare_study(strangers_log(tmp_path, "ur10e", (0, False, True, False), change))
    said = [*examine_tables(prepared), *examine_fit(prepared)]
    assert "dq6 is not the derivative of q6" in said[0].message and "q6" in said[0].signals
    assert not any("robot file seems wrong" in check.message for check in said)


@pytest.mark.long
def test_a_row_whose_lengths_are_exchanged_stands_beside_another_clock(tmp_path):
    """Of a TX40's third, behind which little turns: that t is 2.46 times too large, and nothing else."""

    def change(log):
        row = log.robot["links"][2]
        row["d"], row["r"] = row["r"], row["d"]

    study = strangers_log(tmp_path, "staubli_tx40", (0, False, False, False), change)
    (told,) = examine_fit(prepare_study(study))
    assert "link 3: d and r are exchanged, these recordings do not tell which" in told.message
