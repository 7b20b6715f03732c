"""Columns by number, by the joints' names, by a list's name, with the units that a file states; what effort
means is asked for."""

import numpy as np
import pytest
from recordings import recording, write_parquet, write_study

from ident.errors import IdentError
from ident.estimation.fit import fit_study
from ident.recordings.need import need_of
from ident.recordings.signal_columns import signal_columns
from ident.recordings.study import study_from
from ident.recordings.tables import open_table

pytestmark = pytest.mark.unexamined

ARM = ("shoulder", "elbow")
ROWS = {
    "t": np.arange(5) / 10,
    "q1": np.ones(5),
    "q2": np.ones(5),
    "tau_m1": np.ones(5),
    "tau_m2": np.ones(5),
}


def find(tmp_path, table, model="A", entry=None, **keys):
    channels = {"A": ("tau_m1", "tau_m2"), "B": ("tau_l1", "tau_l2")}[model]
    need = need_of(model, channels, joint_names=keys.pop("robot_names", ARM))
    recordings = [{"file": "run.csv", **(entry or {})}]
    study = study_from(
        {"robot": "r", "model": model, "recordings": recordings, **keys}, tmp_path / "study.yaml"
    )
    return signal_columns(study, study.recordings[0], need, table)


def bag(*kinds, names=ARM):
    return open_table(
        {"t": np.arange(5.0)} | {f"{kind}.{name}": np.ones(5) for kind in kinds for name in names}
    )


def test_numbers_stand_for_themselves(tmp_path):
    found = find(tmp_path, open_table(ROWS))
    assert found.names == found.signals == ("t", "q1", "q2", "tau_m1", "tau_m2")


def test_joints_by_their_own_names(tmp_path):
    table = open_table(
        {
            "t": np.ones(5),
            "q_elbow": np.ones(5),
            "q.shoulder": np.ones(5),
            "tau_m_elbow": np.ones(5),
            "x": np.ones(5),
        }
    )
    found = find(tmp_path, table, columns={"tau_m_shoulder": {"column": "x", "sign": -1}})
    assert found.names == ("t", "q.shoulder", "q_elbow", "x", "tau_m_elbow")
    assert found.signals == ("t", "q1", "q2", "tau_m1", "tau_m2") and found.factors[3] == -1


def test_a_joint_s_own_name_alone_is_its_position(tmp_path):
    given = {"t": "t", "q1": "shoulder", "q2": "elbow", "tau_m1": "tau_m1", "tau_m2": "tau_m2"}
    table = open_table({given[name]: values for name, values in ROWS.items()})
    assert find(tmp_path, table).names[1:3] == ("shoulder", "elbow")
    mapped = find(tmp_path, table, columns={"elbow": {"column": "shoulder", "sign": -1}})
    assert mapped.names[1:3] == ("shoulder", "shoulder") and list(mapped.factors[1:3]) == [1, -1]
    # a URDF's joint may be called q2 and be the first: numbers go before names
    assert find(tmp_path, open_table(ROWS), robot_names=("q2", "q1")).names[1:3] == ("q1", "q2")


@pytest.mark.parametrize(
    ("effort", "model", "signals"),
    [
        ("motor_torque", "A", ("tau_m1", "tau_m2")),
        ("joint_torque", "B", ("tau_l1", "tau_l2")),
        ("motor_current", "A", ("i1", "i2")),
    ],
)
def test_effort_is_what_the_study_says(tmp_path, effort, model, signals):
    keys = {"drive_gains": [2.0, 3.0]} if effort == "motor_current" else {}
    for where in ({"effort": effort}, {"entry": {"effort": effort}}):
        found = find(tmp_path, bag("position", "effort"), model, **where, **keys)
        assert found.signals == ("t", "q1", "q2", *signals)
        assert found.names[3:] == ("effort.shoulder", "effort.elbow")
        assert list(found.factors[3:]) == keys.get("drive_gains", [1, 1])


def test_effort_is_never_guessed(tmp_path):
    for model in ("A", "B"):
        with pytest.raises(IdentError, match=r"effort: motor_current \(Universal Robots\)"):
            find(tmp_path, bag("position", "effort"), model)
    with pytest.raises(IdentError, match="write model: A"):
        find(tmp_path, bag("position", "effort"), "B", effort="motor_torque")
    columns = {"tau_m1": "effort.shoulder", "tau_m2": {"column": "effort.elbow"}}
    assert find(tmp_path, bag("position", "effort"), columns=columns).names[3:] == (
        "effort.shoulder",
        "effort.elbow",
    )


def test_names_that_the_robot_does_not_know_are_given_in_the_study(tmp_path):
    table = bag("position", "effort", names=("b", "a"))
    with pytest.raises(IdentError, match=r"names its joints b, a.*joints:"):
        find(tmp_path, table, effort="motor_torque")
    found = find(tmp_path, table, effort="motor_torque", joints=["a", "b"], robot_names=())
    assert found.names == ("t", "position.a", "position.b", "effort.a", "effort.b")
    with pytest.raises(IdentError, match="names 3 joints"):
        find(tmp_path, table, joints=["a", "b", "c"])
    with pytest.raises(IdentError, match=r"joints: elbow is no joint of .*; its joints are b, a"):
        find(tmp_path, table, joints=["a", "elbow"])


