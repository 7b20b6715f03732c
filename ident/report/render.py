"""A `ReportPage` as one HTML file that needs no network: style, script, plotly.js and data inside."""

import functools
import importlib.util
import json
from pathlib import Path
from typing import Any

from ident.report.figures import figure
from ident.report.page import Plot, ReportPage, Table

TEMPLATES = Path(__file__).parent / "templates"
FILTER_FROM_ROWS = 12  # a longer table gets a filter box


def render(page: ReportPage) -> str:
    """The whole HTML text, about 5 MB, most of it plotly.js."""
    return _template("page.html").render(
        page=page,
        style=(TEMPLATES / "page.css").read_text(encoding="utf-8"),
        script=(TEMPLATES / "page.js").read_text(encoding="utf-8"),
        plotly=plotly_javascript(),
        filter_from_rows=FILTER_FROM_ROWS,
    )


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
def plotly_javascript() -> str:
    """plotly.js as the plotly wheel carries it; the wheel's Python is not imported (that takes a second)."""
    spec = importlib.util.find_spec("plotly")
    assert spec is not None and spec.origin is not None, "plotly is a dependency of this package"
    text = (Path(spec.origin).parent / "package_data" / "plotly.min.js").read_text(encoding="utf-8")
    assert "</script" not in text and "</SCRIPT" not in text
    return text
