"""The API site: pages of every module, and one page an effect, made from its class.

    python docs/pages.py build/docs            # the site; a warning of pdoc is an error
    python docs/pages.py build/docs --plain    # without the sources of what is described: half of the time
    python docs/pages.py --table docs/effects.md   # the table of effects that README links to

Nothing is looked up on the network while the site is built; formulas are plain text.
"""

from __future__ import annotations

import argparse
import html
import importlib
import inspect
import pkgutil
import warnings
from collections.abc import Sequence
from pathlib import Path

from modelgen.effects import catalogue
from modelgen.effects.effect import Effect
from modelgen.effects.listing import formula

PACKAGES = ("modelgen", "generated", "ident")
STANDS = {"joint": "on a joint", "pair": "on a joint, by another one", "robot": "on the whole robot"}
KINDS = {
    "column": "a torque",
    "motion": "a displacement of the link behind the gear",
    "measurement": "in what is recorded, not in the robot",
    "load": "a load from outside",
}
STYLE = (
    "body{font:16px/1.5 system-ui,sans-serif;max-width:46rem;margin:2rem auto;padding:0 1rem}"
    "table{border-collapse:collapse}td,th{border:1px solid #8888;padding:.2rem .6rem;text-align:left}"
    "code{overflow-wrap:anywhere}@media(prefers-color-scheme:dark){body{background:#111;color:#ddd}a{color:#8bf}}"
)


def parameters(e: Effect) -> list[tuple[str, str, str, str]]:
    """Name, unit on a joint that turns, role, bounds or typical value, of what is reported."""
    searched = {p.name: p for p in e.nonlinear}
    rows = []
    for q in e.quantities:
        p = searched.get(q.name)
        role = "shape" if p is not None else "size" if q.name in e.size_names else ""
        span = f"{p.low:g} to {p.high:g}" if p is not None else ""
        typical = f"{e.typical[q.name]:g}" if q.name in e.typical else ""
        rows.append((q.name, q.unit, role, span or (f"about {typical}" if typical else "")))
    return rows


def request(e: Effect) -> str:
    """How a command names it."""
    if e.joints == "robot":
        return e.name
    return f"{e.name}:2" + (":source_joint=1" if e.joints == "pair" else "")


def effect_page(e: Effect) -> str:
    """One effect as HTML: what its class says."""
    module = type(e).__module__
    rows = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in parameters(e)
    )
    table = f"<table><tr><th>parameter<th>unit<th>is<th>range</tr>{rows}</table>" if rows else "<p>None.</p>"
    said = inspect.getdoc(type(e)) or ""
    parts = [
        f"<p>{html.escape(e.summary[:1].upper() + e.summary[1:])}.</p>",
        f"<p><code>{html.escape(formula(e))}</code></p>",
        f"<p>It is {KINDS[e.kind]}, {STANDS[e.joints]}.</p>",
        f"<h2>Parameters</h2>{table}",
        "<p>On a joint that slides N m reads N and rad reads m; ranges follow its travel.</p>",
        f"<h2>In a residual</h2><p>{html.escape(e.signature)}</p>",
        f"<h2>What to do</h2><p>{html.escape(e.remedy)}</p>",
        f"<h2>Source</h2><p>{html.escape(e.source)}</p>",
        f"<h2>Use</h2><p>In a study: <code>effects: [{html.escape(request(e))}]</code><br>"
        f"In a twin: <code>ident simulate ROBOT --effect {html.escape(request(e))} -o twin</code></p>",
        f'<p><a href="../{module.replace(".", "/")}.html">Its class</a> · ',
        '<a href="index.html">All effects</a></p>',
    ]
    if said and said.rstrip(".") != e.summary.rstrip("."):
        parts.insert(1, f"<p>{html.escape(said)}</p>")
    return page(e.name, "".join(parts))


