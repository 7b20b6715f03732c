"""Studies: what is read, and one sentence with key, file and remedy for what is refused."""

from pathlib import Path

import pytest

from ident.errors import StudyError
from ident.recordings.study import expand, load_study, study_from
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
        ({"recordings": [RUN | {"from": 5, "to": 2}]}, ("to must come after from",)),
        ({"recordings": [RUN | {"payload": "3 kg"}]}, ("payload label",)),
        ({"model": "E"}, ("model", "'A'")),
        ({"filter": {"position_cutoff_hz": -1}}, ("filter.position_cutoff_hz", "greater than 0")),
        ({"filter": {"decimation_cutoff_hz": "often"}}, ("filter.decimation_cutoff_hz", "auto")),
        ({"filter": {"position_cutoff_hz": float("nan")}}, ("finite",)),
        ({"drive_gains": "guess"}, ("drive_gains", "identify")),
        ({"without": ["coulomb"]}, ("without", "did you mean coulomb_friction")),
        ({"columns": {"q1": {"column": 1, "scal": 2}}}, ("columns.q1.scal", "did you mean scale")),
        ({"positions": "joint"}, ("stiffness",)),
        ({"positions": "joint", "stiffness": [0.0]}, ("positive",)),
        ({"payload_mass": {"L": 4.6}}, ("payload_mass", "L")),
        ({"alpha": 2}, ("alpha", "less than 1")),
        ({"reduction_alpha": 0}, ("reduction_alpha", "greater than 0")),
        ({"robot": None}, ("robot",)),
        ({"file": "x"}, ("did you mean recordings",)),
    ],
)
def test_refusals(keys, words):
    with pytest.raises(StudyError) as caught:
        study(**keys)
    text = str(caught.value)
    assert text.startswith("folder/study.yaml") and "\n" not in text
    for word in words:
        assert word in text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not a table"),
        ("- a\n- b\n", "not a table"),
        ("robot: [unclosed", "not valid YAML"),
        ("robot: &a x\nmodel: *a\n", "anchors"),
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
