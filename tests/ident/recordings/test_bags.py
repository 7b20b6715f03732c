"""ROS 1, ROS 2 and MCAP bags of one motion give one table; what a bag lacks is one sentence."""

import tracemalloc

import numpy as np
import pytest

pytest.importorskip("rosbags")
from bags import START, BagWriter, write_bag

from ident.errors import RecordingError
from ident.recordings import held
from ident.recordings.tables import open_table
from ident.recordings.tables import table as of

N = 700
T = np.arange(N) / 250
NAMES = ["wrist", "elbow", "shoulder"]
COLUMNS = {"t": T} | {
    f"{kind}{j}": np.sin((j + p) * T + p) for p, kind in enumerate(("q", "dq", "tau_m")) for j in (1, 2, 3)
}
KINDS = ("ros1", "sqlite3", "mcap")


def path_of(folder, kind, name="run"):
    return folder / (f"{name}.bag" if kind == "ros1" else name)


def values(table, *names):
    return np.concatenate(list(table.blocks(names)))


def refusal(path, **keys):
    with pytest.raises(RecordingError) as caught:
        list(open_table(path, **keys).blocks(["t"]))
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("kind", KINDS)
def test_every_bag_gives_the_same_table(tmp_path, kind, monkeypatch):
    """To the bit: stamps in ns are the doubles nearest to k / 250 s."""
    monkeypatch.setattr(of, "ROWS", 150)
    monkeypatch.setattr(held, "NUMBERS", 0)
    table = open_table(write_bag(path_of(tmp_path, kind), kind, COLUMNS, NAMES))
    names = ["t", *(f"{k}.{name}" for k in ("position", "velocity", "effort") for name in NAMES)]
    assert set(table.columns) == set(names)
    for _ in range(3):  # from the bag, then from what was kept
        assert np.array_equal(values(table, *names), np.column_stack(list(COLUMNS.values())))
    assert np.array_equal(values(table, "effort.elbow"), COLUMNS["tau_m2"][:, None])


@pytest.mark.parametrize("kind", KINDS)
def test_several_files_of_one_bag(tmp_path, kind):
    """A folder of parts, in the order of their times and not of their names; a pattern; one storage file."""
    (tmp_path / "parts").mkdir()
    for name, rows in (("b", slice(0, 300)), ("a", slice(300, N))):
        part = write_bag(path_of(tmp_path, kind, name), kind, {c: v[rows] for c, v in COLUMNS.items()}, NAMES)
        for file in [part] if kind == "ros1" else [*part.glob("*.db3"), *part.glob("*.mcap")]:
            file.rename(tmp_path / "parts" / f"{name}{file.suffix}")
    ending = {"ros1": "bag", "sqlite3": "db3", "mcap": "mcap"}[kind]
    for path in (tmp_path / "parts", tmp_path / "parts" / f"*.{ending}"):
        assert np.array_equal(values(open_table(path), "t", "position.wrist")[:, 1], COLUMNS["q1"])
        assert np.array_equal(values(open_table(path), "t")[:, 0], T)
    assert len(values(open_table(tmp_path / "parts" / f"b.{ending}"), "t")) == 300


def test_messages_that_come_late_stand_in_order(tmp_path):
    with BagWriter(tmp_path / "run", "sqlite3") as bag:
        for k in (0, 1, 3, 2, 4, 6, 5, 7):
            bag.joints("/joint_states", START + k * 10**6, NAMES, received=START + 10 * k, position=[k, 0, 0])
    assert np.array_equal(values(open_table(tmp_path / "run"), "position.wrist")[:, 0], np.arange(8))


def test_empty_stamps_give_way_to_the_times_of_receipt(tmp_path):
    with BagWriter(tmp_path / "run", "mcap") as bag:
        for k in range(5):
            bag.joints("/joint_states", 0, NAMES, received=START + k * 10**6, position=[k, 0, 0])
    table = open_table(tmp_path / "run")
    assert np.allclose(values(table, "t")[:, 0], np.arange(5) / 1000)
    assert any("receipt" in remark for remark in table.remarks)


def test_a_gripper_on_the_same_topic_is_not_taken_for_the_arm(tmp_path):
    with BagWriter(tmp_path / "run", "mcap") as bag:
        for k in range(50):
            bag.joints("/joint_states", START + 2 * k, ["finger"], position=[9.0], effort=[9.0])
            bag.joints("/joint_states", START + 2 * k + 1, NAMES, position=[k, 0, 0], effort=[k, 1, 2])
    table = open_table(tmp_path / "run")
    assert np.array_equal(values(table, "position.wrist")[:, 0], np.arange(50))
    assert "position.finger" not in table.columns and "1 joints" in table.remarks[0]


