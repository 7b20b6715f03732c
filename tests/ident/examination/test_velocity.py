"""Velocities that are not the derivatives of the positions, of a simulated arm."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pyarrow.csv import write_csv
from recordings import motion, recording, write_parquet, write_study

from ident.diagnosis import diagnosis, working
from ident.equations.prepared import prepare_study
from ident.errors import RecordingError
from ident.examination.examine import examine_fit
from ident.examination.undone import mended_study
from ident.recordings.study import load_study


def _logged(folder, change):
    columns, _ = recording()
    dq = motion(30.0, 200.0, 0)[2]
    columns |= {f"dq{j + 1}": dq[:, j] for j in range(7)}
    write_parquet(folder / "run.parquet", change(columns))
    return load_study(write_study(folder, [{"file": "run.parquet"}]))


def _opened(folder, change):
    return prepare_study(_logged(folder, change)).streams[0].checks


def _refused(folder, change):
    with pytest.raises(RecordingError) as caught:
        _opened(folder, change)
    return str(caught.value), {check.check for check in caught.value.checks if check.outcome == "refused"}


def _degrees(*names):
    return lambda c: c | {name: np.rad2deg(c[name]) for name in names}


@pytest.mark.parametrize(
    ("names", "check", "words", "line"),
    [
        (["q3"], "angle_unit", "q3 is in degrees", "columns: {q3: {scale: 0.0174533}}"),
        (
            ["q3", "q5"],
            "angle_unit",
            "q3, q5 are in degrees",
            "columns: {q3: {scale: 0.0174533}, q5: {scale: 0.0174533}}",
        ),
        (["dq3"], "clock_rate", "dq3 is in degrees", "columns: {dq3: {scale: 0.0174533}}"),
        (
            [f"q{j}" for j in range(1, 8)],
            "angle_unit",
            "the positions are in degrees",
            ", ".join(f"q{j}: {{scale: 0.0174533}}" for j in range(1, 8)),
        ),
    ],
)
def test_the_side_that_is_in_degrees_is_told_and_its_line(tmp_path, names, check, words, line):
    """Of one position in degrees its velocity was to be taken times 57.3."""
    text, checks = _refused(tmp_path, _degrees(*names))
    assert checks == {check} and words in text and line in text
    assert "57.3" not in text.split("write ")[1]


@pytest.mark.parametrize("last", [False, True])
def test_what_one_recording_shows_is_to_be_changed_there_where_the_others_are_right(tmp_path, last):
    """Of a Franka whose first velocity had the other sign in its third run all were to be turned."""
    columns, _ = recording()
    columns |= {"dq1": np.gradient(columns["q1"], columns["t"])}
    write_parquet(tmp_path / "right.parquet", columns)
    write_parquet(tmp_path / "other.parquet", columns | {"dq1": -columns["dq1"]})
    files = ["right.parquet", "other.parquet"] if last else ["other.parquet"]
    study = load_study(write_study(tmp_path, [{"file": name} for name in files]))
    with pytest.raises(RecordingError) as caught:
        prepare_study(study)
    assert "columns: {dq1: {scale: -1" in str(caught.value)
    assert ("under this recording's own entry where the others are right" in str(caught.value)) == last


def test_degrees_and_a_gear_are_told_apart(tmp_path):
    text, checks = _refused(tmp_path, lambda c: _degrees("q3")(c) | {"dq5": 100 * c["dq5"]})
    assert checks == {"angle_unit", "clock_rate"} and "dq5" in text


@pytest.mark.parametrize(
    ("turns", "words"), [(False, "they look in rpm"), (True, "they look in rpm, of positions in turns")]
)
def test_velocities_in_rpm_are_told(tmp_path, turns, words):
    """60 is within 5 % of 57.3: of a UR10e's, beside positions in turns, degrees were told."""
    size = 1 / (2 * np.pi) if turns else 1.0

    def change(c):
        c = {name: x * size if name[0] == "q" else x for name, x in c.items()}
        return {name: x * 30 / np.pi if name[:2] == "dq" else x for name, x in c.items()}

    text, checks = _refused(tmp_path, change)
    assert checks == {"clock_rate"} and f"{words};" in text and "degrees" not in text


