"""Tables in memory and on disk give the same numbers; what is no table is one sentence."""

import contextlib
import os
from collections import UserDict

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from ident.errors import RecordingError
from ident.recordings.tables import one_episode, open_table
from ident.recordings.tables.episodes import episodes_of

N = 3000
T = np.arange(N) / 500
Q = np.sin(np.outer(T, [1.0, 2.0, 3.0]))


def values(table, *names):
    return np.concatenate(list(table.blocks(names)))


def refusal(source, *names, **keys):
    with pytest.raises(RecordingError) as caught:
        list(open_table(source, **keys).blocks(names or ("q1",)))
    text = str(caught.value)
    assert "\n" not in text
    return text


class OnlyInterchange:
    """A data frame that has nothing but the interchange protocol."""

    def __init__(self, frame):
        self.__dataframe__ = frame.__dataframe__


def frames():
    pandas = pytest.importorskip("pandas")
    flat = {"t": T, "q1": Q[:, 0], "q2": Q[:, 1], "q3": Q[:, 2]}
    return {
        "dict": {"t": T, "q": Q},
        "mapping": UserDict(flat),
        "lists": {name: list(column) for name, column in flat.items()},
        "arrow": pa.table(flat),
        "arrow lists": pa.table({"t": T, "q": pa.FixedSizeListArray.from_arrays(pa.array(Q.ravel()), 3)}),
        "arrow stream": pa.RecordBatchReader.from_batches(
            pa.table(flat).schema, pa.table(flat).to_batches(max_chunksize=700)
        ),
        "pandas": pandas.DataFrame(flat),
        "pandas index": pandas.DataFrame(flat).set_index("t"),
        "interchange": OnlyInterchange(pa.table(flat)),
    }


@pytest.mark.parametrize("kind", list(frames()))
def test_every_table_in_memory_gives_the_same_numbers(kind):
    table = open_table(frames()[kind])
    for _ in range(2):  # read again, as the fit does
        assert np.array_equal(values(table, "t", "q1", "q2", "q3"), np.column_stack([T, Q]))
    assert np.array_equal(values(table, "q3", "t"), np.column_stack([Q[:, 2], T]))


def test_missing_values_arrive_as_nan():
    q1 = Q[:, 0].copy()
    q1[7] = np.nan
    holes = [None if np.isnan(x) else float(x) for x in q1]
    for source in ({"q1": q1}, {"q1": holes}, pa.table({"q1": holes}), pa.table({"q1": q1})):
        assert np.array_equal(values(open_table(source), "q1")[:, 0], q1, equal_nan=True)


