"""What columns hold, and which signals their names say; what names do not say is a question."""

import numpy as np
import pytest
import yaml

from ident.inspection.inspection import inspect_recordings
from ident.inspection.profile import profile
from ident.inspection.proposal import clock, propose
from ident.recordings.fill_in import FILL_IN
from ident.recordings.tables import open_table

N = 4000
T = np.arange(N) / 250


def profiled(columns):
    return profile(open_table(columns))


def proposed(names, n=0, joints=(), time="t"):
    table = {time: T} if isinstance(time, str) else time
    return propose(profiled(table | {name: np.sin(T + k) for k, name in enumerate(names)}), joints, n)


def test_range_grid_noise_and_holes():
    """Truth: an encoder of 4096 counts, white noise of 0.01, three empty cells, a constant."""
    rng = np.random.default_rng(0)
    count = 2 * np.pi / 4096
    tau = 5 * np.sin(T) + 0.01 * rng.standard_normal(N)
    holes = tau.copy()
    holes[[5, 900, 3999]] = np.nan
    seen = profiled(
        {"q": np.rint(0.3 * np.sin(T) / count) * count, "tau": tau, "holes": holes, "c": np.ones(N)}
    )
    q, torque, empty, constant = seen.columns
    assert q.grid == pytest.approx(count, rel=1e-9) and q.highest == pytest.approx(0.3, abs=count)
    assert torque.grid == 0 and torque.noise == pytest.approx(0.01, rel=0.1)
    assert empty.missing == 3 and empty.noise == pytest.approx(0.01, rel=0.1)
    assert constant.constant and seen.rows == N


def test_text_columns_are_passed_over(tmp_path):
    (tmp_path / "run.csv").write_text("t,mode,q1\n" + "".join(f"{k},RUN,{k}\n" for k in range(9)))
    seen = profile(open_table(tmp_path / "run.csv"))
    assert seen.text == ("mode",) and [column.name for column in seen.columns] == ["t", "q1"]


def numbered(*stems, first=1, count=3):
    return [stem.format(k) for stem in stems for k in range(first, first + count)]


@pytest.mark.parametrize(
    ("names", "columns", "kinds", "asked"),
    [
        (numbered("q{}", "tau_m{}"), {}, {"q", "tau_m"}, ()),
        (numbered("q{}", "i{}"), {}, {"q", "i"}, ("drive_gains",)),
        (numbered("qpos{}", "qvel{}"), {"q": "qpos", "dq": "qvel"}, {"q", "dq"}, ("columns.tau_m",)),
        (numbered("observation.state{}", "action{}"), {"q": "observation.state"}, {"q"}, ("columns.tau_m",)),
        (numbered("actual_q_{}", "target_q_{}"), {"q": "actual_q_"}, {"q"}, ("columns.tau_m",)),
        (numbered("q{}", "torque_{}"), {"effort": "torque_"}, {"q", "effort"}, ("effort",)),
        (
            numbered("joint_pos[{}]", first=0),
            {"q1": "joint_pos[0]", "q2": "joint_pos[1]", "q3": "joint_pos[2]"},
            {"q"},
            ("columns.tau_m",),
        ),
        (numbered("measured_position_{}", "actual_pos_{}"), {}, set(), ("columns.q", "columns.tau_m")),
        (numbered("x{}", "y{}"), {}, set(), ("columns.q", "columns.tau_m")),
    ],
)
def test_what_names_say(names, columns, kinds, asked):
    found = proposed(names)
    assert dict(found.columns) == columns and set(found.kinds) == kinds
    assert tuple(line.key for line in found.lines if line.value == FILL_IN) == asked


def test_sensors_choose_the_model():
    assert proposed(numbered("q{}", "tau_l{}")).model == "B"
    assert proposed(numbered("q{}", "tau_l{}", "tau_m{}")).model == "C"


def test_joints_of_a_bag():
    names = [f"{kind}.{joint}" for kind in ("position", "effort") for joint in ("a2", "a3", "a1")]
    by_number = proposed(names, 3, ("q1", "q2", "q3"))
    assert ("joints", "[a1, a2, a3]") in [(line.key, line.value) for line in by_number.lines]
    known = proposed(names, 3, ("a1", "a2", "a3"))
    assert [line.key for line in known.lines] == ["joints", "effort"]
    unknown = proposed([f"position.{joint}" for joint in ("wrist", "elbow")], 2, ("q1", "q2"))
    assert unknown.lines[0].key == "joints" and unknown.lines[0].value == FILL_IN
    assert "wrist, elbow" in unknown.lines[0].why


@pytest.mark.parametrize(
    ("unit", "scale"), [("timestamp", None), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("odd", FILL_IN)]
)
def test_time_by_its_step(unit, scale):
    factor = {"timestamp": 1, "ms": 1e3, "us": 1e6, "ns": 1e9, "odd": 1e-6}[unit]
    found = proposed(numbered("q{}"), time={"timestamp": T * factor})
    line = yaml.safe_load(f"t: {found.columns['t']}")["t"]
    assert line == ("timestamp" if scale is None else {"column": "timestamp", "scale": scale})


def test_the_clock_is_the_column_whose_unit_is_one(tmp_path):
    rows = "".join(f"{20 * k},{k / 100}\n" for k in range(2000))
    (tmp_path / "run.csv").write_text("Zeit,q1\nms,rad\n" + rows)
    table = profile(open_table(tmp_path / "run.csv"))
    assert clock(table) == ("Zeit", 1e-3) and propose(table).columns["t"] == "Zeit"


@pytest.mark.parametrize(("unit", "start"), [("t", 100.0), ("timestamp_ns", 1.7e9), ("timestamp", 1.7e9)])
def test_one_log_is_cut_in_its_own_time(tmp_path, unit, start):
    factor = {"t": 1, "timestamp_ns": 1e9, "timestamp": 1e6}[unit]
    t = np.arange(0, 40, 0.004)
    stamps = np.round((start + t) * factor).astype("i8") if factor > 1 else start + t
    np.savez(tmp_path / "run.npz", **{unit: stamps, "q1": np.sin(t), "tau_m1": np.cos(t)})
    inspection = inspect_recordings([tmp_path / "run.npz"], None, tmp_path)
    first, last = yaml.safe_load(inspection.study)["recordings"]
    assert first["to"] == last["from"] == pytest.approx(start + 28, abs=0.1)


def test_a_table_without_time_asks_for_its_rate():
    assert proposed(numbered("q{}"), time={"x": T}).counted
