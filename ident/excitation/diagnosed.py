"""What a diagnosis asks of the next experiment: its pair of suspects, its noise, and the command in words.

Pure functions over the documents of contract 6, so that a diagnosis can offer the command and `ident excite
--from` can read it back.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ident.diagnosis.requests import request_of
from ident.excitation.limits import ExcitationError
from modelgen.geometry.robot import Robot


def split_requests(text: str) -> tuple[str, str]:
    """The two requests of --separate; a piece without a colon, as vs=0.1, goes on with the one before it."""
    parts: list[str] = []
    for piece in filter(None, (piece.strip() for piece in text.split(","))):
        head = piece.split(":")[0]
        if parts and "=" in head:
            parts[-1] += f",{piece}"
        else:
            parts.append(piece)
    if len(parts) != 2:
        raise ExcitationError(
            f"--separate {text}: name two effects, for example stribeck_friction:2,power_law_friction:2."
        )
    return parts[0], parts[1]


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis.json: its findings, and its noise per channel in per cent of the torque."""

    file: str
    findings: tuple[Mapping[str, Any], ...]
    noise_percent: Mapping[str, float]

    @classmethod
    def read(cls, path: Path) -> Diagnosed:
        """From a folder of ident diagnose or its diagnosis.json. Raises ExcitationError."""
        file = path / "diagnosis.json" if path.is_dir() else path
        try:
            data = json.loads(file.read_text(encoding="utf-8"))
            noise = {k: float(v) for k, v in data["noise_floor_percent"].items() if v}
            return cls(str(file), tuple(data["findings"]), noise)
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            raise ExcitationError(
                f"{file}: is no diagnosis.json; name the folder of ident diagnose."
            ) from None

    def pair(self, robot: Robot) -> tuple[str, str]:
        """The strongest finding that has an explanation beside it, and that one. Raises ExcitationError."""
        for finding in self.findings:
            for key in ("equivalent", "alternatives"):
                for other in finding.get(key) or ():
                    return request_of(finding), request_of(other)
        raise ExcitationError(f"{self.file}: no finding has an alternative; use --separate.")
