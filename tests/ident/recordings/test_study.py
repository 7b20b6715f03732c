"""Studies: what is read, and one sentence with key, file and remedy for what is refused."""

import os
from pathlib import Path

import pytest

from ident.errors import StudyError
from ident.recordings.study import expand, load_study, study_from
from ident.recordings.study_checks import check_rates, within_rates
from modelgen.geometry.names import unit_of

RUN = {"file": "run1.parquet"}


def study(**keys):
    return study_from({"robot": "kuka_lwr4p", "recordings": [RUN]} | keys, Path("folder/study.yaml"))


def test_defaults_and_paths():
    found = study(recordings=[RUN, {"file": "b.csv", "use": "test", "payload": "L", "from": 1, "to": 5}])
    assert (found.model, found.filter.position_cutoff_hz, found.filter.decimation_cutoff_hz) == (
        "A",
        10.0,
        "auto",
    )
    assert [entry.use for entry in found.recordings] == ["identify", "test"]
    assert found.recording_path(found.recordings[0]) == Path("folder/run1.parquet")
    assert found.recordings[1].from_s == 1 and found.payloads == ("L",)
    assert study(columns={"q1": 3, "t": "time"}).columns["q1"].column == 3
    assert found.with_(model="C").model == "C" and found.with_(model="C").path == Path("folder")


def test_environment_in_paths(monkeypatch):
    monkeypatch.delenv("SOME_DATA", raising=False)
    assert expand("${SOME_DATA:-../here}/a") == "../here/a"
    monkeypatch.setenv("SOME_DATA", "/there")
    assert expand("${SOME_DATA:-../here}/a") == "/there/a"


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"filters": {}}, ("filters", "did you mean filter")),
        ({"recordings": [RUN | {"usr": "identify"}]}, ("recordings[1].usr", "did you mean use")),
        ({"recordings": [RUN | {"use": "fit"}]}, ("recordings[1].use", "identify")),
        ({"recordings": []}, ("empty",)),
        ({"recordings": [RUN | {"use": "test"}]}, ("none has use: identify",)),
        ({"recordings": [RUN, RUN]}, ("run1", "name:")),
        ({"recordings": "run1.parquet"}, ("recordings", "list")),
        ({"recordings": [3]}, ("recordings[1]", "give {file: ..., use: ...}")),
        ({"recordings": [RUN | {"columns": 3}]}, ("recordings[1].columns", "{column: position_1")),
        ({"effects": [[1]]}, ("effects[1]", "stribeck_friction:2")),
        ({"reduction": "maybe"}, ("reduction", "true or false")),
        ({"joints": 3}, ("joints", "[1, 2, 3]")),
        ({"coupled_drives": [[5, "x"]]}, ("coupled_drives[1][2]", "whole number")),
        ({"recordings": [RUN | {"from": 5, "to": 2}]}, ("to must come after from",)),
        ({"recordings": [RUN | {"payload": "3 kg"}]}, ("payload label",)),
        ({"model": "E"}, ("model", "'A'")),
        (
            {"filter": {"position_cutoff_hz": -1}},
            ("filter.position_cutoff_hz", "greater than"),
        ),
        ({"filter": {"decimation_cutoff_hz": "often"}}, ("filter.decimation_cutoff_hz", "auto")),
        ({"filter": {"position_cutoff_hz": float("nan")}}, ("finite",)),
        ({"drive_gains": "guess"}, ("drive_gains", "identify")),
        ({"without": ["coulomb"]}, ("without", "did you mean coulomb_friction")),
        ({"columns": {"q1": {"column": 1, "scal": 2}}}, ("columns.q1.scal", "did you mean scale")),
        ({"positions": "joint"}, ("stiffness",)),
        ({"positions": "joint", "stiffness": [0.0]}, ("positive",)),
        ({"payload_mass": {"L": 4.6}}, ("payload_mass", "L")),
        ({"joints": ["elbow", "wrist", "elbow"]}, ("joints", "elbow stands there twice")),
        ({"alpha": 2}, ("alpha", "less than 1")),
        ({"reduction_alpha": 0}, ("reduction_alpha", "greater than 0")),
        ({"robot": None}, ("robot",)),
        ({"file": "x"}, ("did you mean recordings",)),
        ({"filter": {"position_cutoff_hz": [1]}}, ("finite",)),
        ({"filter": {"position_cutoff_hz": 10**400}}, ("finite",)),
        ({"filter": {"decimation_cutoff_hz": 1e-6}}, ("decimation_cutoff_hz", "0.001")),
        ({"filter": {"resample_hz": 1e9}}, ("resample_hz", "100000")),
        ({"filter": {"order": True}}, ("order", "whole number")),
        ({"filter": {"sign_velocity": 1e4}}, ("sign_velocity", "100")),
        ({"drive_gains": [1.0, 0.0]}, ("drive_gains", "positive")),
        ({"drive_gains": [1.0, -2.0]}, ("sign: -1",)),
        ({"columns": {"q1": {"column": "q1", "scale": 0}}}, ("scale is 0",)),
        ({"columns": {"tau_m1": "q1"}}, ("recordings[1]", "both read from the column q1")),
        ({"columns": {"q1": 3}, "recordings": [RUN | {"columns": {"q2": 3}}]}, ("column 3",)),
        ({"recordings": [RUN | {"payload": "X1"}]}, ("first moment",)),
        ({"recordings": [RUN | {"payload": {"M": 0}}]}, ("recordings[1].payload",)),
        ({"recordings": [RUN | {"from": 5, "to": 5}]}, ("to must come after from",)),
        ({"recordings": [RUN | {"name": "a" * 5000}]}, ("short name",)),
        ({"recordings": [RUN | {"file": "a\0b"}]}, ("no path",)),
        ({"recordings": [RUN | {"file": ""}]}, ("no path",)),
        ({"gravity": [0, 0, -9810]}, ("gravity", "Earth's is 9.81")),
        ({"gravity": [0, 0, -1]}, ("gravity", "Earth's is 9.81")),
        ({"without": ["offset:\u00b2"]}, ("can be left out",)),
        ({"a" * 5000: 1}, ("unknown key",)),
        ({"stiffness": []}, ("stiffness",)),
    ],
)
def test_refusals(keys, words):
    with pytest.raises(StudyError) as caught:
        study(**keys)
    text = str(caught.value)
    assert text.startswith("folder/study.yaml") and "\n" not in text and len(text) < 600
    for word in words:
        assert word in text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not a table"),
        ("- a\n- b\n", "not a table"),
        ("robot: [unclosed", "not valid YAML"),
        ("robot: &a x\nmodel: *a\n", "aliases"),
        ("robot: !!python/object/apply:os.system [ls]\n", "not valid YAML"),
    ],
)
def test_files_that_are_no_studies(tmp_path, text, words):
    (tmp_path / "s.yaml").write_text(text)
    with pytest.raises(StudyError, match=words):
        load_study(tmp_path / "s.yaml")


