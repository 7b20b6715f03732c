"""Every command line, file and Python block of README and CONTRIBUTING does what it says, in order."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
CATALOGUE = ROOT / "modelgen" / "effects" / "catalogue"
README = (ROOT / "README.md").read_text(encoding="utf-8")
CONTRIBUTING = (ROOT / ".github" / "CONTRIBUTING.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^(?:<!-- (?P<note>[^>]*) -->\n)?```(?P<language>\w+)\n(?P<text>.*?)^```", re.M | re.S)
SETUP = ("make ", "pip install", "git clone", "cd ")  # executed by whoever runs these tests


def test_every_key_of_a_study_is_in_the_table():
    from ident.recordings.study import EffectEntry, FilterSettings, RecordingEntry, Study

    table = README[README.index("Every key of a study") :].partition("</details>")[0]
    models = (Study, RecordingEntry, FilterSettings, EffectEntry)
    keys = {field.alias or name for model in models for name, field in model.model_fields.items()}
    assert [key for key in sorted(keys) if f"`{key}`" not in table and f"{key}: " not in table] == []


def blocks(text, language):
    return [
        (found["note"] or "", found["text"])
        for found in BLOCK.finditer(text)
        if found["language"] == language
    ]


def commands(text):
    lines = (line.split("   #")[0].split(" # ")[0].strip() for line in text.splitlines())
    return [line for line in lines if line and not line.startswith(SETUP)]


def run(command, folder):
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(
        shlex.split(command), cwd=folder, env=environment, capture_output=True, text=True, timeout=400
    )
    assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    return done.stdout


def somebody_elses_files(folder: Path) -> None:
    """What a reader brings: a URDF, and two bags of it: here of the twin that was just simulated."""
    import pyarrow.parquet
    from bags import write_bag

    text = (ROOT / "modelgen" / "robots" / "ur5e.urdf").read_text(encoding="utf-8")
    (folder / "arm.urdf").write_text(text, encoding="utf-8")
    names = re.findall(r'<joint name="(\w+)" type="revolute"', text)
    assert len(names) == 6
    for day, run in (("monday", "run1"), ("tuesday", "run3")):
        table = pyarrow.parquet.read_table(folder / "twin" / f"{run}.parquet")
        columns = {name: table[name].to_numpy() for name in table.column_names}
        write_bag(folder / f"{day}_bag", "mcap", columns, names)
        next((folder / f"{day}_bag").glob("*.mcap")).rename(folder / f"{day}.mcap")


def somebody_elses_log(robot: Path) -> None:
    """Recordings as another program would write them: a header of its own, ms, degrees, mm, N mm, CSV."""
    import ident

    twin = ident.simulate(robot, duration=20, rate_hz=200, noise=0.5)
    for day, run in (("monday", "run1"), ("tuesday", "run3")):
        table = twin.recordings[run]
        column = {name: np.asarray(table[name]) for name in table}
        columns = {"Time_ms": 1000 * column["t"]}
        columns |= {f"J{j}_deg": np.degrees(column[f"q{j}"]) for j in (1, 2)}
        columns |= {"J3_mm": 1000 * column["q3"]}
        columns |= {f"J{j}_Nmm": 1000 * column[f"tau_m{j}"] for j in (1, 2)}
        columns |= {"J3_N": -column["tau_m3"]}
        np.savetxt(robot.parent / f"cell_{day}.csv", np.column_stack(list(columns.values())), fmt="%.8g",
                   delimiter=",", header=",".join(columns), comments="")  # fmt: skip


def fill_in(study: Path, lines: str) -> None:
    """Answer the marks of a study, as its reader would."""
    text = study.read_text(encoding="utf-8")
    for line in lines.splitlines():
        key, _, value = line.split("#")[0].strip().partition(": ")
        text, many = re.subn(rf"(?m)^{key}: FILL IN", f"{key}: {value}", text)
        assert many == 1, line
    assert not re.search(r": FILL IN", text)
    study.write_text(text, encoding="utf-8")


@pytest.mark.slow
def test_the_readme_from_top_to_bottom(tmp_path, monkeypatch):
    pytest.importorskip("rosbags")
    pytest.importorskip("cvxpy")
    monkeypatch.chdir(tmp_path)
    for found in BLOCK.finditer(README):
        note, language, text = found["note"] or "", found["language"], found["text"]
        if note.startswith("file: "):
            file = tmp_path / note.removeprefix("file: ")
            file.parent.mkdir(exist_ok=True)
            file.write_text(text, encoding="utf-8")
            if file.name == "arm.yaml":
                somebody_elses_log(file)
        elif note.startswith("fill in: "):
            fill_in(tmp_path / note.removeprefix("fill in: "), text)
        elif language == "bash":
            for command in commands(text):
                run(command, tmp_path)
                if command.startswith("ident simulate"):
                    somebody_elses_files(tmp_path)
        elif language == "python":
            exec(compile(text, "README.md", "exec"), {})
    for page in ("diagnosis/report.html", "fit/report.html", "cell-fit/report.html"):
        assert (tmp_path / page).stat().st_size > 1e6
    found = json.loads((tmp_path / "diagnosis" / "diagnosis.json").read_text())["findings"]
    assert [(f["effect"], f["joints"]) for f in found] == [("stribeck_friction", [2])]
    names = {p["name"] for p in json.loads((tmp_path / "cell-fit" / "fit.json").read_text())["parameters"]}
    assert any("grease" in name for name in names), names
    for written in ("prediction/predict.json", "arm_identified.urdf", "study.html", "fit.html", "c_code/A.h"):
        assert (tmp_path / written).is_file(), written
    header = (tmp_path / "c_code" / "A.h").read_text()
    for declared in re.findall(r"^    void (.*);$", README, re.M):
        assert declared.split("(")[0] in header


def test_every_bash_line_is_either_set_up_or_executed():
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.M)
    for text in (README, CONTRIBUTING):
        for _, block in blocks(text, "bash"):
            for line in block.splitlines():
                if line.startswith("make "):
                    assert line.split()[1] in targets
        for option in re.findall(r"`make (\w+)`", text):
            assert option in targets


@pytest.mark.long
def test_benchmarks_that_are_named_are_there_and_explain_themselves():
    named = set(re.findall(r"`python (benchmarks/\w+\.py)`", README + CONTRIBUTING))
    assert named
    for path in named:
        assert "usage" in run(f"{sys.executable} {ROOT / path} --help", ROOT)


def test_the_effect_in_contributing_is_one(tmp_path):
    from modelgen.effects.registry import _from_file

    (_, text), *_ = blocks(CONTRIBUTING, "python")
    (tmp_path / "asymmetric.py").write_text(text, encoding="utf-8")
    made = _from_file(tmp_path / "asymmetric.py")
    made = made() if isinstance(made, type) else made
    assert made.linear_names == ("Fva",) and made.name in {path.stem for path in CATALOGUE.glob("*.py")}


def test_every_command_is_in_the_table_of_commands():
    import typer

    from ident.command_line.cli import commands

    table = README[README.index("## Commands") : README.index("## Measured robots")]
    shown = set(re.findall(r"^\| `ident (\w+)", table, re.M))
    assert shown == set(typer.main.get_command(commands()).commands)


def test_every_key_of_a_study_is_in_its_table():
    from ident.recordings.study import ColumnMap, FilterSettings, RecordingEntry, Study

    table = README[README.index("Every key of a study") : README.index("</details>")]
    for model in (Study, RecordingEntry, FilterSettings, ColumnMap):
        for name, entry in model.model_fields.items():
            key = entry.alias or name
            assert re.search(rf"\b{key}\b", table) or entry.exclude, key
    shown = {
        key
        for line in table.splitlines()
        for key in re.findall(r"`(\w+)`", line.split("|")[1] if "|" in line else "")
    }
    assert shown == {name for name, entry in Study.model_fields.items() if not entry.exclude}


def test_every_effect_of_the_catalogue_is_reachable_from_the_readme():
    from modelgen.effects import catalogue

    assert "](modelgen/effects/catalogue)" in README
    listed = (ROOT / re.search(r"\]\((docs/effects\.md)\)", README)[1]).read_text(encoding="utf-8")
    for name in {path.stem for path in CATALOGUE.glob("[a-z]*.py")} & set(catalogue()):
        assert f"## {name}\n" in listed, name


@pytest.mark.parametrize("name", ["README.md", ".github/CONTRIBUTING.md"])
def test_links_into_the_project_lead_somewhere(name):
    folder = (ROOT / name).parent
    text = (ROOT / name).read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!https?:)([^)#]*)(?:#[^)]*)?\)", text):
        assert not target or (folder / target).exists(), target
    anchors = {re.sub(r"[^\w -]", "", line.lstrip("# ").lower()).replace(" ", "-") for line in headings(text)}
    for anchor in re.findall(r"\]\(#([^)]*)\)", text):
        assert anchor in anchors


def headings(text: str) -> list[str]:
    return [
        line
        for line in re.sub(r"^```.*?^```", "", text, flags=re.M | re.S).splitlines()
        if line.startswith("#")
    ]