def test_enormous_numbers_arrive_as_they_are():
    assert values(open_table({"q1": [1e300, -1e300, 0.0]}), "q1")[0, 0] == 1e300


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_dates_become_seconds_since_the_first(unit):
    steps = np.arange(50)
    dates = np.datetime64("2026-03-01T12:00:00", unit) + steps.astype(f"timedelta64[{unit}]")
    step = {"s": 1, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[unit]
    for source in (
        {"t": dates},
        pa.table({"t": dates}),
        {"t": dates - dates[0]},
        pa.table({"t": dates - dates[0]}),
    ):
        assert np.allclose(values(open_table(source), "t")[:, 0], steps * step, rtol=1e-15)


def test_list_columns_of_parquet_with_an_empty_cell(tmp_path):
    state = [list(map(float, row)) for row in Q]
    state[5] = None
    pq.write_table(pa.table({"timestamp": T, "observation.state": state}), tmp_path / "run.parquet")
    table = open_table(tmp_path / "run.parquet")
    assert table.columns == ("timestamp", *(f"observation.state{k}" for k in (1, 2, 3)))
    read = values(table, "observation.state3", "timestamp", "observation.state1")
    expected = np.column_stack([Q[:, 2], T, Q[:, 0]])
    expected[5, [0, 2]] = np.nan
    assert np.array_equal(read, expected, equal_nan=True)


def learning_set(path, episodes=(0, 1, 2), **more):
    """A file as robot learning data sets have it: times and lists, episode after episode."""
    rows = len(T) // len(episodes)
    state = [list(map(float, row)) for row in Q[: rows * len(episodes)]]
    number = np.repeat(episodes, rows)
    times = np.tile(T[:rows], len(episodes)).astype(np.float32)
    columns = {"timestamp": times, "observation.state": state, "episode_index": number}
    pq.write_table(pa.table(columns | more), path)
    return rows


def test_episodes_are_read_one_by_one(tmp_path):
    rows = learning_set(tmp_path / "file.parquet", (4, 5, 6))
    table = open_table(tmp_path / "file.parquet")
    assert episodes_of(table) == ("episode_index", (4, 5, 6))
    middle = one_episode(table, 5)
    read = values(middle, "observation.state2", "timestamp")
    assert np.array_equal(read[:, 0], Q[rows : 2 * rows, 1]) and np.allclose(read[:, 1], T[:rows], atol=1e-6)
    for wanted, words in ((None, "holds 3 episodes (episode_index 4 to 6)"), (7, "has no episode 7; its")):
        with pytest.raises(RecordingError) as caught:
            one_episode(table, wanted)
        assert words in str(caught.value)


def test_one_episode_alone_needs_no_name(tmp_path):
    learning_set(tmp_path / "file.parquet", (4,))
    table = open_table(tmp_path / "file.parquet")
    assert one_episode(table, None) is table
    assert one_episode(open_table({"t": T, "episode": np.sin(T)}), None).columns == ("t", "episode")
    with pytest.raises(RecordingError, match="has no episode 1; it tells none apart"):
        one_episode(open_table({"t": T, "q": Q}), 1)


def test_lists_of_different_lengths_are_refused():
    assert "different lengths" in refusal(pa.table({"q": [[1.0, 2.0], [1.0]]}))


def test_what_is_no_table_in_memory():
    assert "not a table" in refusal(7)
    assert "ragged" in refusal({"q": [[1.0], [1.0, 2.0]]})
    assert "q1 has 4 rows, t has 5" in refusal({"t": np.arange(5.0), "q1": np.arange(4.0)})
    assert "not numeric" in refusal({"q1": ["far", "near"]})
    assert "run 7" in refusal({"q1": [object(), None]}, name="run 7")
    assert "shape" in refusal({"q1": np.zeros((3, 3, 3))})
    assert "empty" in refusal({})


def test_truth_values_are_no_numbers(tmp_path):
    moving = Q[:, 0] > 0
    pq.write_table(pa.table({"q1": moving}), tmp_path / "run.parquet")
    np.savez(tmp_path / "run.npz", q1=moving, t=T)
    for source in (
        {"q1": moving},
        pa.table({"q1": moving}),
        *(tmp_path / f"run.{e}" for e in ("parquet", "npz")),
    ):
        assert "q1 is not numeric" in refusal(source)


def test_what_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "empty.csv").touch()
    for path, words in (
        (tmp_path / "nothing.csv", "no such file"),
        (tmp_path, "is a folder"),
        (tmp_path / "pipe.csv", "pipe"),
        ("/dev/zero", "device"),
        (tmp_path / "empty.csv", "is empty"),
        (tmp_path / "empty.csv" / "inside.csv", "no such file"),
        (tmp_path / ("n" * 5000 + ".csv"), "too long"),
        ("a\0b.csv", "cannot be opened"),
    ):
        text = refusal(path)
        assert words in text and len(text) < 400


def test_hdf5_datasets_that_end_alike_keep_their_path(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "demo.h5", "w") as opened:
        opened["data/demo_0/obs/joint_pos"] = Q
        opened["data/demo_1/obs/joint_pos"] = 2 * Q
        opened["data/demo_1/t"] = T
    table = open_table(tmp_path / "demo.h5")
    assert "data.demo_1.obs.joint_pos2" in table.columns and "t" in table.columns
    assert np.array_equal(values(table, "data.demo_1.obs.joint_pos2")[:, 0], 2 * Q[:, 1])


