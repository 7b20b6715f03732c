"""One table written in sixty ways: every one gives the same numbers, or is refused in one sentence."""

import gzip
import io
import json
from decimal import Decimal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from ident.recordings.tables import open_table
from tests.reliability import recordings
from tests.reliability.judge import Case, judged

TABLE = {name: np.round(values, 6) for name, values in recordings.columns().items()}
NAMES = list(TABLE)


def text(separator=",", cell=repr, head=NAMES, end="\n"):
    rows = zip(*(values.tolist() for values in TABLE.values()))
    lines = [separator.join(head), *(separator.join(cell(x) for x in row) for row in rows)]
    return end.join(lines) + end


def comma(x):
    return repr(x).replace(".", ",")


def arrow(change=None, **columns):
    table = pa.table({name: columns.get(name, pa.array(values)) for name, values in TABLE.items()})
    stream = io.BytesIO()
    pq.write_table(change(table) if change else table, stream)
    return stream.getvalue()


def with_empty_group():
    stream, table = io.BytesIO(), pa.table(TABLE)
    with pq.ParquetWriter(stream, table.schema) as writer:
        for part in (table.slice(0, 100), table.slice(0, 0), table.slice(100)):
            writer.write_table(part)
    return stream.getvalue()


def npz(**arrays):
    stream = io.BytesIO()
    np.savez(stream, **(TABLE | arrays))
    return stream.getvalue()


SAME = {
    "byte order mark": text().encode("utf-8-sig"),
    "UTF-16": text().encode("utf-16"),
    "lines end in CR LF": text(end="\r\n").encode(),
    "lines end in CR": text(end="\r").encode(),
    "lines end as they like": text().replace("\n", "\r\n", 200).encode(),
    "decimal commas between semicolons": text(";", comma).encode(),
    "decimal commas between tabs": text("\t", comma).encode(),
    "quoted cells": text(cell=lambda x: f'"{x!r}"').encode(),
    "plus signs": text(cell=lambda x: f"{x:+.7f}").encode(),
    "padded cells": text(cell=lambda x: f"  {x:12.6f} ").encode(),
    "a separator at the end": text().replace("\n", ",\n").encode(),
    "padded names": text(head=[f" {name} " for name in NAMES]).encode(),
    "dictionaries": arrow(lambda t: pa.table({n: t[n].dictionary_encode() for n in NAMES})),
    "decimals": arrow(
        q1=pa.array([Decimal(f"{x:.6f}") for x in TABLE["q1"].tolist()], pa.decimal128(18, 6))
    ),
    "stamps of a time zone": arrow(
        t=pa.array(np.rint(TABLE["t"] * 1e9).astype("i8") + 10**18, pa.timestamp("ns", tz="Europe/Berlin"))
    ),
    "an empty row group": with_empty_group(),
    "lists": arrow(
        lambda t: pa.table(
            {"t": t["t"], "q": pa.array(np.column_stack([TABLE["q1"], TABLE["q2"]]).tolist()),
             "tau_m": pa.array(np.column_stack([TABLE["tau_m1"], TABLE["tau_m2"]]).tolist())}
        )
    ),
    "the other byte order": npz(**{name: values.astype(">f8") for name, values in TABLE.items()}),
    "long doubles": npz(**{name: values.astype(np.longdouble) for name, values in TABLE.items()}),
}  # fmt: skip
REFUSED = {
    "UTF-16 without a mark": text().encode("utf-16-le"),
    "UTF-32": text().encode("utf-32"),
    "decimal commas in quotes": text(cell=lambda x: f'"{comma(x)}"').encode(),
    "thousands marked": text(cell=lambda x: f'"{1000 * x:,.3f}"').encode(),
    "Fortran's exponents": text(cell=lambda x: f"{x:.9e}".replace("e", "D")).encode(),
    "a typographer's minus": text(cell=lambda x: repr(x).replace("-", "\u2212")).encode(),
    "blanks that do not break": text(cell=lambda x: f"\u00a0{x!r}").encode(),
    "hexadecimal": text(cell=lambda x: x.hex()).encode(),
    "null bytes": text().replace("\n", "\0\n", 5).encode(),
    "the header again": (text() + text()).encode(),
    "another table below": (text() + "\nx,y\n1,2\n").encode(),
    "a row too short": text().replace("\n0.5,", "\n", 1).encode(),
    "two columns of one name": text(head=["t", "q1", "q1", "tau_m1", "tau_m2"]).encode(),
    "capital names": text(head=[name.upper() for name in NAMES]).encode(),
    "Excel's error": text().replace("0.5,", "#DIV/0!,", 1).encode(),
    "compressed": gzip.compress(text().encode()),
    "Parquet": arrow(),
    "JSON": json.dumps({name: values.tolist() for name, values in TABLE.items()}).encode(),
}
REFUSED_PARQUET = {
    "text": text().encode(),
    "times of day": arrow(t=pa.array(np.rint(TABLE["t"] * 1e9).astype("i8"), pa.time64("ns"))),
    "no rows": arrow(lambda t: t.slice(0, 0)),
    "no columns": arrow(lambda t: pa.table({})),
    "nothing in a column": arrow(tau_m1=pa.nulls(recordings.ROWS)),
    "truth values": arrow(tau_m1=pa.array(TABLE["tau_m1"] > 0)),
    "bytes": arrow(tau_m1=pa.array([b"x"] * recordings.ROWS)),
    "records": arrow(q1=pa.array([{"a": x} for x in TABLE["q1"].tolist()])),
}


def ending(name):
    if name in ("the other byte order", "long doubles"):
        return "npz"
    return "parquet" if SAME[name][:4] == b"PAR1" else "csv"


@pytest.mark.parametrize("name", SAME)
def test_the_same_numbers(tmp_path, name):
    file = tmp_path / f"run.{ending(name)}"
    file.write_bytes(SAME[name])
    table = open_table(file)
    read = np.vstack(list(table.blocks(NAMES)))
    assert np.allclose(read, np.column_stack(list(TABLE.values())), rtol=0, atol=1e-8)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_refused_in_one_sentence(kind):
    for name, data in (REFUSED if kind == "csv" else REFUSED_PARQUET).items():
        outcome = judged(recordings.trial, Case(recordings.File(kind, data), name))
        assert outcome.kind == "refused", (name, outcome)
