"""The command end to end on a small arm: files that others read, and refusals in a sentence."""

import json
import os
import signal
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from small_arm import ARM

from ident.command_line.cli import run
from ident.command_line.exciting import stopping
from ident.excitation.writing import instants


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    file = tmp_path_factory.mktemp("arm") / "arm.yaml"
    file.write_text(ARM)
    return file


@pytest.fixture(scope="module")
def designed(arm):
    out = arm.parent / "motion"
    options = ["--duration", "6", "--limit", "dq=1.5", "--starts", "1", "--rate", "200"]
    assert run(["excite", str(arm), "-o", str(out), *options]) == 0
    return out


def test_what_is_written_is_one_motion(designed):
    table = pq.read_table(designed / "motion.parquet").to_pydict()
    document = json.loads((designed / "excitation.json").read_text())
    q, dq = np.array(table["q1"]), np.array(table["dq1"])
    np.testing.assert_allclose(np.gradient(q, 0.005)[1:-1], dq[1:-1], atol=1e-3)  # h^2 of the jerk
    assert abs(dq[0]) < 1e-9 and abs(dq[-1]) < 1e-9 and np.abs(dq).max() <= 1.5
    lines = (designed / "motion.csv").read_text().splitlines()
    assert len(lines) == len(q) + 1
    assert document["largest_use_of_a_limit"]["share"] <= 1
    study = yaml.safe_load((designed / "study.yaml").read_text())
    assert study["recordings"] == [{"file": "recording.parquet", "use": "identify"}]
    assert "<canvas" in (designed / "motion.html").read_text()
    assert (designed / "motion.script").read_text().count("servoj") == 751


def test_the_bag_holds_the_motion(designed):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with rosbag2.Reader(designed / "trajectory") as reader:
        ((connection, _, raw),) = reader.messages()
        message = store.deserialize_cdr(raw, connection.msgtype)
    table = pq.read_table(designed / "motion.parquet").to_pydict()
    last = message.points[-1]
    assert last.time_from_start.sec + 1e-9 * last.time_from_start.nanosec == pytest.approx(6.0)
    np.testing.assert_array_equal(message.points[3].positions[0], table["q1"][6])


@pytest.mark.parametrize("rate", [10.0, 100.0, 125.0, 1000.0])
@pytest.mark.parametrize("seconds", [3.557, 6.0])
def test_every_file_ends_where_the_motion_does(seconds, rate):
    """At rest: neither before its end nor after it."""
    t = instants(seconds, rate)
    assert t[0] == 0 and t[-1] == pytest.approx(seconds, abs=1e-9)
    assert np.diff(t)[:-1] == pytest.approx(1 / rate) and 0 < t[-1] - t[-2] < 1.01 / rate


def test_the_diagnosis_of_another_robot_is_refused(tmp_path, arm, capsys):
    of = {"robot": "ur10e", "error_percent": {"after": {"identify": {}}}, "noise_floor_percent": {}}
    (tmp_path / "diagnosis.json").write_text(json.dumps({**of, "findings": []}))
    assert run(["excite", str(arm), "-o", str(tmp_path / "out"), "--from", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert "ur10e" in said and "name the robot that was diagnosed" in said


def test_two_suspects_and_how_long(arm, capsys):
    pair = "stribeck_friction:1,offset_drift:1"
    options = ["--duration", "6", "--starts", "1", "--separate", pair]
    assert run(["excite", str(arm), "-o", str(arm.parent / "pair"), *options]) == 0
    told = json.loads((arm.parent / "pair" / "excitation.json").read_text())["separation"]
    assert told["seconds_for_99_percent"] < 600 and told["same_in_any_motion"] == [False, False]
    assert ", right in 99 of 100 cases" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--duration", "43200"], "2 to 600 s"),
        (["--limit", "dq=0"], "may not move"),
        (["--limit", "jerk:2=1e-9"], "shows nothing"),
        (["--separate", "stribeck:1,hysteresis:1"], "did you mean stribeck_friction"),
        (["--separate", "coulomb_friction:1,hysteresis:1"], "cannot be told from the model's own"),
        (["--start", "9,0"], "start"),
        (["--start", "nan,0"], "no number"),
        (["--separate", "stribeck_friction:1:vs=0,hysteresis:1"], "makes no torque"),
        (["--separate", "payload_change::m=2,hysteresis:1"], "payload_change::m=2,from=5"),
        (["--limit", "q:1=1..1"], "not below"),
        (["--from", "nowhere"], "diagnosis.json"),
        (["--evaluate", "nowhere.parquet"], "nowhere.parquet"),
        (["--rate", "1"], "Hz"),
    ],
)
def test_wrong_inputs_end_in_a_sentence(arm, capsys, options, told):
    assert run(["excite", str(arm), "-o", str(arm.parent / "refused"), *options]) == 2
    error = capsys.readouterr().err
    assert told in error and "Traceback" not in error
    assert not (arm.parent / "refused").exists()