@pytest.mark.parametrize("compressed", [True, False])
@pytest.mark.parametrize("dtype", ["f8", "f4", "i2", "u1", "i8"])
def test_mat_files_as_scipy_writes_them(tmp_path, compressed, dtype):
    import scipy.io

    arrays = {"t": T, "q": (10 * Q).astype(dtype), "tau_m1": (10 * Q[:, :1]).astype(dtype)}
    other = {"name": "run", "z": T * 1j, "s": {"a": T}, "c": np.array([1, "x"], object), "one": 3.0}
    scipy.io.savemat(tmp_path / "run.mat", {**other, **arrays}, do_compression=compressed)
    table = open_table(tmp_path / "run.mat")
    assert set(table.columns) == {"t", "q1", "q2", "q3", "tau_m1", "a"}
    assert np.array_equal(values(table, "q2")[:, 0], arrays["q"][:, 1].astype(float))
    assert np.array_equal(values(table, "tau_m1", "t"), np.column_stack([arrays["tau_m1"][:, 0], T]))


def test_fields_of_structures_and_of_records_are_columns(tmp_path):
    import scipy.io

    log = {"q": Q, "stamp": {"t": T}, "who": "arm", "was": {"q": Q[::-1]}}
    runs = np.array([(1.0,), (2.0,)], dtype=[("a", "f8")])
    scipy.io.savemat(tmp_path / "run.mat", {"log": log, "runs": runs, "tau_m1": T})
    table = open_table(tmp_path / "run.mat")
    q = [f"{name}{j}" for name in ("log.q", "log.was.q") for j in (1, 2, 3)]
    assert set(table.columns) == {"t", *q, "tau_m1"}
    assert np.array_equal(values(table, "t", *q), np.column_stack([T, Q, Q[::-1]]))
    records = np.rec.fromarrays([T, Q[:, 0]], names="t,q1")
    np.save(tmp_path / "run.npy", records)
    assert np.array_equal(values(open_table(tmp_path / "run.npy"), "q1", "t"), np.column_stack([Q[:, 0], T]))


@pytest.mark.parametrize("dtype", ["f8", "f4", "i4", "i2", "u2", "u1"])
def test_mat_files_of_version_4(tmp_path, dtype):
    import scipy.io
    import scipy.sparse

    arrays = {"t": T, "q": (10 * Q).astype(dtype), "tau_m1": (10 * Q[:, :1]).astype(dtype)}
    other = {"name": "run", "z": T * 1j, "one": 3.0, "few": scipy.sparse.eye(5)}
    scipy.io.savemat(tmp_path / "run.mat", {**other, **arrays}, format="4", oned_as="column")
    table = open_table(tmp_path / "run.mat")
    assert set(table.columns) == {"t", "q1", "q2", "q3", "tau_m1"}
    assert np.array_equal(values(table, "q2")[:, 0], arrays["q"][:, 1].astype(float))
    assert np.array_equal(values(table, "tau_m1", "t"), np.column_stack([arrays["tau_m1"][:, 0], T]))


@pytest.mark.parametrize(
    ("version", "first", "arrays"),
    [
        ("4", 0, {"t": T[:9], "q": Q[:9]}),
        ("5", 126, {"t": T[:9], "q": Q[:9]}),
        ("5", 126, {"log": {"t": T[:9], "q": Q[:9]}}),
    ],
)
def test_a_damaged_mat_file_is_one_sentence(tmp_path, version, first, arrays):
    """Every byte of it wrong in turn; SciPy's reader ends the process for some of them."""
    import scipy.io

    path = tmp_path / "run.mat"
    scipy.io.savemat(path, arrays, format=version)
    whole = path.read_bytes()
    for k in range(first, len(whole)):
        path.write_bytes(whole[:k] + bytes([whole[k] ^ 0xFF]) + whole[k + 1 :])
        with contextlib.suppress(RecordingError):
            list(open_table(path).blocks(["q1"]))
    path.write_bytes(whole[:-30])
    assert "truncated" in refusal(path)


def test_blocks_of_many_tables_are_not_all_kept(monkeypatch):
    from ident.recordings import held
    from ident.recordings.tables import table as of

    monkeypatch.setattr(held, "TOGETHER", held._numbers_held() + 250)
    read = []

    def rows(names):
        read.append(1)
        yield np.zeros((100, len(names)))

    tables = [of.Table(str(k), ("a",), True, rows) for k in range(4)]
    for _ in range(3):
        for table in tables:
            assert sum(map(len, table.blocks(("a",)))) == 100
    assert [bool(table.held) for table in tables] == [True, True, False, False]
    assert len(read) == 2 + 3 * 2
