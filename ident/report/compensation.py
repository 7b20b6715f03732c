"""C of a fitted model with its effects, and the numbers for it: what a controller compensates with.

Effects that are columns of a regressor are in it; gains, delays, loads and windows are not. values.json has
chi by the names of the descriptions, shape parameters by those of the extra inputs, and names the signals
that the caller gives at every instant."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ident.equations.terms import Term
from ident.estimation.fit import FitResult


def request(term: Term, labels: tuple[Any, ...]) -> str | None:
    """NAME:JOINT[:option] as `regenerate-model --effect` takes it; None where the term is no column."""
    place = term.place
    if term.effect.kind != "column" or place.joint is None or place.recording is not None:
        return None
    parts = [term.effect.name, str(labels[place.joint])]
    parts += [] if place.source is None else [f"source_joint={labels[place.source]}"]
    parts += ["side=link"] if term.effect.channel == "motor" and place.side == "link" else []
    return ":".join(parts)


def write_model(result: FitResult, folder: Path) -> None:
    """The files of `regenerate-model` with the effects, and values.json; nothing without such effects.

    Raises ModelgenError."""
    from modelgen.base_parameters.rules import declared_payload, derive_rules
    from modelgen.emit.regenerate import Plan, files
    from modelgen.geometry.robot_file import load_robot

    labels = tuple(result.columns.need.joints)
    asked = [(term, text) for term in result.terms if (text := request(term, labels))]
    if not asked:
        return
    study = result.study
    robot = load_robot(study.robot_source, study.exact)
    robot = robot if study.gravity is None else robot.with_gravity(study.gravity)
    payload, requests = declared_payload(robot), tuple(text for _, text in asked)
    plan = Plan(robot, payload, requests, {study.model: derive_rules(robot, study.model, payload)})
    made = files(plan, lambda text, done=None: None)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in made.items():
        (folder / name).write_text(text, encoding="utf-8")
    values = json.dumps(_values(result, asked, robot), indent=1)
    (folder / "values.json").write_text(values + "\n", encoding="utf-8")


def _values(result: FitResult, asked: list[tuple[Term, str]], robot: Any) -> dict[str, Any]:
    """chi, extra inputs that are numbers, extra inputs that are signals."""
    from modelgen.dynamics.models import model
    from modelgen.emit.effect_columns import effect_columns

    columns, kind = result.columns, model(result.study.model)
    own = {name for term in result.terms for name in term.names}
    chi = {n: float(x) for n, x in zip(columns.parameters, result.estimate.chi) if n not in own}
    extra: dict[str, float] = {}
    signals: list[str] = []
    made = list(effect_columns(robot, kind, [text for _, text in asked], tuple(chi)))
    for term, text in asked:
        rows = {
            columns.need.channels[c].name(robot.joint_labels) for c in term.place.rows(columns.need.channels)
        }
        sizes = dict(zip(term.linear, term.size))
        count = len(effect_columns(robot, kind, (text,), ()))
        names = list(term.effect.terms) * (count // len(term.effect.terms))
        mine, made = made[:count], made[count:]
        for name, column in zip(names, mine):
            shown = {columns.model.channels[row] for row, _ in column.channels}
            chi[column.name] = float(sizes.get(name, 0.0)) if shown & rows else 0.0
            for label in column.extra_inputs:
                shape = next(
                    (n for n in term.theta if label.startswith(n) and label[len(n) :][:1].isdigit()), None
                )
                if shape is not None:
                    extra[label] = float(term.theta[shape])
                elif label not in signals:
                    signals.append(label)
    return {"chi": chi, "extra": extra, "signals": signals}
