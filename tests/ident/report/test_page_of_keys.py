"""docs/diagnosis_json.md and fit_json.md name every key of these files, and none that is not there."""

import re
from pathlib import Path

import pytest
from recordings import recording, write_parquet, write_study
from small_arm import ARM

import ident
from ident.diagnosis.document import _hint, _unexplained
from ident.diagnosis.telling.findings import Alternative, Hint, Unexplained

ROOT = Path(__file__).parents[3]


def rows_of(page):
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return [line.split(" | ", 1) for line in text.splitlines() if line.startswith("| `")]


def described(page):
    """Keys of a page, those of a nested list or table by the key that holds them."""
    keys = set()
    for row in rows_of(page):
        holders = re.findall(r"`([^`]+)`", row[0])
        keys |= set(holders)
        keys |= {f"{holder}.{name}" for holder in holders for name in re.findall(r"`([^`]+)`", row[1])}
    return {key.removesuffix("[]") for key in keys}


def paths(value, at=""):
    if isinstance(value, dict):
        for name, its in value.items():
            yield from paths(its, f"{at}.{name}" if at else name)
    else:
        yield at
        for its in value if isinstance(value, list) else ():
            if isinstance(its, dict):
                yield from paths(its, f"{at}[]")


def general(path):
    """With * for names of channels, recordings and parameters, and no further than the page goes."""
    path = re.sub(r"\.parameters\..+", ".parameters.*", path)
    path = re.sub(r"^(explainable|noise_floor_percent|white_noise_percent|sigma|uses)\.[^.]+", r"\1.*", path)
    path = re.sub(r"((?:relative|full_rate)_error\w*)\..+", r"\1.*", path)
    return re.sub(r"^(error_percent\w*\.(before|after))\..+", r"\1", path)


@pytest.fixture(scope="module")
def documents(tmp_path_factory):
    robot = tmp_path_factory.mktemp("keys") / "small.yaml"
    robot.write_text(ARM)
    near = Alternative("spring", (3,), 9.0, 1.0)
    stretch = ("run", 2.0, 5.0)
    loose = _unexplained(Unexplained((3,), "tau_m", ("q3",), 10.0, 9.0, near, True, stretch=stretch))
    hint = _hint(Hint(near, "tau_m3", 2, 9, (near,)))
    twin = ident.simulate(robot, effects=["spring:2"], duration=20, rate_hz=100, seed=1)
    found = ident.diagnose(twin.study).document()
    assert [f["effect"] for f in found["findings"]] == ["spring"]
    return [found, {"unexplained": [loose]}, {"hints": [hint]}]


def test_every_key_is_described(documents):
    known = described("diagnosis_json.md")
    there = {general(path) for document in documents for path in paths(document)}
    assert not {path for path in there - known if not path.startswith("hints[].equivalent[].")}
    assert len(there) > 40


def test_every_key_of_a_fit_is_described(tmp_path):
    columns, _ = recording("A", seconds=20, rate=200)
    write_parquet(tmp_path / "run.parquet", columns)
    study = write_study(tmp_path, [{"file": "run.parquet"}], effects=["spring:3"])
    known = described("fit_json.md")
    there = {general(path) for path in paths(ident.fit(study).document())}
    assert not there - known
    keys = {
        key.removesuffix("[]") for row in rows_of("fit_json.md") for key in re.findall(r"`([^`]+)`", row[0])
    }
    assert not {key for key in keys - there if not key.startswith("tests.durbin_wu_hausman.")}


def test_every_described_key_is_one_of_the_code():
    code = "".join(
        path.read_text(encoding="utf-8")
        for folder in ("diagnosis", "examination", "excitation", "studies")
        for path in (ROOT / "ident" / folder).glob("*.py")
    ) + "".join(path.read_text(encoding="utf-8") for path in (ROOT / "modelgen" / "effects").glob("*.py"))
    for row in rows_of("diagnosis_json.md"):
        for key in re.findall(r"`([^`]+)`", row[0]):
            name = key.removesuffix(".*").removesuffix("[]").split(".")[-1]
            assert re.search(rf"""["']{name}["']|\b{name}:""", code), key
