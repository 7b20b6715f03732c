"""A `ReportPage` as one HTML file that needs no network: style, script, plotly.js and data inside."""

import functools
import importlib.util
import json
from pathlib import Path
from typing import Any

from ident.report.figures import figure
from ident.report.page import Plot, ReportPage, Table

TEMPLATES = Path(__file__).parent / "templates"
PLACE = "plotly.js comes here"
FILTER_FROM_ROWS = 12  # a longer table gets a filter box


def render(page: ReportPage) -> str:
    """The whole HTML text, about 5 MB, most of it plotly.js."""
    return b"".join(_parts(page)).decode("utf-8")


def write(page: ReportPage, path: Path) -> None:
    """The same as a file; plotly.js is copied as the bytes it is, a text of it takes 10 MB and its copies."""
    with path.open("wb") as out:
        out.writelines(_parts(page))


def _parts(page: ReportPage) -> tuple[bytes, bytes, bytes]:
    """Up to plotly.js, plotly.js, and the rest."""
    text = _template("page.html").render(
        page=page,
        style=(TEMPLATES / "page.css").read_text(encoding="utf-8"),
        script=(TEMPLATES / "page.js").read_text(encoding="utf-8"),
        plotly=PLACE,
        filter_from_rows=FILTER_FROM_ROWS,
    )
    head, _, tail = text.rpartition(f"<script>{PLACE}</script>")
    return f"{head}<script>".encode(), plotly_javascript(), f"</script>{tail}".encode()


def render_table(table: Table) -> str:
    """One table as a fragment of HTML, for a notebook."""
    return _template("table.html").render(block=table, filter_from_rows=len(table.rows) + 1)


def _template(name: str) -> Any:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.tests["plot"] = lambda block: isinstance(block, Plot)
    environment.tests["table"] = lambda block: isinstance(block, Table)
    environment.globals["plot_json"] = plot_json
    return environment.get_template(name)


def plot_json(plot: Plot) -> str:
    """The figure for a `<script type="application/json">`: no `</` that would end the script early."""
    return json.dumps(figure(plot), separators=(",", ":")).replace("</", "<\\/")


@functools.cache
def plotly_javascript() -> bytes:
    """plotly.js as the plotly wheel carries it; the wheel's Python is not imported (that takes a second)."""
    spec = importlib.util.find_spec("plotly")
    assert spec is not None and spec.origin is not None, "plotly is a dependency of this package"
    text = (Path(spec.origin).parent / "package_data" / "plotly.min.js").read_bytes()
    assert b"</script" not in text and b"</SCRIPT" not in text
    return text
