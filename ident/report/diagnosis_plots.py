"""SVG files of a diagnosis: the residual against what gave an effect away, before and after. Only drawing."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ident.diagnosis import Diagnosis
from ident.report.diagnosis_report import POINTS, ResidualView, effect_name, place
from ident.report.diagnosis_result import views_of
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
            figure = Figure(figsize=(9, 3.2) if view.after is not None else (5, 3.2), layout="constrained")
            FigureCanvasSVG(figure)
            residual(view, document, item, figure)
            name = item.get("effect", "unexplained")
            figure.savefig(folder / f"{index + 1}_{name}.svg", dpi=160, metadata={"Date": None})


def residual(
    view: ResidualView, document: Mapping[str, Any], item: Mapping[str, Any], figure: Any
) -> list[Any]:
    """Before beside after on one scale; returns the axes."""
    states = [("before", view.before, BEFORE)]
    if view.after is not None:
        states.append(("after", view.after, AFTER))
    axes = figure.subplots(1, len(states), sharey=True, squeeze=False)[0]
    step = max(len(view.x) // POINTS, 1)
    errors = document["error_percent"]
    role = next(role for role in ("test", "validate", "identify") if role in errors["before"])
    for ax, (name, values, colour) in zip(axes, states, strict=True):
        ax.plot(view.x[::step], values[::step], ".", color=colour, ms=2.5, alpha=0.6, rasterized=True)
        for (label, curve), line in zip(view.medians(values).items(), ("-", "--"), strict=False):
            ax.plot(*curve, line, color="black", lw=1, label=label)
        ax.axhline(0, color="0.6", lw=0.6, zorder=0)
        ax.set_xlabel(f"{view.variable} [{readable_unit(view.variable_unit)}]")
        error = errors[name][role].get(view.channel)
        ax.set_title(f"{name}: {percent(error)} error on {role} runs" if error is not None else name)
    if view.forward is not None:
        axes[0].legend(fontsize="small")
    axes[0].set_ylabel(f"residual of {view.channel} [{readable_unit(view.unit)}]")
    what = effect_name(item["effect"]) if "effect" in item else "no known effect"
    figure.suptitle(f"{what}, {place(item['joints'])}")
    return list(axes)
