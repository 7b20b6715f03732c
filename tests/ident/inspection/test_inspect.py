"""`ident inspect`: the way from a URDF and a bag to a diagnosis; excitation against plain linear algebra."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from small_arm import ARM

import generated
import ident as door
from ident.command_line.cli import run
from ident.excitation.known import known_robot
from ident.export.saved import load_fit
from ident.inspection.excitation import of_matrix
from ident.inspection.inspection import inspect_recordings
from modelgen.geometry.robot_file import load_robot
from modelgen.geometry.urdf import convert

URDF = """<robot name="lamp"><link name="base"/>
<link name="upper"><inertial><mass value="3"/><origin xyz="0.1 0 0.05"/>
  <inertia ixx="0.02" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="fore"><inertial><mass value="1.5"/><origin xyz="0.15 0.01 0"/>
  <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/>
  <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="50" velocity="5"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.3 0 0"/>
  <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="50" velocity="5"/></joint></robot>
"""


def motion(seconds, rate=100, n=2, seed=0):
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    q, dq, ddq = (np.zeros((len(t), n)) for _ in range(3))
    for k in range(1, 6):
        w = 2 * np.pi * 0.11 * k
        a, phase = 0.8 / k * rng.normal(size=n), rng.uniform(0, 6, n)
        q += a * np.sin(np.outer(t, [w] * n) + phase)
        dq += a * w * np.cos(np.outer(t, [w] * n) + phase)
        ddq -= a * w * w * np.sin(np.outer(t, [w] * n) + phase)
    return t, q, dq, ddq


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """lamp.urdf, and two MCAP logs of it whose joints stand in another order."""
    pytest.importorskip("rosbags")
    from bags import write_bag

    folder = tmp_path_factory.mktemp("lamp")
    (folder / "lamp.urdf").write_text(URDF)
    model = generated.load(str(folder / "lamp.urdf"), "A")
    rng = np.random.default_rng(1)
    chi = np.array([2.0 if name.startswith(("Fv", "Fc", "Ia")) else 0.6 for name in model.parameters])
    for number, name in enumerate(("monday", "tuesday")):
        t, q, dq, ddq = motion(40, seed=number)
        tau = model.torque(q, dq, ddq, chi)
        tau = tau + 0.1 * rng.standard_normal(tau.shape)
        columns = {"t": t} | {f"q{k + 1}": q[:, k] for k in range(2)}
        columns |= {f"dq{k + 1}": dq[:, k] for k in range(2)} | {f"tau_m{k + 1}": tau[:, k] for k in range(2)}
        write_bag(folder / f"{name}_bag", "mcap", columns, ["shoulder", "elbow"])
        next((folder / f"{name}_bag").glob("*.mcap")).rename(folder / f"{name}.mcap")
    return folder


@pytest.mark.long
def test_from_a_urdf_and_bags_to_a_diagnosis(folder, capsys):
    logs = [str(folder / "monday.mcap"), str(folder / "tuesday.mcap")]
    study = folder / "study.yaml"
    assert run(["inspect", *logs, "--robot", str(folder / "lamp.urdf"), "-o", str(study)]) == 0
    said = capsys.readouterr().out
    assert "Fill in effort" in said and "base parameters" in said
    assert "<html" in (folder / "study.html").read_text()[:200]

    assert run(["fit", str(study), "-o", str(folder / "fit")]) == 2
    assert "effort: is still to be filled in" in capsys.readouterr().err
    text = study.read_text()
    assert text.count("FILL IN") == 2  # in the opening comment, and one line
    study.write_text(text.replace("effort: FILL IN", "effort: motor_torque"))
    status = run(["diagnose", str(study), "-o", str(folder / "results")])
    assert status == 0, capsys.readouterr().err
    diagnosis = json.loads((folder / "results" / "diagnosis.json").read_text())
    assert diagnosis["verdict"] == "none"
    assert diagnosis["error_percent"]["after"]["validate"]["total"] < 5
    assert [its["name"] for its in diagnosis["joints"]] == ["shoulder", "elbow"]
    assert "noise floor\twhite\tjoint" in (said := capsys.readouterr().out) and "\telbow\n" in said

    pytest.importorskip("cvxpy", reason="the extra dynident[export] is not installed")
    robot = folder / "lamp_identified.urdf"
    assert run(["export", str(folder / "results"), "--urdf", str(robot), "--c", str(folder / "c")]) == 0
    assert "Joints: q1 shoulder, q2 elbow." in (folder / "c" / "lamp_a.h").read_text()
    links = convert(robot.read_bytes(), robot.name).urdf.links
    assert set(links) == {"base", "upper", "fore"} and links["fore"].mass > 0

    assert run(["inspect", *logs, "-o", str(study)]) == 2
    assert "is there already" in capsys.readouterr().err


def test_one_log_is_cut_in_two_and_its_robot_may_be_unknown(folder):
    found = inspect_recordings([folder / "monday.mcap"], None, folder)
    study = yaml.safe_load(found.study)
    assert study["robot"] == "FILL IN" and found.excitation is None
    first, last = study["recordings"]
    assert first["to"] == last["from"] == pytest.approx(28, abs=0.1) and last["use"] == "validate"
    assert [question.split(":")[0] for question in found.questions] == ["robot", "joints", "effort"]


def test_what_no_joint_of_this_robot_does_is_said(folder, capsys):
    """Positions with another zero, torques in N mm, against the URDF's limits; the log itself is fine."""
    table = pq.read_table(lamp_table(folder))
    for name, change, words in (
        ("fine", {}, ()),
        ("zero", {"q2": np.pi}, ("q2 (elbow) reaches", "limits -3 to 3", "the zero and the order")),
        ("unit", {"tau_m1": 1000.0}, ("tau_m1 (shoulder) is 1e+03 times", "N mm", "scale: 0.001")),
    ):
        columns = {key: table[key].to_numpy() for key in table.column_names}
        for key, by in change.items():
            columns[key] = columns[key] + by if key[0] == "q" else columns[key] * by
        pq.write_table(pa.table(columns), folder / f"{name}.parquet")
        run(["inspect", str(folder / f"{name}.parquet"), "--robot", str(folder / "lamp.urdf")])
        said = capsys.readouterr().err
        assert all(word in said for word in words) and ("far beyond" in said) == (name == "zero"), name


