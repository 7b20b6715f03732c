"""SVG files of a diagnosis: the residual and the torque of what was found through it. Only drawing."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ident.diagnosis import Diagnosis
from ident.report.diagnosis_report import View, binned_median
from ident.report.diagnosis_result import views_of
from ident.report.finding_words import effect_name, errors_about, held_out, place
from ident.report.wording import percent, readable_unit

BEFORE, AFTER = "#d9822b", "#1f6fc4"


def draw_all(diagnosis: Diagnosis, document: Mapping[str, Any], folder: Path) -> None:
    """One file per finding and per unexplained structure, numbered as in diagnosis.json."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    folder.mkdir(parents=True, exist_ok=True)
    for view in views_of(diagnosis):
        kind, index = view.belongs_to
        item = document[kind][index]
        with matplotlib.rc_context({"svg.hashsalt": "dynident", "font.size": 10}):
            figure = Figure(figsize=(9, 3.2) if view.has_effect else (5, 3.2), layout="constrained")
            FigureCanvasSVG(figure)
            residual(view, document, item, figure)
            name = item.get("effect", "unexplained")
            figure.savefig(folder / f"{index + 1}_{name}.svg", dpi=160, metadata={"Date": None})


def residual(view: View, document: Mapping[str, Any], item: Mapping[str, Any], figure: Any) -> list[Any]:
    """Without it beside with it on one scale; returns the axes."""
    shown = [("before", view.before, BEFORE)]
    shown += [("after", view.before - view.effect, AFTER)] if view.has_effect else []
    axes = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    errors, role = dict(zip(("before", "after"), errors_about(document, item))), held_out(document)
    for ax, (when, values, colour) in zip(axes, shown, strict=True):
        ax.plot(view.x, values, ".", color=colour, ms=2.5, alpha=0.6, rasterized=True)
        if when == "before" and view.has_effect:
            x, y, smooth = view.curve
            ax.plot(x, y, "-" if smooth else ".", color="black", lw=1.2, ms=1.5, label="its own torque")
            ax.legend(fontsize="small")
        else:
            ax.plot(*binned_median(view.x, values), color="black", lw=1)
        ax.axhline(0, color="0.6", lw=0.6, zorder=0)
        ax.set_xlabel(f"{view.variable} [{readable_unit(view.variable_unit)}]")
        error = errors[when][role].get(view.channel)
        ax.set_title(f"{when}: {percent(error)} error on {role} runs" if error is not None else when)
    axes[0].set_ylabel(f"residual of {view.channel} [{readable_unit(view.unit)}]")
    what = effect_name(item["effect"]) if "effect" in item else "no known effect"
    figure.suptitle(f"{what}, {place(item['joints'])}")
    return list(axes)
