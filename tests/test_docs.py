"""`make docs`: every docstring renders, and a warning is an error."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_api_pages_are_built_without_a_warning(tmp_path):
    pytest.importorskip("pdoc", reason="pdoc is not installed")
    recipe = next(line for line in (ROOT / "Makefile").read_text().splitlines() if "-m pdoc" in line).split()
    packages = [word for word in recipe if word in ("modelgen", "generated", "ident")]
    command = [sys.executable, "-W", "error", "-m", "pdoc", "--math", "-o", str(tmp_path), *packages]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    assert len(packages) == 3
    for page in ("modelgen/regrouping.html", "generated.html", "ident/fit.html"):
        assert (tmp_path / page).stat().st_size > 5000


def test_every_module_opens_with_a_sentence():
    import ast

    for package in ("modelgen", "generated", "ident", "benchmarks"):
        for path in sorted((ROOT / package).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            if text.strip():
                assert ast.get_docstring(ast.parse(text)), f"{path.relative_to(ROOT)} has no opening sentence"