def test_missing_files_and_folders(tmp_path):
    with pytest.raises(StudyError, match="no such file"):
        load_study(tmp_path / "none.yaml")
    with pytest.raises(StudyError, match="folder"):
        load_study(tmp_path)
    (tmp_path / "run.parquet").write_bytes(b"\xff\xfe\x00PAR1")
    with pytest.raises(StudyError, match="text"):
        load_study(tmp_path / "run.parquet")


def test_units_of_parameters():
    names = ["ZZ2R", "MX3", "ML", "Iam1", "Fvm2R", "Fcl3", "Offm4", "g5"]
    assert [unit_of(name) for name in names] == [
        "kg m^2", "kg m", "kg", "kg m^2", "N m s/rad", "N m", "N m", "N m/unit"]  # fmt: skip
    assert [unit_of(name, ("2", "3")) for name in ("Iam2", "Fvm2R", "Fcl3", "g3", "ZZ2R", "Fcl1")] == [
        "kg", "N s/m", "N", "N/unit", "kg m^2", "N m"]  # fmt: skip


def test_a_repeated_key_is_refused_and_not_overwritten(tmp_path):
    (tmp_path / "s.yaml").write_text("robot: ur10e\nmodel: A\nmodel: B\nrecordings: [{file: a.csv}]\n")
    with pytest.raises(StudyError, match="model appears twice"):
        load_study(tmp_path / "s.yaml")


def test_what_is_no_regular_file_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    for path in (tmp_path / "pipe.yaml", "/dev/zero", tmp_path, "a" * 5000, "a\0b"):
        with pytest.raises(StudyError) as error:
            load_study(path)
        assert len(str(error.value)) < 300 and "\n" not in str(error.value)


def test_columns_that_other_people_named_otherwise_are_not_mistaken_for_the_same():
    study(columns={"q1": "q2", "q2": "q1"})  # two joints swapped
    study(columns={"i1": "tau_m1"}, drive_gains=[1.0])  # currents in columns called torque
    study(model="B", columns={"tau_l1": "tau_m1"})


def test_rows_that_are_fitted_and_judged_are_remarked():
    same = study(recordings=[RUN, RUN | {"use": "validate", "name": "again"}])
    assert "identify and to validate on the same rows" in same.remarks[0]
    parted = [RUN | {"to": 5}, RUN | {"from": 5, "use": "validate", "name": "again"}]
    assert study(recordings=parted).remarks == ()


def test_rates_that_a_recording_does_not_have():
    for settings, key in (
        ({"position_cutoff_hz": 60}, "position_cutoff_hz: 60 Hz"),
        ({"sign_cutoff_hz": 60}, "write at most 45"),
        ({"resample_hz": 1000}, "recorded at 100 Hz"),
    ):
        with pytest.raises(StudyError, match=key):
            check_rates(study(filter=settings), "run1", 100.0)
    check_rates(study(), "run1", 100.0)


def test_a_cut_off_that_nobody_wrote_follows_the_rate():
    """Logs of 20 Hz were refused for a filter that the study does not hold."""
    check_rates(study(filter={}), "run1", 20.0)
    assert within_rates(study(filter={}), 20.0).filter.position_cutoff_hz == 8.0
    for settings, rate in (({}, 25.0), ({"position_cutoff_hz": 10}, 20.0)):
        assert within_rates(study(filter=settings), rate).filter.position_cutoff_hz == 10.0
    with pytest.raises(StudyError, match="10 Hz is above"):
        check_rates(study(filter={"position_cutoff_hz": 10}), "run1", 20.0)


def test_an_environment_variable_that_is_not_set(monkeypatch):
    monkeypatch.delenv("NOWHERE", raising=False)
    with pytest.raises(StudyError, match="NOWHERE is not set"):
        expand("${NOWHERE}/a")
    assert expand("a$b/\u00e9") == "a$b/\u00e9"