def lamp_table(folder):
    """The lamp's motion as Parquet, torques of a motor."""
    model = generated.load(str(folder / "lamp.urdf"), "A")
    t, q, dq, ddq = motion(30)
    tau = model.torque(q, dq, ddq, np.full(len(model.parameters), 0.6))
    tau += 0.05 * np.random.default_rng(0).normal(size=q.shape)
    columns = (
        {"t": t} | {f"q{k + 1}": q[:, k] for k in range(2)} | {f"tau_m{k + 1}": tau[:, k] for k in range(2)}
    )
    pq.write_table(pa.table(columns), folder / "plain.parquet")
    return folder / "plain.parquet"


def test_episodes_of_one_file_are_recordings_of_their_own(folder, capsys):
    model = generated.load(str(folder / "lamp.urdf"), "A")
    chi, tables = np.full(len(model.parameters), 0.6), []
    for episode in range(3):
        t, q, dq, ddq = motion(25, rate=50, seed=episode)
        tau = model.torque(q, dq, ddq, chi) + 0.01 * np.random.default_rng(episode).normal(size=q.shape)
        state = {"observation.state": q.tolist(), "observation.effort": tau.tolist(), "action": q.tolist()}
        number = np.full(len(t), episode)
        tables.append(pa.table({"timestamp": t.astype(np.float32), "episode_index": number, **state}))
    pq.write_table(pa.concat_tables(tables), folder / "file-000.parquet")
    study = folder / "learned.yaml"
    given = ["inspect", str(folder / "file-000.parquet"), "--robot", str(folder / "lamp.urdf")]
    assert run([*given, "-o", str(study)]) == 0
    document = yaml.safe_load(study.read_text().replace("FILL IN", "motor_torque"))
    assert [entry["episode"] for entry in document["recordings"]] == [0, 1, 2]
    study.write_text(yaml.safe_dump(document))
    fit = door.fit(study)
    assert [each.label for each in fit.result.recordings] == [f"file-000_{k}" for k in range(3)]
    np.testing.assert_allclose(fit.result.full.chi, chi, atol=0.05)
    del document["recordings"][1]["episode"]
    study.write_text(yaml.safe_dump(document))
    with pytest.raises(door.Error, match="holds 3 episodes"):
        door.fit(study)
    fit.save(folder / "learned")
    given = ["predict", str(folder / "learned"), str(folder / "file-000.parquet"), "-o", str(folder / "new")]
    assert run(given) == 2 and "holds 3 episodes" in capsys.readouterr().err
    assert run([*given, "--episode", "2"]) == 0


def test_a_log_in_degrees_is_refused_with_the_scale_and_the_others_are_still_seen(tmp_path):
    from recordings import write_parquet

    (tmp_path / "arm.yaml").write_text(ARM)
    t, q, _, _ = motion(30, n=3)
    table = {"t": t} | {f"q{k + 1}": q[:, k] for k in range(3)}
    table |= {f"tau_m{k + 1}": np.cos(t + k) for k in range(3)}
    write_parquet(tmp_path / "good.parquet", table)
    degrees = table | {name: np.degrees(10 * table[name]) for name in ("q1", "q2", "q3")}
    write_parquet(tmp_path / "bad.parquet", degrees)
    found = inspect_recordings(
        [tmp_path / "good.parquet", tmp_path / "bad.parquet"], str(tmp_path / "arm.yaml"), tmp_path
    )
    good, bad = found.logs
    assert good.survey is not None and good.survey.rate_hz == pytest.approx(100)
    said = bad.refusal + "".join(check.sentence for check in bad.checks)
    assert "0.0174533" in said
    assert found.excitation is not None and found.questions == ()