@pytest.mark.parametrize("currents", [False, True], ids=["without torques", "with currents of unknown gains"])
def test_a_recording_of_the_motion_is_evaluated_and_its_resting_joint_named(arm, capsys, currents):
    t = np.arange(0, 20, 0.01)
    run_csv, out = arm.parent / f"run{currents}.csv", arm.parent / f"evaluated{currents}"
    rows = np.column_stack((t, 0.5 * np.sin(t) + 0.2 * np.sin(3 * t), np.full_like(t, 0.1), np.cos(2 * t)))
    header = "t,q1,q2,q3" + (",i1,i2,i3" if currents else "")
    rows = np.hstack((rows, np.sin(rows[:, 1:]))) if currents else rows
    np.savetxt(run_csv, rows, delimiter=",", header=header, comments="")
    assert run(["excite", str(arm), "-o", str(out), "--evaluate", str(run_csv)]) == 0
    said = capsys.readouterr()
    assert "joint 2 rests" in said.err and "does not show" in said.out
    document = json.loads((out / "excitation.json").read_text())
    hidden = {name for name, percent in document["expected_std_percent"].items() if percent is None}
    assert "Fcm2R" in hidden and "Fcm1R" not in hidden  # friction shows in a joint that moves, and only there


def test_an_effect_of_the_users_own_is_told_apart_and_has_a_smallest_visible_size(arm, monkeypatch):
    monkeypatch.setattr("modelgen.effects.registry._own", {})
    folder, out = arm.parent / "own", arm.parent / "own_pair"
    folder.mkdir()
    (folder / "wobble.py").write_text(
        "import sympy as sp\n"
        "from modelgen.effects import Effect, LinearParameter\n"
        "from modelgen.effects.effect import SIGNALS\n"
        'EFFECT = Effect(name="wobble", summary="", signature="", source="",\n'
        '    terms={"w": sp.sin(3 * SIGNALS.q)}, linear=(LinearParameter("w", "N m", -9, 9),))\n'
    )
    options = ["--duration", "4", "--limit", "dq=1.5", "--starts", "1", "--effects-folder", str(folder)]
    assert run(["excite", str(arm), "-o", str(out), "--separate", "wobble:3,spring:3", *options]) == 0
    document = json.loads((out / "excitation.json").read_text())
    assert document["separation"]["same_in_any_motion"] == [False, False]
    assert {"wobble", "spring"} <= {its["effect"] for its in document["smallest_visible"] if its["values"]}


def test_what_is_not_as_asked_for_is_said(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    arm = tmp_path / "arm.yaml"
    arm.write_text(ARM.replace("theta: q1, r: 0.2", "theta: q1, r: 0.2, limits: {dq: 2}"))
    options = ["--duration", "4", "--limit", "dq=1.5", "--limit", "dq:1=9", "--starts", "1"]
    assert run(["excite", str(arm), "-o", str(tmp_path / "noted"), *options]) == 0
    said = capsys.readouterr().err
    assert "dynident[ros]" in said and "--limit dq:1=9 allows joint 1 more" in said
    assert "--limit dq=1.5" not in said


def test_what_a_motion_hardly_shows_is_said(arm, capsys):
    """The condition number, of columns of one length, said nothing of a joint that was all but locked."""
    options = ["--duration", "4", "--limit", "dq:2=0.002", "--limit", "dq:1=1.5", "--starts", "1"]
    assert run(["excite", str(arm), "-o", str(arm.parent / "locked"), *options]) == 0
    (told,) = (line for line in capsys.readouterr().out.splitlines() if "from nothing" in line)
    assert "Fvm2R" in told and "Fvm1R" not in told


def test_ctrl_c_asks_for_the_best_so_far(capfd):
    before = signal.getsignal(signal.SIGINT)
    with stopping() as stopped:
        assert not stopped()
        os.kill(os.getpid(), signal.SIGINT)
        assert stopped()
    assert "best so far" in capfd.readouterr().err
    assert signal.getsignal(signal.SIGINT) is before
