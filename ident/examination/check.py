"""One thing that was found in the data, as a value: what, where, how much, and what to do about it.

`mended`: undone or masked, and said. `warned`: left as it is. `refused`: no number would mean anything; the
message and the remedy are those of the RecordingError that ends the command.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from ident.errors import RecordingError

Outcome = Literal["mended", "warned", "refused"]
_WORST = {"refused": 0, "warned": 1, "mended": 2}
_GRAVEST = (
    "time_unit",
    "clock_rate",
    "angle_unit",
    "torque_sign",
    "torque_scale",
    "swapped_signals",
    "base_orientation",
    "joint_axis",
    "wrong_robot",
)


@dataclass(frozen=True, slots=True)
class Check:
    """recording: label, empty where all are meant; rows: first and last row of the table, from 1, or None."""

    check: str
    recording: str
    signals: tuple[str, ...]
    rows: tuple[int, int] | None
    outcome: Outcome
    message: str
    remedy: str

    @property
    def sentence(self) -> str:
        """As a terminal or a list of warnings shows it."""
        where = f"{self.recording}: " if self.recording else ""
        remedy = f"; {self.remedy}" if self.remedy else ""
        return f"{where}{self.message.rstrip('.')}{remedy}"

    def document(self) -> dict[str, Any]:
        """As fit.json and diagnosis.json hold it."""
        plain = asdict(self)
        return plain | {"signals": list(self.signals), "rows": list(self.rows) if self.rows else None}


def worst_first(checks: Iterable[Check]) -> tuple[Check, ...]:
    """Refused before warned before mended, what makes every number wrong before what touches one."""

    def rank(check: Check) -> tuple[int, int]:
        grave = _GRAVEST.index(check.check) if check.check in _GRAVEST else len(_GRAVEST)
        return _WORST[check.outcome], grave

    return tuple(sorted(dict.fromkeys(checks), key=rank))


def refuse(file: str, checks: Iterable[Check]) -> None:
    """Raises RecordingError with the first refusal, if there is one."""
    ranked = worst_first(checks)
    if ranked and ranked[0].outcome == "refused":
        raise RecordingError(file, f"{ranked[0].message.rstrip('.')}; {ranked[0].remedy}", ranked)


def column_line(maps: Mapping[str, Any], changes: Mapping[str, Mapping[str, float]]) -> str:
    """The study's `columns:` line with some keys of some signals changed; scales multiply those there are."""
    parts = []
    for signal, change in changes.items():
        known = maps.get(signal)
        values: dict[str, Any] = {}
        if known is not None:
            values = {"column": known.column}
            values |= {"scale": known.scale} if known.scale != 1 else {}
            values |= {"offset": known.offset} if known.offset else {}
            values |= {"sign": known.sign} if known.sign != 1 else {}
        for key, value in change.items():
            if key in ("scale", "sign"):
                value = values.pop(key, 1) * value
                if key == "sign" and value == 1:
                    continue
            values[key] = value
        text = ", ".join(f"{k}: {v:.6g}" if isinstance(v, float) else f"{k}: {v}" for k, v in values.items())
        parts.append(f"{signal}: {{{text}}}")
    return f"columns: {{{', '.join(parts)}}}"


def listed(items: Iterable[object], most: int = 8) -> str:
    """1, 2, 3; cut after `most`."""
    texts = [str(item) for item in items]
    return ", ".join(texts[:most]) + (" ..." if len(texts) > most else "")


def turned_sign(names: tuple[str, ...], message: str, maps: Mapping[str, Any]) -> Check:
    """Torques with the other sign, and the line that turns them."""
    line = column_line(maps, {name: {"sign": -1} for name in names})
    return Check("torque_sign", "", names, None, "warned", message, line)