def test_inflation_is_that_of_the_textbook():
    """sqrt(1 / (1 - R^2)) of one column on the others; a copy and a zero column are not shown."""
    rng = np.random.default_rng(3)
    W = rng.standard_normal((400, 3))
    W[:, 2] = W[:, 0] + 0.1 * W[:, 2]
    found = of_matrix(W, ("XX1", "Fv2", "Ia3"))
    others = W[:, :2]
    unexplained = W[:, 2] - others @ np.linalg.lstsq(others, W[:, 2], rcond=None)[0]
    expected = np.linalg.norm(W[:, 2]) / np.linalg.norm(unexplained)
    inflation = {weak.parameter: weak.inflation for weak in found.weakest}
    assert inflation["Ia3"] == pytest.approx(expected, rel=1e-9) and found.rank == 3
    assert found.condition == pytest.approx(np.linalg.cond(W / np.linalg.norm(W, axis=0)), rel=1e-9)
    copied = of_matrix(np.column_stack([W[:, :2], W[:, 1], np.zeros(400)]), ("XX1", "Fvm2", "Fcm2", "MX3"))
    assert copied.rank == 2 and "does not show 2 of 4" in copied.sentence
    lost = {weak.parameter for weak in copied.weakest if np.isinf(weak.inflation)}
    assert lost == {"Fvm2", "Fcm2", "MX3"}


def test_bags_in_folders_with_two_arms_on_two_topics(folder, tmp_path, capsys):
    """A sqlite3 folder; the topic is asked for once and stands in the study, whose fit then reads it."""
    from bags import START, BagWriter

    t, q, dq, ddq = motion(30)
    with BagWriter(tmp_path / "log", "sqlite3") as bag:
        for row, stamp in enumerate(np.rint(t * 1e9).astype(int).tolist()):
            for side, sign in (("left", 1), ("right", -1)):
                values = {"position": sign * q[row], "effort": np.sign(dq[row]) + ddq[row] + dq[row]}
                bag.joints(f"/{side}/joint_states", START + stamp, ["shoulder", "elbow"], **values)
    call = ["inspect", str(tmp_path / "log"), "--robot", str(folder / "lamp.urdf")]
    assert run(call) == 2
    assert "say which with topic:" in capsys.readouterr().err
    study = tmp_path / "study.yaml"
    assert run([*call, "--topic", "/left/joint_states", "-o", str(study)]) == 0
    study.write_text(study.read_text().replace("effort: FILL IN", "effort: motor_torque"))
    assert run(["fit", str(study), "-o", str(tmp_path / "fit")]) == 0
    assert len(json.loads((tmp_path / "fit" / "fit.json").read_text())["parameters"]) > 5


def test_a_torque_with_the_other_sign_is_named_before_anything_is_fitted(folder, tmp_path):
    from recordings import write_parquet

    model = generated.load(str(folder / "lamp.urdf"), "A")
    chi = np.array([2.0 if name.startswith(("Fv", "Fc", "Ia")) else 0.6 for name in model.parameters])
    t, q, dq, ddq = motion(60)
    tau = model.torque(q, dq, ddq, chi) + 0.1 * np.random.default_rng(0).standard_normal((len(t), 2))
    columns = {"t": t} | {f"q{k + 1}": q[:, k] for k in range(2)}
    columns |= {"tau_m1": tau[:, 0], "tau_m2": -tau[:, 1]}
    write_parquet(tmp_path / "run.parquet", columns)
    found = inspect_recordings([tmp_path / "run.parquet"], str(folder / "lamp.urdf"), tmp_path)
    assert [check.check for check in found.checks] == ["torque_sign"]
    assert "tau_m2" in found.checks[0].sentence


def test_a_study_keeps_a_urdf_s_numbers_as_they_are_written(folder):
    """From the twin to the fit and the written robot: `exact` goes along."""
    text = (
        (folder / "lamp.urdf")
        .read_text()
        .replace("<axis", "<!-- rounded --><axis")
        .replace('<origin xyz="0.3 0 0"/>', '<origin xyz="0.3 0 0" rpy="1.570796 0 0"/>')
    )
    (folder / "rounded.urdf").write_text(text)
    made = door.simulate(folder / "rounded.urdf", duration=10, rate_hz=50, exact=True)
    assert not any("multiple of pi/2" in note for note in made.result.robot.remarks)
    fits = [door.fit(made.study.with_(exact=exact)) for exact in (True, False)]
    assert [bool(fit.result.columns.model.notes) for fit in fits] == [False, True]
    assert any("multiple of pi/2" in note for note in fits[1].document()["notes"])
    kept = load_fit(fits[0].save(folder / "exact_fit"))
    assert kept.load_robot().notes == ()
    looked = inspect_recordings([folder / "monday.mcap"], str(folder / "rounded.urdf"), folder, exact=True)
    assert yaml.safe_load(looked.study)["exact"] is True and looked.excitation is not None
    source = str(folder / "rounded.urdf")
    assert known_robot(load_robot(source, True), source, exact=True).model.notes == ()  # of ident excite