def test_a_list_stands_for_all_joints(tmp_path):
    table = open_table(
        {"timestamp": np.ones(5), "observation.state": np.ones((5, 2)), "action": np.ones((5, 2))}
    )
    columns = {"t": "timestamp", "q": "observation.state", "tau_m": {"column": "action", "sign": -1}}
    found = find(tmp_path, table, columns=columns | {"q2": "action2"})
    assert found.names == ("timestamp", "observation.state1", "action2", "action1", "action2")
    assert list(found.factors) == [1, 1, 1, -1, -1]


@pytest.mark.parametrize(
    ("name", "scale"),
    [("t_ms", 1e-3), ("time_us", 1e-6), ("timestamp_ns", 1e-9), ("Time [s]", 1.0), ("stamp.ns", 1e-9)],
)
def test_a_time_says_its_unit(tmp_path, name, scale):
    table = open_table({name if key == "t" else key: values for key, values in ROWS.items()})
    found = find(tmp_path, table)
    assert found.names[0] == name and found.factors[0] == scale


def test_a_time_without_a_unit_is_asked_for(tmp_path):
    for name in ("time", "timestamp", "stamps_total_ns"):
        with pytest.raises(IdentError, match="column t is missing"):
            find(tmp_path, open_table({name if key == "t" else key: values for key, values in ROWS.items()}))


def test_units_that_the_file_states_are_applied_and_said(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("t;q1;q2;tau_m1;tau_m2\n[ms];[deg];[rad];[Nm];[N mm]\n1;1;1;1;1\n2;2;2;2;2\n")
    found = find(tmp_path, open_table(path))
    assert np.allclose(found.factors, [1e-3, np.pi / 180, 1, 1, 1e-3])
    assert len(found.remarks) == 3 and "q1 is in deg" in found.remarks[1]
    assert find(tmp_path, open_table(path), columns={"q1": {"column": "q1", "scale": 1}}).factors[1] == 1
    path.write_text("t [s],q1 [deg],q2 [deg],tau_m1 [Nm],tau_m2 [Nm]\n1,1,1,1,1\n2,2,2,2,2\n")
    found = find(tmp_path, open_table(path))
    assert found.names[1] == "q1 [deg]" and np.allclose(found.factors[1:3], np.pi / 180)


def test_a_bag_fits_as_the_parquet_does(tmp_path):
    """ROS 1, ROS 2 and MCAP of one motion against the Parquet: the same numbers to the last bit."""
    pytest.importorskip("rosbags")
    from bags import write_bag

    columns, _ = recording("A", seconds=30)
    write_parquet(tmp_path / "run.parquet", columns)
    keys = {"filter": {"decimation_cutoff_hz": 2.0}}
    expected = fit_study(study_of(tmp_path, "run.parquet", **keys))
    names = [f"lwr_{letter}" for letter in "gfedcba"]
    for kind, file in (("ros1", "run.bag"), ("sqlite3", "run"), ("mcap", "log")):
        write_bag(tmp_path / file, kind, columns, names)
        result = fit_study(study_of(tmp_path, file, joints=names, effort="motor_torque", **keys))
        assert np.array_equal(result.estimate.chi, expected.estimate.chi), kind


def study_of(tmp_path, file, **keys):
    from ident.recordings.study import load_study

    return load_study(write_study(tmp_path, [{"file": file, "use": "identify"}], **keys))


def test_a_list_of_efforts_is_what_the_study_says(tmp_path):
    table = open_table({"t": np.ones(5), "q": np.ones((5, 2)), "tau": np.ones((5, 2))})
    columns = {"effort": "tau"}
    assert find(tmp_path, table, columns=columns, effort="motor_torque").names[3:] == ("tau1", "tau2")
    assert find(tmp_path, table, "B", columns=columns, effort="joint_torque").signals[3:] == (
        "tau_l1",
        "tau_l2",
    )
    with pytest.raises(IdentError, match="Franka"):
        find(tmp_path, table, columns=columns)
    with pytest.raises(IdentError, match="write model: B"):
        find(tmp_path, table, columns=columns, effort="joint_torque")


def test_what_is_to_be_filled_in_holds_the_study_back(tmp_path):
    for keys, key in (
        ({"drive_gains": "FILL IN"}, "drive_gains"),
        ({"columns": {"t": {"column": "x", "scale": "FILL IN"}}}, "columns.t.scale"),
        ({"entry": {"rate_hz": "fill in"}}, r"recordings\[1\].rate_hz"),
    ):
        with pytest.raises(IdentError, match=f"{key}: is still to be filled in"):
            find(tmp_path, open_table(ROWS), **keys)