@pytest.mark.parametrize("which", ["q", "dq"])
def test_what_is_read_as_degrees_may_be_none(tmp_path, which):
    """Positions in rad that a study or a header calls degrees: that the velocities are was told."""
    study = _logged(tmp_path, lambda c: c)
    columns = {f"{which}{j}": {"column": f"{which}{j}", "scale": np.pi / 180} for j in (2, 3)}
    with pytest.raises(RecordingError) as caught:
        prepare_study(study.with_(columns=columns))
    text, unit = str(caught.value), {"q": "rad", "dq": "rad/s"}[which]
    assert f"are in degrees, or {which}2, {which}3 are in {unit} and are read as degrees" in text
    assert f"columns: {{{which}2: {{column: {which}2, scale: 1}}, {which}3: {{column: {which}3, " in text


@pytest.mark.parametrize("mark", [-999.0, np.nan, 3e12])
def test_what_is_no_measurement_is_no_velocity(tmp_path, mark):
    """A logger's marks in velocities were told as another signal, or a factor."""

    def change(c):
        lost = np.random.default_rng(0).random(c["t"].shape) < 0.002
        return c | {name: np.where(lost, mark, x) for name, x in c.items() if name[:2] == "dq"}

    assert not _opened(tmp_path, change)


def _in_text(folder, change):
    """A log with its units in its header."""
    _logged(folder, change)
    columns = pq.read_table(folder / "run.parquet").to_pydict()
    units = {"q": " [deg]", "dq": " [deg/s]"}
    sized = {k: np.rad2deg(x) if k.rstrip("1234567") in units else x for k, x in columns.items()}
    named = {f"{k}{units.get(k.rstrip('1234567'), '')}": pa.array(x) for k, x in sized.items()}
    write_csv(pa.table(named), folder / "run.csv")
    return load_study(write_study(folder, [{"file": "run.csv"}]))


@pytest.mark.long
def test_units_of_a_header_are_those_of_velocities_and_of_lines(tmp_path):
    """A log in deg and deg/s by its header was refused for velocities in degrees; a line for one of its
    columns was no YAML, and its scale stood in the place of the header's."""
    plain = prepare_study(_in_text(tmp_path, lambda c: c))
    assert not plain.streams[0].checks and examine_fit(plain) == ()
    study = _in_text(tmp_path, lambda c: c | {"q3": -c["q3"], "dq3": -c["dq3"]})
    (said,) = examine_fit(prepare_study(study))
    assert '{column: "q3 [deg]", scale: 0.0174533, sign: -1}' in said.remedy
    assert examine_fit(prepare_study(mended_study(study, [said]))) == ()


def _held(name, begin, end):
    def change(c):
        x = c[name].copy()
        x[begin:end] = x[begin]
        return c | {name: x}

    return change


def test_a_position_that_stands_still_while_its_velocity_goes_on(tmp_path):
    """Nothing was said of it, and the errors of all torques went up with it."""
    text, checks = _refused(tmp_path, _held("q2", 3000, None))
    assert checks == {"dead_channel"} and "q2 stands still" in text and "rows 3001 to 6000" in text
    assert "with to: 15," in text


def test_velocities_without_their_sign_are_no_turned_ones(tmp_path):
    """Of a rokae's joints that hardly went back in the fitted seconds the sign was to be changed."""
    t = np.arange(6000) / 200

    def change(c):
        q = {"q2": 1.5 - 0.1 * t + 0.08 * np.sin(2 * t), "q4": c["q4"]}
        return c | q | {f"d{name}": np.abs(np.gradient(x, t)) for name, x in q.items()}

    (check,) = _opened(tmp_path, change)
    assert check.outcome == "warned" and check.signals == ("dq2", "dq4")
    assert "dq2, dq4 go as its magnitude" in check.message


def test_velocities_of_other_joints_have_no_other_unit(tmp_path):
    """Of an LWR4+, whose joints move alike, with its velocities one column further three were to be taken
    times 0.7 to 0.8."""

    def change(c):
        copies = {"q3": 1.4 * c["q2"], "dq3": c["dq2"], "dq2": c["dq4"], "dq4": 1.4 * c["dq2"]}
        return c | copies

    check = next(c for c in _opened(tmp_path, change) if c.check == "clock_rate")
    assert check.outcome == "warned" and "dq3 goes as the derivative of q2" in check.message
    assert "dq2 goes as the derivative of q4, dq3 goes as" in check.message


