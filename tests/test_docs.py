"""`make docs`: every docstring renders, a warning is an error; a page an effect, made from its class."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def recipe() -> list[str]:
    """What `make docs` runs, without the interpreter."""
    text = (ROOT / "Makefile").read_text()
    return re.search(r"^docs:.*\n\t\$\(BIN\)/python (.*)$", text, re.M)[1].split()


class Links(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.found += [value for name, value in attributes if name == "href" and value]


@pytest.mark.long
def test_the_site_is_built_without_a_warning_and_its_links_lead_somewhere(tmp_path):
    pytest.importorskip("pdoc", reason="pdoc is not installed")
    from modelgen.effects import catalogue

    *script, folder = recipe()
    assert folder == "build/docs"
    command = [sys.executable, *script, str(tmp_path), "--plain"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=500)
    assert done.returncode == 0, done.stderr[-2000:]
    for page in ("modelgen/base_parameters/regrouping.html", "generated.html", "ident/api/fit.html"):
        assert (tmp_path / page).stat().st_size > 5000
    effects = tmp_path / "effects"
    assert {path.stem for path in effects.glob("*.html")} >= {"index", *catalogue()}
    for page in (tmp_path / "index.html", *effects.glob("*.html")):
        for link in Links(page.read_text(encoding="utf-8")).found:
            assert (page.parent / link).is_file(), f"{page.name}: {link}"


def test_the_table_of_effects_is_what_the_classes_say(tmp_path):
    new = tmp_path / "effects.md"
    command = [sys.executable, str(ROOT / "docs" / "pages.py"), "--table", str(new)]
    subprocess.run(command, check=True, timeout=100)
    stale = "docs/effects.md is stale: run python docs/pages.py --table docs/effects.md and read the diff"
    assert new.read_text("utf-8") == (ROOT / "docs" / "effects.md").read_text("utf-8"), stale


def test_every_module_opens_with_a_sentence():
    import ast

    for package in ("modelgen", "generated", "ident", "benchmarks", "docs"):
        for path in sorted((ROOT / package).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            if text.strip():
                assert ast.get_docstring(ast.parse(text)), f"{path.relative_to(ROOT)} has no opening sentence"
