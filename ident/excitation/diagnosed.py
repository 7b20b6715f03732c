"""What a diagnosis asks of the next experiment: its suspects, its noise, and the command in words.

Pure functions over the documents of contract 6, so that a diagnosis can offer the command and `ident excite
--from` can read it back.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from ident.diagnosis.telling.deciding import SoFar
from ident.diagnosis.telling.requests import request_of, separable
from ident.excitation.limits import ExcitationError
from ident.excitation.so_far import so_far

RIVALS = 3


def split_requests(text: str) -> tuple[str, ...]:
    """The requests of --separate; a piece without a colon, as vs=0.1, goes on with the one before it."""
    parts: list[str] = []
    for piece in filter(None, (piece.strip() for piece in text.split(","))):
        head = piece.split(":")[0]
        if parts and "=" in head:
            parts[-1] += f",{piece}"
        else:
            parts.append(piece)
    if len(parts) < 2:
        raise ExcitationError(
            f"--separate {text}: name two effects, for example stribeck_friction:2,power_law_friction:2."
        )
    return tuple(parts)


def counting(document: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """A diagnosis.json whose commands count what its recordings say, at the noise that they have: each reads
    it from the folder where it is kept."""
    where = f" --from {shlex.quote(str(folder.resolve()))} --separate "

    def reading(command: str) -> str:
        return command.replace(" --separate ", where, 1)

    def told(finding: Mapping[str, Any]) -> dict[str, Any]:
        rivals = [
            {**its, "separate": reading(its["separate"])} if its.get("separate") else its
            for its in finding["equivalent"]
        ]
        own = finding.get("separate")
        offer = {"separate": {**own, "command": reading(own["command"])}} if own else {}
        return {**finding, "equivalent": rivals, **offer}

    return {**document, "findings": [told(finding) for finding in document["findings"]]}


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis.json: its findings, and its noise per channel in per cent of the torque.

    Where no noise floor could be read, all that is left is taken for noise. `fit`: the numbers of the robot
    beside it, where they are there; `effects_folder`: of the user's own effects that it knew; `seen`: what
    its recordings say of every two suspects."""

    file: str
    findings: tuple[Mapping[str, Any], ...]
    noise_percent: Mapping[str, float]
    model: str = "A"
    robot: str = ""
    fit: Path | None = None
    effects_folder: Path | None = None
    seen: tuple[Mapping[str, Any], ...] = ()

    @classmethod
    def read(cls, path: Path) -> Diagnosed:
        """From a folder of ident diagnose or its diagnosis.json. Raises ExcitationError."""
        file = path / "diagnosis.json" if path.is_dir() else path
        try:
            data = json.loads(file.read_text(encoding="utf-8"))
            left = data["error_percent"]["after"]["identify"]
            noise = {**left, **data["noise_floor_percent"]}
            noise = {name: float(value) for name, value in noise.items() if value}
            fit = file.parent / "fit.json"
            model, robot = str(data.get("model", "A")), str(data.get("robot", ""))
            own = fit if fit.is_file() else None
            study = file.parent / "extended_study.yaml"
            keys = yaml.safe_load(study.read_text(encoding="utf-8")) if study.is_file() else {}
            folder = Path(keys["effects_folder"]) if keys.get("effects_folder") else None
            findings = tuple(data["findings"])
            seen = tuple(its for f in findings for its in (f.get("separate") or {}).get("so_far", ()))
            for its in seen:
                so_far([its], *its["suspects"])
            return cls(str(file), findings, noise, model, robot, own, folder, seen)
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            raise ExcitationError(
                f"{file}: is no diagnosis.json; name the folder of ident diagnose."
            ) from None

    def so_far(self, a: str, b: str) -> SoFar:
        """What its recordings say of two suspects, by their labels."""
        return so_far(self.seen, a, b)

    def suspects(self) -> tuple[str, ...]:
        """The strongest finding with explanations beside it that a motion could tell from it, and the
        nearest RIVALS of these. Raises ExcitationError."""
        for finding in self.findings:
            rivals = [
                other for key in ("equivalent", "alternatives") for other in finding.get(key) or ()
                if separable(finding, other)
            ]  # fmt: skip
            nearest = sorted(rivals, key=lambda other: -float(other.get("log_e") or 0.0))
            requests = dict.fromkeys([request_of(finding), *map(request_of, nearest)])
            if len(requests) > 1:
                return tuple(requests)[: RIVALS + 1]
        raise ExcitationError(f"{self.file}: no finding has an alternative; use --separate.")