@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_a_joint_that_rests_for_half_of_a_run_is_not_blamed(tmp_path, noise):
    """With the noise and the bias that velocities of joints at rest have."""
    turn, go = np.arange(6000) < 3000, 0.5 * (1 - np.cos(2 * np.pi * np.arange(6000) / 3000))
    t = np.arange(6000) / 200
    q = np.where(turn, 0.4 * go, 0.0)
    dq = np.gradient(q, t) + noise * np.random.default_rng(0).normal(size=6000) + 0.4 * noise
    assert _opened(tmp_path, lambda c: c | {"q2": q, "dq2": dq}) == ()


@pytest.mark.long
def test_a_position_in_degrees_is_told_beside_a_torque_that_it_does_not_explain(tmp_path):
    """Of an LWR the last torque's error stayed where it was, and two positions were said to be swapped. What
    is done to the position is done to its velocity, which would contradict it."""
    noise = np.convolve(np.random.default_rng(2).normal(size=6049), np.full(50, 50**-0.5), "valid")

    def change(c):
        return _degrees("q3", "dq3")(c) | {"tau_m7": c["tau_m7"] + 0.45 * np.std(c["tau_m7"]) * noise}

    with pytest.raises(RecordingError, match="q3 is in degrees") as caught:
        examine_fit(prepare_study(_logged(tmp_path, change)))
    assert "columns: {q3: {scale: 0.0174533}, dq3: {scale: 0.0174533}}" in str(caught.value)


@pytest.mark.long
def test_a_position_is_turned_with_its_velocity(tmp_path):
    """As it was proposed the next check refused it."""
    study = _logged(tmp_path, lambda c: c | {"q3": -c["q3"], "dq3": -c["dq3"]})
    checks = examine_fit(prepare_study(study))
    assert [(c.check, c.remedy) for c in checks] == [
        ("position_sign", "columns: {q3: {sign: -1}, dq3: {sign: -1}}")
    ]
    assert examine_fit(prepare_study(mended_study(study, checks))) == ()


@pytest.mark.long
def test_a_remedy_that_leads_to_a_refusal_is_not_taken(tmp_path, monkeypatch):
    """The diagnosis refused a study for what it had written into it itself."""
    monkeypatch.setattr(
        working, "mended_study", lambda study, checks: study.with_(columns={"q3": {"sign": -1}})
    )
    found = diagnosis.diagnose_study(_logged(tmp_path, lambda c: c))
    assert any("not applied" in note and "dq3" in note for note in found.notes)
    assert found.findings == ()


@pytest.mark.parametrize(
    ("late", "check", "words"),
    [
        (
            {"q4": 12},
            ("q4",),
            "the derivative of q4 comes about 60 ms after dq4 (of the other joints by 0 ms)",
        ),
        ({"dq4": 12}, ("dq4",), "dq4 comes about 60 ms after the derivative of q4"),
        ({f"dq{j}": -12 for j in range(1, 8)}, tuple(f"q{j}" for j in range(1, 8)), "or dq1, dq2"),
        ({f"dq{j}": 3 for j in range(1, 8)}, None, ""),
        ({"q4": 1}, None, ""),
    ],
)
def test_a_position_that_comes_later_than_its_velocity_is_told(tmp_path, late, check, words):
    """Of an AIRBOT whose fourth position came 12 rows late nothing was said: its torque is small. Velocities
    that are filtered alike come later by as much on all joints, and say nothing."""

    def moved(columns):
        rows = np.arange(len(columns["t"]))
        return columns | {k: np.interp(rows - n, rows, columns[k]) for k, n in late.items()}

    told = [c for c in _opened(tmp_path, moved) if c.check == "channel_delay"]
    assert [c.signals for c in told] == ([check] if check else [])
    assert all(words in c.message for c in told)


def test_a_velocity_that_is_no_number_anywhere_says_nothing(tmp_path):
    """It ended in a traceback: of no rows that hold one, a first one was kept."""
    checks = _opened(tmp_path, lambda c: c | {"dq3": np.full(len(c["t"]), np.nan)})
    assert not [c for c in checks if {"q3", "dq3"} & set(c.signals)]
