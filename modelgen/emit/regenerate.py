"""What `regenerate-model` does: rules and files of a robot's models, their comparison, their writing."""

from __future__ import annotations

import difflib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from modelgen.base_parameters import rules_text
from modelgen.base_parameters.rules import Rules, declared_payload, derive_rules
from modelgen.dynamics.models import model
from modelgen.emit.effect_columns import EffectNotSeenError, effect_columns
from modelgen.geometry.robot import Robot
from modelgen.geometry.robot_file import load_robot
from modelgen.output import staged
from modelgen.paper import comparison as paper_comparison
from modelgen.paper import rules as paper_rules
from modelgen.terminal import Progress


@dataclass(frozen=True, slots=True)
class Plan:
    """A robot's chosen models: `rules` with the payload that the file declares, by model's name."""

    robot: Robot
    payload: str | None
    effects: tuple[str, ...]
    rules: Mapping[str, Rules]


def plan(
    robot: str,
    models: Sequence[str],
    effects: tuple[str, ...],
    all_named: bool,
    tell: Progress,
    exact: bool = False,
) -> Plan:
    """Read the robot and derive its rules, without the models that do not see the effects unless `all_named`.

    `exact`: a URDF's numbers as they are written. Raises ModelgenError.
    """
    tell(f"reading {robot}", 0.0)
    value = load_robot(robot, exact)
    payload = declared_payload(value)
    rules = {}
    unseen: EffectNotSeenError | None = None
    for k, name in enumerate(models):
        tell(f"regrouping model {name}", 0.02 + 0.15 * k / len(models))
        try:
            effect_columns(value, model(name), effects, ())
        except EffectNotSeenError as error:
            unseen = error
            if all_named:
                raise
            continue
        rules[name] = derive_rules(value, name, payload)
    if unseen and not rules:
        raise unseen
    return Plan(value, payload, effects, rules)


def as_json(plan: Plan) -> list[dict[str, Any]]:
    """Contract 8: per model its rules and the operations of its regressor."""
    from modelgen.emit.description import inertial_columns
    from modelgen.programs.cheapest import columns_program

    counts: dict[tuple, dict[str, int]] = {}
    result = []
    for rules in plan.rules.values():
        columns = inertial_columns(rules)
        key = columns.key
        if key not in counts:
            operations = columns_program(plan.robot, columns)[1].operations
            counts[key] = {"add": operations.add, "mul": operations.mul}
        result.append({**rules_text.as_json(rules), "operations": counts[key]})
    return result


def as_text(plan: Plan, style: str) -> str:
    """The rules of every model as "plain" text, "markdown" or "latex"."""
    if style == "markdown":
        return "\n".join(rules_text.as_markdown(rules) for rules in plan.rules.values())
    if style == "latex":
        return "\n".join(rules_text.as_latex(rules) for rules in plan.rules.values())
    lines = []
    for rules in plan.rules.values():
        payload = f", payload {plan.payload}" if rules.payload else ""
        lines.append(
            f"{plan.robot.name}, model {rules.model.name}{payload}: {len(rules.base)} base parameters"
        )
        lines += [
            f"  {base.name} = {rules_text.regroups(base)}" for base in rules.base if len(base.combination) > 1
        ]
        alone = [base.name for base in rules.base if len(base.combination) == 1]
        lines += [f"  alone: {', '.join(alone) or 'none'}"]
        lines += [f"  in no torque: {', '.join(rules.unidentifiable) or 'none'}", ""]
    return "\n".join(lines)


def files(plan: Plan, tell: Progress) -> dict[str, str]:
    """Name -> text of every file: C, header, description of each model with and without payload; rules."""
    from modelgen.emit import c_code
    from modelgen.emit.description import derive_from_rules

    made_of = c_code.provenance(plan.robot.source_sha256)
    result: dict[str, str] = {}
    variants = list(_variants(plan))
    for k, rules in enumerate(variants):
        tell(f"emitting model {rules.model.name}", 0.2 + 0.5 * k / len(variants))
        derived = derive_from_rules(rules, plan.effects)
        stem = c_code.file_stem(derived.description)
        result[f"{stem}.c"] = c_code.source(derived, made_of)
        result[f"{stem}.h"] = c_code.header(derived, made_of)
        result[f"{stem}.json"] = _json(c_code.described(derived, made_of))
    if not plan.effects:
        result["rules.md"] = _rules_document(plan)
        if plan.robot.name == paper_rules.ROBOT and plan.payload:
            result["paper_comparison.md"] = paper_comparison.document(plan.robot)
    return result


