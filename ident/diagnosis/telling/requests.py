"""A finding as the commands take it, and the command whose motion tells it from another explanation."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ident.recordings.study import Study, expand
from modelgen.effects import catalogue


def request_of(finding: Mapping[str, Any]) -> str:
    """NAME:JOINT[:param=value,...] of a finding or an alternative, as --separate takes it."""
    joints, parameters = list(finding.get("joints") or []), dict(finding.get("parameters") or {})
    effect = catalogue().get(str(finding["effect"]))
    told = {name: entry["value"] for name, entry in parameters.items() if isinstance(entry, Mapping)}
    known = {quantity.name for quantity in effect.quantities} if effect else set()
    given = [f"{name}={value:.6g}" for name, value in told.items() if name in known and value is not None]
    beside = finding.get("source_joint", joints[1] if len(joints) > 1 else None)
    source = parameters.get("source_joint", beside)
    source = source.get("value") if isinstance(source, Mapping) else source
    if effect is not None and effect.joints == "pair" and source is not None:
        given.append(f"source_joint={source}")
    return ":".join([str(finding["effect"]), str(joints[0]) if joints else "", ",".join(given)]).rstrip(":")


def robot_of(study: Study) -> str:
    """The robot as a command takes it, from wherever it is typed."""
    source = Path(study.robot_source)
    return str(source.resolve()) if source.is_file() else study.robot


def own_effects_of(study: Study) -> str | None:
    """The folder of a user's own effects, from wherever the command is typed."""
    folder = study.effects_folder
    return str((study.path / expand(folder)).resolve()) if folder else None


def separating_command(
    robot: str,
    finding: Mapping[str, Any],
    rivals: Sequence[Mapping[str, Any]],
    model: str = "A",
    effects_folder: str | None = None,
) -> str:
    """The command that designs the motion which tells a finding from its rivals."""
    requests = ",".join(dict.fromkeys(request_of(item) for item in (finding, *rivals)))
    where = f" --model {model}" if model != "A" else ""
    where += f" --effects-folder {shlex.quote(effects_folder)}" if effects_folder else ""
    return f"ident excite {shlex.quote(robot)}{where} --separate {requests} -o MOTION"


def separable(finding: Mapping[str, Any], alternative: Mapping[str, Any]) -> bool:
    """Whether a motion could tell the two apart: two effects of joints, each with a place that is known."""
    for item in (finding, alternative):
        effect = catalogue().get(str(item["effect"]))
        if effect is None or not item.get("joints"):
            return False
        if effect.joints == "pair" and "source_joint=" not in request_of(item):
            return False
    return request_of(finding) != request_of(alternative)


def column_request(finding: Mapping[str, Any]) -> str | None:
    """NAME:JOINT[:source_joint=K] as `regenerate-model --effect` takes it; None where it is no column."""
    effect = catalogue().get(str(finding["effect"]))
    where = [finding.get("recording"), finding.get("from"), finding.get("to")]
    if effect is None or effect.kind != "column" or not finding.get("joints") or any(where):
        return None
    source = finding.get("source_joint")
    return f"{effect.name}:{finding['joints'][0]}" + (f":source_joint={source}" if source else "")