def two_arms(folder):
    with BagWriter(folder / "run", "mcap") as bag:
        for k in range(50):
            for side in ("left", "right"):
                bag.joints(f"/{side}/joint_states", START + k, NAMES, position=[k, len(side), 0])
    return folder / "run"


def test_equal_topics_are_asked_for(tmp_path):
    text = refusal(two_arms(tmp_path))
    assert "/left/joint_states" in text and "/right/joint_states" in text and "topic:" in text
    table = open_table(tmp_path / "run", topic="/right/joint_states")
    assert values(table, "position.elbow")[0, 0] == 5
    assert "its topics are /left/joint_states, /right/joint_states" in refusal(tmp_path / "run", topic="/arm")


@pytest.mark.parametrize("kind", KINDS)
def test_a_controllers_state(tmp_path, kind):
    path = path_of(tmp_path, kind)
    with BagWriter(path, kind) as bag:
        for k in range(9):
            bag.controller(
                "/arm/state",
                START + k * 10**6,
                NAMES,
                feedback={"positions": [k, 1, 2], "velocities": [0, k, 0]},
                reference={"positions": [k + 1, 1, 2]},
                output={"effort": [5, 6, k]},
            )
    table = open_table(path)
    read = values(
        table, "position.wrist", "reference.position.wrist", "output.effort.shoulder", "velocity.elbow"
    )
    assert np.array_equal(read, np.column_stack([np.arange(9), np.arange(9) + 1, np.arange(9), np.arange(9)]))


@pytest.mark.parametrize("definitions", [True, False])
def test_dynamic_joint_states_with_and_without_definitions(tmp_path, definitions):
    """A robot_state_broadcaster's interfaces; older ROS 2 bags do not carry the messages' definitions."""
    with BagWriter(tmp_path / "run", "sqlite3") as bag:
        for k in range(9):
            joint = {"position": k, "effort": -k, "motor_temperature": 40 + k}
            bag.dynamic("/dynamic_joint_states", START + k, {"elbow": joint, "wrist": {"position": 2 * k}})
    if not definitions:
        import sqlite3

        with sqlite3.connect(next((tmp_path / "run").glob("*.db3"))) as opened:
            opened.execute("DELETE FROM message_definitions")
    table = open_table(tmp_path / "run")
    read = values(table, "position.wrist", "motor_temperature.elbow", "effort.wrist")
    assert np.array_equal(read[:, :2], np.column_stack([2 * np.arange(9), 40 + np.arange(9)]))
    assert np.isnan(read[:, 2]).all()


def test_a_joint_named_twice(tmp_path):
    with BagWriter(tmp_path / "run", "mcap") as bag:
        bag.joints("/joint_states", START, ["a", "b", "a"], position=[1, 2, 3])
    assert "names the joint a twice" in refusal(tmp_path / "run")


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_without_joint_states_is_refused_in_little_memory(tmp_path, kind):
    path = path_of(tmp_path, kind)
    with BagWriter(path, kind) as bag:
        for k in range(20):
            bag.blob("/camera", START + k * 10**6, 1 << 20)
    tracemalloc.start()
    text = refusal(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "holds no joint states" in text and "/camera (sensor_msgs/msg/Image)" in text
    assert peak < 12e6  # of the readers' own code; the images are 21 MB


def test_long_bags_take_no_memory(tmp_path, monkeypatch):
    """Peak of traced allocations while an MCAP of 8 times the messages is read."""
    monkeypatch.setattr(held, "NUMBERS", 0)
    monkeypatch.setattr(of, "ROWS", 256)
    peaks = []
    for times in (1, 8):
        longer = {name: np.tile(column, times) for name, column in COLUMNS.items()}
        longer["t"] = np.arange(N * times) / 250
        path = write_bag(tmp_path / f"run{times}", "mcap", longer, NAMES)
        table = open_table(path)
        tracemalloc.start()
        for _ in table.blocks(["t", "position.wrist"]):
            pass
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 3e6, peaks  # one chunk of an MCAP is 1 MB


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_bags_are_one_sentence(tmp_path, kind):
    path = write_bag(path_of(tmp_path, kind), kind, COLUMNS, NAMES)
    file = path if kind == "ros1" else next(f for f in path.iterdir() if f.suffix != ".yaml")
    whole = file.read_bytes()
    for content in (whole[: len(whole) // 2], b"no bag at all" * 100, b""):
        file.write_bytes(content)
        assert refusal(path) and (not content or "or mend it with" in refusal(file))
    if kind != "ros1":
        (path / "metadata.yaml").write_text("{broken: [")
        assert refusal(path)
        file.unlink()
        assert refusal(path)
        (path / "metadata.yaml").unlink()
        assert "is a folder" in refusal(path)
