"""Every command line, file and Python block of README and CONTRIBUTING does what it says, in order."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
CONTRIBUTING = (ROOT / ".github" / "CONTRIBUTING.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^(?:<!-- (?P<note>[^>]*) -->\n)?```(?P<language>\w+)\n(?P<text>.*?)^```", re.M | re.S)
SETUP = ("make ", "pip install", "git clone", "cd ")  # executed by whoever runs these tests


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


def somebody_elses_log(source: Path, target: Path) -> None:
    """A recording as another program would write it: a header of its own, ms, degrees, N mm, CSV."""
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(source)
    n = sum(name.startswith("q") for name in table.column_names)
    columns = {"Time_ms": 1000 * table["t"].to_numpy()}
    columns |= {f"J{j}_deg": np.degrees(table[f"q{j}"].to_numpy()) for j in range(1, n + 1)}
    columns |= {f"J{j}_Nmm": 1000 * table[f"tau_m{j}"].to_numpy() for j in range(1, n + 1)}
    np.savetxt(target, np.column_stack(list(columns.values())), fmt="%.6g", delimiter=",",
               header=",".join(columns), comments="")  # fmt: skip


@pytest.mark.slow
def test_the_readme_from_top_to_bottom(tmp_path):
    for found in BLOCK.finditer(README):
        note, language, text = found["note"] or "", found["language"], found["text"]
        if note.startswith("file: "):
            (tmp_path / note.removeprefix("file: ")).write_text(text)
            if "monday.csv" in text:
                for day, twin in zip(("monday", "tuesday"), recordings(tmp_path / "twin"), strict=True):
                    somebody_elses_log(twin, tmp_path / f"{day}.csv")
        elif language == "bash":
            for command in commands(text):
                run(command, tmp_path)
        elif language == "python":
            exec(compile(text, "README.md", "exec"), {})
    for folder in ("fit", "diagnosis", "twin-stribeck-diagnosis"):
        assert (tmp_path / folder / "report.html").stat().st_size > 1e6
    assert (tmp_path / "fit" / "fit.json").is_file() and (tmp_path / "diagnosis" / "diagnosis.json").is_file()


def recordings(folder: Path) -> list[Path]:
    found = sorted(folder.glob("*.parquet"))
    assert len(found) >= 2, found
    return found[:2]


def test_every_bash_line_is_either_set_up_or_executed():
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.M)
    for text in (README, CONTRIBUTING):
        for _, block in blocks(text, "bash"):
            for line in block.splitlines():
                if line.startswith("make "):
                    assert line.split()[1] in targets
        for option in re.findall(r"`make (\w+)`", text):
            assert option in targets


def test_benchmarks_that_are_named_are_there_and_explain_themselves():
    named = set(re.findall(r"`python (benchmarks/\w+\.py)`", README + CONTRIBUTING))
    assert named
    for path in named:
        assert "usage" in run(f"{sys.executable} {ROOT / path} --help", ROOT)


def test_the_effect_in_contributing_is_one():
    from modelgen.effects import Effect

    (_, text), *_ = blocks(CONTRIBUTING, "python")
    names: dict = {}
    exec(compile(text, "CONTRIBUTING.md", "exec"), names)
    assert isinstance(names["EFFECT"], Effect)


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

    folder = ROOT / re.search(r"\]\((modelgen/effects/catalogue)\)", README)[1]
    assert all((folder / f"{name}.py").is_file() for name in catalogue())


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
