"""A robot file whose rows are turned, or of the other Denavit-Hartenberg convention."""

from importlib.resources import files

import numpy as np
import pytest
import yaml
from planted import ON_RECORDINGS, asked_of, measured

from ident.examination.axes import joint_axes
from modelgen.geometry.kinematics import Geometry

pytestmark = ON_RECORDINGS


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
    path = files("modelgen").joinpath("robots", f"{study.robot}.yaml")
    table = yaml.safe_load(path.read_text(encoding="utf-8"))
    change(table["links"])
    (folder / "robot.yaml").write_text(yaml.safe_dump(table))
    quick = asked_of(study.with_(robot=str(folder / "robot.yaml"))).quick
    geometry = Geometry.of(quick.columns.model.geometry)
    gravity = np.array([float(g) for g in geometry.gravity])
    return list(joint_axes(geometry, quick.columns, quick.samples, gravity, quick.plain()))


def _a_row_higher(*keys):
    def change(links):
        for key in keys:
            values = [link.get(key, 0) for link in links]
            for link, value in zip(links, [*values[1:], 0]):
                link[key] = value

    return change


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


def test_a_row_beside_a_torque_that_is_mostly_noise(tmp_path):
    """The last one of an LWR4+, which bodies of its own do not explain either: another's sign was told."""
    (told,) = _told(tmp_path, "kuka_lwr4plus", lambda links: links[1].update(theta="q2 + pi/2"))
    assert "link 2 (joint 2): theta is off by" in told.check.message


def _rows_exchanged(links):
    for key in ("alpha", "d", "r"):
        one, other = (links[k].get(key, 0) for k in (1, 2))
        links[1][key], links[2][key] = other, one


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
