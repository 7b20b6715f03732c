"""What is told has to explain enough: of either half, of more torques than one, and of what judges."""

from importlib.resources import files

import numpy as np
import yaml
from planted import ON_RECORDINGS, measured, planted

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit

pytestmark = ON_RECORDINGS


def _told(folder, name, file, begin, seconds, change=lambda c: c, **keys):
    """Checks of six tenths of these seconds, and of two that judge."""
    study = measured(name)
    entry = next(e for e in study.recordings if e.file.startswith(file))
    parts = (("identify", 0.0, 0.6), ("validate", 0.6, 0.8))
    runs = [
        entry.model_copy(
            update={"use": u, "name": u, "from_s": begin + a * seconds, "to_s": begin + b * seconds}
        )
        for u, a, b in parts
    ]
    study = study.with_(recordings=tuple(runs), filter=type(study.filter)(), **keys)
    return examine_fit(prepare_study(planted(folder, change, study)))


def test_four_seconds_of_late_torques(tmp_path):
    """Of an LWR4+ the fifth joint was told to turn the other way, beside two other causes."""

    def late(c):
        return c | {k: np.interp(c["t"] - 0.02, c["t"], x) for k, x in c.items() if k.startswith("tau")}

    checks = _told(tmp_path, "kuka_lwr4plus", "traj_b", 11.1, 7.0, late)
    assert {c.check for c in checks} <= {"wrong_robot"}  # "or motions that have nothing in common"


def test_an_axis_that_one_torque_alone_feels(tmp_path):
    """Two joints of an LWR4+ were told to be exchanged, by the last torque, which is hardly any."""
    path = files("modelgen").joinpath("robots", f"{measured('kuka_lwr4plus').robot}.yaml")
    table = yaml.safe_load(path.read_text(encoding="utf-8"))
    table["links"][5]["alpha"] = f"-({table['links'][5]['alpha']})"
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(table))
    robot = str(tmp_path / "robot.yaml")
    assert not _told(tmp_path, "kuka_lwr4plus", "traj_a", 0.0, 25.8, robot=robot)


def test_positions_that_are_late_in_what_judges_too(tmp_path):
    """Of an AIRBOT a share of another torque was told, a scale, a drift and a square."""

    def late(c):
        c = {k: x for k, x in c.items() if not k.startswith("dq")}
        return c | {k: np.interp(c["t"] - 0.02, c["t"], x) for k, x in c.items() if k[0] == "q"}

    assert not _told(tmp_path, "airbot_play", "identify_a", 6.3, 13.4, late)


def test_two_joints_in_each_other_s_place(tmp_path):
    """Any torque of both positions explains more of a Barrett's rows that it is fitted to, and three factors
    were told."""

    def exchanged(c):
        return {k.translate(str.maketrans("12", "21")): x for k, x in c.items()}

    (check,) = examine_fit(prepare_study(planted(tmp_path, exchanged, measured("barrett_wam_2dof"))))
    assert check.check == "swapped_signals" and "the joints look recorded in another order" in check.message
