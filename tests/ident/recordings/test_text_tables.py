"""Text tables as spreadsheets, controllers and scripts write them: the same numbers, or one sentence."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from ident.errors import RecordingError
from ident.recordings.tables import open_table

ROWS = [[0.5, -1.25, 3.0625], [1.0, 2.5, -4.75], [1.5, 0.125, 6.5]]
HEADER = ["t", "q1", "tau_m1"]


def read(tmp_path, text, *names, encoding="utf-8", decimal="."):
    path = tmp_path / "run.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
    table = open_table(path, decimal)
    return table, np.concatenate(list(table.blocks(names or HEADER)))


def written(separator=",", decimal=".", header=True, end="\n", before="", units=""):
    rows = [separator.join(f"{x}".replace(".", decimal) for x in row) for row in ROWS]
    lines = [separator.join(HEADER)] if header else []
    return before + end.join([*lines, *([units] if units else []), *rows]) + end


DIALECTS = {
    "plain": {},
    "semicolons": {"separator": ";"},
    "tabs": {"separator": "\t"},
    "bars": {"separator": "|"},
    "bars and blanks": {"separator": " | "},
    "blanks": {"separator": "   "},
    "comma and blank": {"separator": ", "},
    "decimal comma": {"separator": ";", "decimal": ","},
    "decimal comma, tabs": {"separator": "\t", "decimal": ","},
    "decimal comma, blanks": {"separator": " ", "decimal": ","},
    "windows": {"end": "\r\n"},
    "old macintosh": {"end": "\r"},
    "title and comments": {"before": "\n\nRun 7 of Monday, second try\n# robot: a, b\n% by hand\n\n"},
    "units in brackets": {"units": "[s],[rad],[N m]"},
    "units": {"units": "s,rad,Nm"},
    "units and title": {"separator": ";", "units": "s;deg;-", "before": "\nMonday\n"},
    "header behind #": {"before": "# "},
    "many lines above": {"before": "# a comment, with commas, of a controller\n" * 150},
}


@pytest.mark.parametrize("kind", DIALECTS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16"])
def test_the_numbers_are_the_same(tmp_path, kind, encoding):
    table, values = read(tmp_path, written(**DIALECTS[kind]), encoding=encoding)
    assert table.columns == tuple(HEADER) and np.array_equal(values, ROWS)


def test_latin_1_in_names_and_cells(tmp_path):
    text = "t [s];q1 [°];état\n0,5;-1,25;prêt\n1,0;2,5;prêt\n"
    table, values = read(tmp_path, text, "t [s]", "q1 [°]", encoding="latin-1")
    assert np.array_equal(values, [[0.5, -1.25], [1.0, 2.5]])
    assert table.units == {"t [s]": "s", "q1 [°]": "°"}


def test_a_row_of_units_is_kept_as_units(tmp_path):
    table, _ = read(tmp_path, written(units="[ms],[deg],[N m]"))
    assert table.units == {"t": "ms", "q1": "deg", "tau_m1": "N m"} and any(
        "units" in r for r in table.remarks
    )


def test_no_header(tmp_path):
    table, values = read(tmp_path, written(header=False, before="Monday\n"), "0", "2")
    assert not table.has_names and np.array_equal(values, np.array(ROWS)[:, [0, 2]])


def test_separator_at_the_end_of_every_row(tmp_path):
    text = "t,q1,tau_m1\n" + "".join(",".join(map(str, row)) + ",\n" for row in ROWS)
    assert np.array_equal(read(tmp_path, text)[1], ROWS)


@pytest.mark.parametrize("separator", [",", ";", " "])
@pytest.mark.parametrize("cut", [3, 8, 12])
def test_a_last_line_that_was_cut_off_is_left_out_and_said(tmp_path, separator, cut):
    rows = ROWS * 4
    text = separator.join(HEADER) + "\n" + "".join(separator.join(f"{x:.4f}" for x in r) + "\n" for r in rows)
    table, values = read(tmp_path, text[:-cut])
    assert np.array_equal(values, rows[:-1])
    assert "cut off" in table.cut


def test_a_file_that_only_lacks_its_last_newline_is_whole(tmp_path):
    text = "t,q1,tau_m1\n" + "\n".join(",".join(f"{x:.4f}" for x in row) for row in ROWS)
    table, values = read(tmp_path, text)
    assert np.array_equal(values, ROWS) and not table.remarks


@pytest.mark.parametrize("zone", ["", "Z", "+02:00"])
@pytest.mark.parametrize("between", ["T", " "])
def test_iso_dates_become_seconds_since_the_first(tmp_path, zone, between):
    text = "time,q1\n" + "".join(f"2026-03-01{between}12:00:00.{k:03d}{zone},{k}\n" for k in range(5))
    _, values = read(tmp_path, text, "time", "q1")
    assert np.allclose(values, [[k / 1000, k] for k in range(5)], atol=1e-12)


@pytest.mark.parametrize(
    "form", ["%d.%m.%Y %H:%M:%S,%f", "%m/%d/%Y %I:%M:%S.%f %p", "%H:%M:%S.%f", "%Y-%m-%d %H:%M:%S,%f"]
)
def test_times_of_day_become_seconds_since_the_first(tmp_path, form):
    """Over midnight, the end of a month and empty cells; of spreadsheets and Python's logging they were
    refused."""
    began = datetime(2024, 2, 29, 23, 59, 59, 900000)
    times = ["" if k == 3 else (began + timedelta(seconds=0.05 * k)).strftime(form) for k in range(6)]
    _, values = read(tmp_path, "time;q1\n" + "".join(f"{t};{k}\n" for k, t in enumerate(times)), "time", "q1")
    assert np.allclose(values[:, 0], [0, 0.05, 0.1, np.nan, 0.2, 0.25], atol=1e-9, equal_nan=True)
    with pytest.raises(RecordingError, match="column time is not numeric"):
        text = "time;q1\n" + "".join(f"{began.strftime(form)};1\n" for _ in range(60)) + "never;1\n"
        read(tmp_path, text, "time", "q1")


@pytest.mark.parametrize("cell", ["27:00:00", "24:00:00", "8:60:00", "8:00:61", "8:0:00"])
def test_no_clock_shows_such_a_time(tmp_path, cell):
    """Read as one, a day went by at the next row, and nothing was said."""
    times = [f"8:00:{k:02d}" for k in range(60)]
    with pytest.raises(RecordingError, match=f"column time is not numeric .{cell}"):
        read(tmp_path, "time;q1\n" + "".join(f"{t};1\n" for t in (*times, cell)), "time", "q1")


@pytest.mark.parametrize("form", ['"[{}, {}]"', "[{} {}]"])
def test_lists_in_cells(tmp_path, form):
    text = "timestamp,observation.state,task\n"
    text += "".join(f"{k / 50},{form.format(k + 0.5, -k)},pick\n" for k in range(5))
    _, values = read(tmp_path, text, "timestamp", "observation.state2", "observation.state1")
    assert np.array_equal(values, [[k / 50, -k, k + 0.5] for k in range(5)])


def test_missing_cells_are_nan(tmp_path):
    text = "t,q1,tau_m1\n0.5,,1\n1.0,NaN,2\n1.5,#N/A,1e300\n2.0,1.#QNAN,4\n"
    _, values = read(tmp_path, text)
    assert np.isnan(values[:, 1]).all() and values[2, 2] == 1e300


def test_many_blocks(tmp_path):
    x = np.random.default_rng(0).standard_normal((60_000, 3)).round(9)
    for separator in (",", "  "):
        text = (
            separator.join(HEADER) + "\n" + "".join(separator.join(map(repr, r)) + "\n" for r in x.tolist())
        )
        assert np.array_equal(read(tmp_path, text)[1], x)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t;q1;tau_m1\n0.5;1,250;3\n1.0;2,500;4\n", "thousands"),
        ("t,q1\n0,5,1,25\n1,0,2,50\n", "decimal comma"),
        ("t,q1,q1\n1,2,3\n1,2,3\n", "two columns are called q1"),
        ("t,q1,tau_m1\n1,2,3,4\n1,2,3,4\n", "the header has 3 cells"),
        ("t,q1,tau_m1\n1,2,3\n2,far,3\n", "column q1 is not numeric ('far', row 2)"),
        ("t,q1,tau_m1\n1,2,3\n2,true,3\n", "column q1 is not numeric"),
        ("t,q1,tau_m1\n1,2,3\n2,3\n4,5,6\n", "Expected 3 columns, got 2"),
        ("t,q1,tau_m1\n", "no row of numbers"),
        ("\n\n \n", "is empty"),
        ("x" * 400_000, "no lines of numbers"),
        (b"PK\x03\x04\0\0\0\0" * 100, "binary data"),
        (bytes(4000), "binary data"),
        ('t,q1,tau_m1\n"1,2,3\n4,5,6\n' * 3, ""),
    ],
)
def test_what_cannot_be_read_is_one_sentence(tmp_path, text, words):
    with pytest.raises(RecordingError) as caught:
        read(tmp_path, text)
    assert words in str(caught.value) and "\n" not in str(caught.value) and len(str(caught.value)) < 500