def _variants(plan: Plan) -> list[Rules]:
    """The models without payload, and with it where they see one."""
    result = []
    for name, rules in plan.rules.items():
        if rules.payload and any(p.payload for p in rules.standard):
            result += [derive_rules(plan.robot, name), rules]
        else:
            result.append(derive_rules(plan.robot, name) if rules.payload else rules)
    return result


def _rules_document(plan: Plan) -> str:
    payload = f" with payload {plan.payload}" if plan.payload else ""
    head = (
        f"# Base parameters of {plan.robot.name}{payload}\n\n"
        "Written by regenerate-model from the robot file; do not edit. Names as in README's symbol table.\n\n"
    )
    return head + as_text(plan, "markdown")


def _json(description: Mapping[str, Any]) -> str:
    """One line per key, and per entry of a list or mapping that is long."""
    lines = []
    for key, value in description.items():
        if key == "nonzeros":
            rows: dict[int, list] = {}
            for entry in value:
                rows.setdefault(entry[0], []).append(entry)
            body = ",\n  ".join(json.dumps(row)[1:-1] for row in rows.values())
            lines.append(f' "{key}": [\n  {body}\n ]' if rows else f' "{key}": []')
        elif isinstance(value, dict) and len(value) > 4:
            body = ",\n  ".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in value.items())
            lines.append(f' "{key}": {{\n  {body}\n }}')
        else:
            lines.append(f" {json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def default_folder(plan: Plan, robot: str) -> Path:
    """The package's own folder for a robot whose C comes with it, else ./generated-NAME."""
    import generated

    committed = Path(generated.__file__).parent / plan.robot.name
    if robot == plan.robot.name and committed.is_dir() and not plan.effects:
        return committed
    return Path(f"generated-{plan.robot.name}")


def difference(files: Mapping[str, str], folder: Path, limit: int | None, complete: bool) -> str:
    """A unified diff from what is in `folder` to what would be written; "" when they agree.

    `complete`: `files` is all that the folder should hold, so that other C there is stale.
    """
    parts = []
    names = set(files)
    if complete and folder.is_dir():
        names |= {p.name for p in folder.iterdir() if p.suffix in (".c", ".h", ".json")}
    for name in sorted(names):
        path = folder / name
        old = path.read_text(encoding="utf-8") if path.is_file() else ""
        new = files.get(name, "")
        if old == new and path.is_file() == (name in files):
            continue
        lines = list(
            difflib.unified_diff(
                old.splitlines(keepends=True),
                new.splitlines(keepends=True),
                str(path) if old else "/dev/null",
                f"{name} (regenerated)" if new else "/dev/null",
            )
        )
        more = len(lines) - limit if limit else 0
        parts += lines[:limit] + ([f"... {more} more lines of {name}\n"] if more > 0 else [])
    return "".join(parts)


def write(files: Mapping[str, str], folder: Path, overwrite: bool = False) -> None:
    """Write all files or none, over nothing that was not written by this command. Raises OutputError."""
    with staged(folder, "regenerate-model", overwrite=overwrite, complete=False) as stage:
        for name, text in files.items():
            (stage / name).write_text(text, encoding="utf-8")


def compile_all(files: Mapping[str, str], tell: Progress) -> str:
    """Compile every model for this machine; the first load will not wait. Returns what went wrong, or ""."""
    from concurrent.futures import ThreadPoolExecutor, as_completed

    from generated import compiling

    stems = [name.removesuffix(".json") for name in files if name.endswith(".json")]
    models = {stem: (json.loads(files[f"{stem}.json"]), files[f"{stem}.c"]) for stem in stems}
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        waiting = {pool.submit(compiling.library, *model): stem for stem, model in models.items()}
        tell(f"compiling {', '.join(models)}", 0.7)
        for k, done in enumerate(as_completed(waiting), 1):
            tell(f"compiled {waiting[done]}", 0.7 + 0.3 * k / len(waiting))
            try:
                done.result()
            except compiling.NoCompilerError as error:
                return str(error)
    return ""
