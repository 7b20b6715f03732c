"""Arrow arrays made of buffers are pyarrow's own, and importing them asks for no pandas."""

import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest

from ident.summaries.arrow import array, table_of

KINDS = {
    "numbers": ([1.5, None, -2.0, float("nan")], pa.float64()),
    "counts": ([3, 0, 2**40], pa.int64()),
    "texts": (["a", None, "", "µ ü"], pa.string()),
    "lists of numbers": ([[1.0, 2.0], [], None, [3.0]], pa.list_(pa.float64())),
    "lists of texts": ([["a", "bc"], [], ["ü"]], pa.list_(pa.string())),
    "many": ([None, 1.0] * 9, pa.float64()),
    "nothing": ([], pa.list_(pa.string())),
    "absent": ([None, None], pa.string()),
}


@pytest.mark.parametrize(("values", "kind"), KINDS.values(), ids=KINDS)
def test_an_array_is_what_pyarrow_makes_of_the_values(values, kind):
    made, expected = array(values, kind), pa.array(values, kind)
    made.validate(full=True)
    assert made.type == expected.type and made.null_count == expected.null_count
    assert str(made.to_pylist()) == str(expected.to_pylist())


def test_writing_and_reading_a_table_imports_no_pandas():
    # (what is said counts, not the return code: Arrow's threads abort some processes that end at once)
    said = (
        "import io, sys, numpy as np, pyarrow as pa, pyarrow.parquet as pq;"
        "from ident.summaries.arrow import array, table_of; table_of({'y': np.ones(3)});"
        "out = io.BytesIO(); pq.write_table(pa.table({'x': array([1.0], pa.float64())}), out);"
        "pq.ParquetFile(out).read(use_threads=False).to_pydict(); print('pandas' in sys.modules, flush=True)"
    )
    told = subprocess.run([sys.executable, "-c", said], check=False, capture_output=True, text=True)
    assert told.stdout == "False\n", told.stderr


def test_a_table_of_numbers_is_pyarrow_s():
    both = np.random.default_rng(1).normal(size=(40, 2))
    both[3] = np.nan
    columns = {"t": np.arange(40), "x": both[:, 1], "few": both[:, 0].astype(np.float32)}
    made = table_of(columns)
    made.validate(full=True)
    assert made.schema == pa.table(columns).schema
    assert all(np.array_equal(made[name], x, equal_nan=True) for name, x in columns.items())