def effects_index(effects: Sequence[Effect]) -> str:
    rows = "".join(
        f'<tr><td><a href="{e.name}.html">{e.name}</a></td><td>{html.escape(e.summary)}</td></tr>'
        for e in effects
    )
    return page(
        "Effects",
        f'<table><tr><th>effect<th>what it is</tr>{rows}</table><p><a href="../index.html">Index</a></p>',
    )


def index(effects: Sequence[Effect], modules: Sequence[str]) -> str:
    """The first page: where to begin, every module by its opening sentence, the effects."""
    rows = ""
    for name in modules:
        first = (inspect.getdoc(importlib.import_module(name)) or "").split("\n\n")[0].replace("\n", " ")
        link = f'<a href="{name.replace(".", "/")}.html">{name}</a>'
        rows += f"<tr><td>{link}</td><td>{html.escape(first)}</td></tr>"
    body = (
        '<p>Begin with <a href="ident.html">ident</a> (everything the commands do) or '
        '<a href="generated.html">generated</a> (the regressor in your own code).</p>'
        f'<p><a href="effects/index.html">{len(effects)} effects</a>, one page each.</p>'
        f"<h2>Rooms and modules</h2><table>{rows}</table>"
    )
    return page("dynident", body)


def page(title: str, body: str) -> str:
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{html.escape(title)}</title><style>{STYLE}</style><h1>{html.escape(title)}</h1>{body}</html>\n"
    )


def effects_table(effects: Sequence[Effect]) -> str:
    """The same for readers of the repository, in Markdown."""
    lines = [
        "# Effects",
        "Written by `python docs/pages.py --table docs/effects.md` from the classes in",
        "[modelgen/effects/catalogue](../modelgen/effects/catalogue). Units are those of a joint that turns;",
        "on one that slides N m reads N and rad reads m. `make docs` builds a page for each.",
        "",
        "| effect | what it is | term | parameters |",
        "|---|---|---|---|",
    ]
    for e in effects:
        told = ", ".join(f"`{name}` [{unit}]" for name, unit, _, _ in parameters(e)) or "none"
        cells = [f"[{e.name}](#{e.name})", e.summary, f"`{formula(e)}`", told]
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    for e in effects:
        lines += ["", f"## {e.name}", f"- In a residual: {e.signature}.", f"- What to do: {e.remedy}."]
        lines.append(f"- Source: {e.source}.")
    return "\n".join(lines) + "\n"


def rooms() -> list[str]:
    """The packages and what is directly inside them, by name."""
    names = []
    for name in PACKAGES:
        inside = pkgutil.iter_modules(importlib.import_module(name).__path__, f"{name}.")
        names += [name, *(m.name for m in inside if not m.name.endswith("__"))]
    return names


def _unseen(module: str) -> bool:
    """Whether pdoc passes it over, because its package's `__all__` names other things."""
    package, _, name = module.rpartition(".")
    public = getattr(importlib.import_module(package), "__all__", None)
    return public is not None and name not in public


def build(folder: Path, sources: bool = True) -> None:
    """Write the site into `folder`."""
    import pdoc

    effects = [e for _, e in sorted(catalogue().items())]
    modules = rooms()
    hidden = [name for name in modules if name not in PACKAGES and _unseen(name)]
    pdoc.render.configure(math=True, show_source=sources)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pdoc.pdoc(*PACKAGES, *hidden, output_directory=folder)
    (folder / "effects").mkdir(exist_ok=True)
    for e in effects:
        (folder / "effects" / f"{e.name}.html").write_text(effect_page(e), encoding="utf-8")
    (folder / "effects" / "index.html").write_text(effects_index(effects), encoding="utf-8")
    (folder / "index.html").write_text(index(effects, modules), encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", nargs="?", default="build/docs", type=Path)
    parser.add_argument("--table", type=Path, help="write only the table of effects, as Markdown")
    parser.add_argument("--plain", action="store_true", help="without sources")
    given = parser.parse_args()
    if given.table:
        given.table.write_text(effects_table([e for _, e in sorted(catalogue().items())]), encoding="utf-8")
    else:
        build(given.folder, sources=not given.plain)


if __name__ == "__main__":
    main()
