"""The command regenerate-model: what it prints, writes, compares and refuses."""

import json
import os
import subprocess
import sys

import pytest
from two_links import TWO_LINKS

from modelgen import cli
from modelgen.manifest import MANIFEST


@pytest.fixture
def robot(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DYNIDENT_CACHE", str(tmp_path / "cache"))
    (tmp_path / "two_links.yaml").write_text(TWO_LINKS)
    return tmp_path / "two_links.yaml"


def test_rules_as_json_are_the_contract(capsys):
    assert cli.run(["kuka_lwr4p", "--rules-only", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {m["model"]: m["base_parameters"] for m in found} == {"A": 79, "B": 74, "C": 102, "D": 28}
    for m in found:
        assert set(m) == {"model", "base_parameters", "parameters", "unidentifiable", "operations"}
        assert len(m["parameters"]) == m["base_parameters"] and set(m["operations"]) == {"add", "mul"}
    regroups = {p["name"]: p["regroups"] for p in found[0]["parameters"]}
    assert "rl3**2*(M3 + M4 + M5 + M6 + M7)" in regroups["ZZ2R"] and "M1" in found[0]["unidentifiable"]


@pytest.mark.parametrize(
    ("style", "shows"), [("--markdown", "| `ZZ2R` |"), ("--latex", r"\begin{align*}"), (None, "ZZ2R =")]
)
def test_rules_as_text(style, shows, capsys):
    assert cli.run(["kuka_lwr4p", "--rules-only", "--model", "A", *([style] if style else [])]) == 0
    assert shows in capsys.readouterr().out


def test_files_are_written_checked_and_found_stale(robot, tmp_path, capsys):
    folder = tmp_path / "out"
    assert cli.run([str(robot), "-o", str(folder)]) == 0
    names = {p.name for p in folder.iterdir()}
    assert names == {f"{m}.{s}" for m in "ABCD" for s in ("c", "h", "json")} | {"rules.md", MANIFEST}
    assert cli.run([str(robot), "-o", str(folder), "--check"]) == 0
    (folder / "B.c").write_text((folder / "B.c").read_text().replace("+", "-"))
    (folder / "old.c").write_text("int x;\n")
    capsys.readouterr()
    assert cli.run([str(robot), "-o", str(folder), "--check"]) == 1
    seen = capsys.readouterr()
    assert "--- " in seen.out and "B.c" in seen.out and "old.c" in seen.out and "A.c" not in seen.out
    assert "is stale: run regenerate-model" in seen.err
    (folder / "old.c").unlink()
    assert cli.run([str(robot), "-o", str(folder)]) == 2
    assert "B.c was changed since it was written" in capsys.readouterr().err
    assert cli.run([str(robot), "-o", str(folder), "--overwrite"]) == 0
    assert cli.run([str(robot), "-o", str(folder), "--check"]) == 0


def test_a_robot_of_ones_own_goes_beside_by_default(robot, tmp_path):
    assert cli.run([str(robot), "--model", "D"]) == 0
    assert {p.name for p in (tmp_path / "generated-two_links").iterdir()} == {
        "D.c",
        "D.h",
        "D.json",
        "rules.md",
        MANIFEST,
    }


def test_an_effect_is_emitted_with_the_models_that_see_it(robot, tmp_path):
    folder = tmp_path / "out"
    assert cli.run([str(robot), "--effect", "stribeck_friction:2", "-o", str(folder)]) == 0
    stems = {p.stem for p in folder.iterdir() if p.name != MANIFEST}
    assert stems == {f"{m}_stribeck_friction_2" for m in "ACD"}
    assert "exp(" in (folder / "A_stribeck_friction_2.c").read_text()
    assert "extra[0] vs2" in (folder / "A_stribeck_friction_2.h").read_text()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "Missing argument 'ROBOT'"),
        (["nowhere.yaml"], "nowhere.yaml: no such file"),
        (["kuka_lwr4p", "--model", "E"], "there is no model 'E'; choose A, B, C or D"),
        (["kuka_lwr4p", "--modle", "A"], "No such option"),
        (["kuka_lwr4p", "--effect", "stribek:2"], "did you mean stribeck_friction?"),
        (["kuka_lwr4p", "--effect", "stribeck_friction:9"], "with a joint of 1, 2, 3, 4, 5, 6, 7"),
        (["kuka_lwr4p", "--effect", "time_delay:1"], "is no column of a regressor"),
        (
            ["kuka_lwr4p", "-m", "B", "--effect", "stribeck_friction:2"],
            "does not act in the torques of model B",
        ),
        (["kuka_lwr4p", "--json", "--latex"], "exclude each other"),
        (["kuka_lwr4p", "--rules-only", "--check"], "--rules-only writes no files"),
        (["kuka_lwr4p", "-m", "D", "-o", "two_links.yaml"], "it is a file; name another folder with -o"),
    ],
)
def test_mistakes_get_one_sentence_and_status_2(robot, arguments, says, capsys):
    assert cli.run(arguments) == 2
    seen = capsys.readouterr()
    assert says in seen.err and seen.err.count("\n") == 1 and not seen.out


def test_a_folder_that_cannot_be_written_keeps_what_it_had(robot, tmp_path, capsys):
    if os.name == "nt" or os.getuid() == 0:
        pytest.skip("everything can be written here")
    folder = tmp_path / "closed"
    folder.mkdir(mode=0o500)
    assert cli.run([str(robot), "-m", "D", "-o", str(folder)]) == 2


def test_the_installed_command_in_a_pipe_shows_no_progress(tmp_path):
    command = [
        sys.executable,
        "-c",
        "from modelgen.cli import main; main()",
        "kuka_lwr4p",
        "--rules-only",
        "-m",
        "D",
    ]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=120)
    assert done.returncode == 0 and done.stderr == "" and "28 base parameters" in done.stdout
