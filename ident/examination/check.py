"""One thing that was found in the data, as a value: what, where, how much, and what to do about it.

`mended`: undone or masked, and said. `warned`: left as it is. `refused`: no number would mean anything; the
message and the remedy are those of the RecordingError that ends the command.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from ident.errors import RecordingError

Outcome = Literal["mended", "warned", "refused"]
_WORST = {"refused": 0, "warned": 1, "mended": 2}
_GRAVEST = (
    "time_unit",
    "clock_rate",
    "angle_unit",
    "dead_channel",
    "torque_sign",
    "torque_scale",
    "swapped_signals",
    "coupled_position",
    "gravity_compensated",
    "friction_compensated",
    "base_orientation",
    "joint_axis",
    "wrong_robot",
)


FEW = 2  # causes that are told beside one: of more none is
SAID = 6  # of them that are listed


@dataclass(frozen=True, slots=True)
class Check:
    """recording: label, empty where all are meant; rows: first and last row of the table, from 1, or None.
    hint: it only shows that something is wrong; a check of the same signals that says what replaces it.
    spread: standard deviation of the remedy's factor, a share of it; None where it is not told.
    explains: with it the recording is as the others have it, and nothing else was found that does so.
    robot_file: it is of the robot file, which nothing here corrects: all else is in the equations of another
    robot. open: nothing here undoes it, as one of several causes that these recordings do not tell apart, or
    for want of a line."""

    check: str
    signals: tuple[str, ...]
    message: str
    remedy: str = ""
    outcome: Outcome = "warned"
    recording: str = ""
    rows: tuple[int, int] | None = None
    hint: bool = False
    spread: float | None = None
    explains: bool = False
    robot_file: bool = False
    open: bool = False

    @property
    def sentence(self) -> str:
        """As a terminal or a list of warnings shows it."""
        where = f"{self.recording}: " if self.recording else ""
        remedy = f"; {self.remedy}" if self.remedy else ""
        return f"{where}{self.message.rstrip('.')}{remedy}"

    def document(self) -> dict[str, Any]:
        """As fit.json and diagnosis.json hold it."""
        return {
            "check": self.check,
            "recording": self.recording,
            "signals": list(self.signals),
            "rows": list(self.rows) if self.rows else None,
            "outcome": self.outcome,
            "message": self.message,
            "remedy": self.remedy,
        }


def worst_first(checks: Iterable[Check]) -> tuple[Check, ...]:
    """Refused before warned before mended, what makes every number wrong before what touches one; without
    hints at signals that another check wants read otherwise: then there is something else to look at."""
    checks = tuple(checks)
    causes = [c for c in checks if not c.hint and (c.outcome == "refused" or "columns:" in c.remedy)]

    def told(hint: Check) -> bool:
        return any(
            set(hint.signals) <= set(cause.signals) and cause.recording in ("", hint.recording)
            for cause in causes
        )

    def rank(check: Check) -> tuple[int, int]:
        grave = _GRAVEST.index(check.check) if check.check in _GRAVEST else len(_GRAVEST)
        return _WORST[check.outcome], grave

    return tuple(sorted(dict.fromkeys(c for c in checks if not (c.hint and told(c))), key=rank))


def refuse(file: str, checks: Iterable[Check]) -> None:
    """Raises RecordingError with the first refusal, if there is one."""
    ranked = worst_first(checks)
    if ranked and ranked[0].outcome == "refused":
        raise RecordingError(file, f"{ranked[0].message.rstrip('.')}; {ranked[0].remedy}", ranked)


def column_line(
    maps: Mapping[str, Any], changes: Mapping[str, Mapping[str, Any]], beside: bool = False
) -> str:
    """The study's `columns:` line with some keys of some signals changed; scales and signs multiply those
    there are, offsets are added. `of`: the signal whose column is read for this one. beside: it is seen in
    one recording beside others. (Of a UR10e whose sixth position has another unit in its last run the line
    was to be written for all.)"""
    parts = []
    for signal, change in changes.items():
        source = change.get("of", signal)
        known = maps.get(source)
        values: dict[str, Any] = {"column": source} if "of" in change else {}
        if known is not None:
            values = {"column": known.column}
            values |= {"scale": known.scale} if known.scale != 1 else {}
            values |= {"offset": known.offset} if known.offset else {}
            values |= {"sign": known.sign} if known.sign != 1 else {}
        for key in [key for key in ("scale", "sign") if key in change]:
            value = values.pop(key, 1) * change[key]
            if key == "scale" or value != 1:
                values[key] = value
        if "offset" in change:
            values["offset"] = float(values.get("offset", 0.0) + change["offset"])
        said = {k: f"{v:.6g}" if isinstance(v, float) else _as_yaml(v) for k, v in values.items()}
        text = ", ".join(f"{k}: {its}" for k, its in said.items())
        parts.append(f"{signal}: {said['column'] if list(said) == ['column'] else f'{{{text}}}'}")
    own = "(under this recording's own entry where the others are right) " if beside else ""
    return f"{own}columns: {{{', '.join(parts)}}}"


def _as_yaml(value: object) -> str:
    """A number, or a column's name as it has to stand between braces."""
    text = str(value)
    return text if re.fullmatch(r"[\w.+-]+", text) else json.dumps(text, ensure_ascii=False)


def listed(items: Iterable[object]) -> str:
    """1, 2, 3; cut after eight."""
    texts = [str(item) for item in items]
    return ", ".join(texts[:8]) + (" ..." if len(texts) > 8 else "")


def instead(words: Sequence[str]) -> str:
    """What may be there in the place of a cause, behind it; of more than some how many."""
    few = words if len(words) <= SAID + 1 else words[:SAID]
    more = len(words) - len(few)
    return "".join(f", or {its}" for its in few) + (f", or one of {more} other causes" if more else "")


def nothing_tells(words: Sequence[str], fallen: str, recording: str = "") -> Check:
    """Of so many causes, in words, none is told; fallen: what each explains."""
    whose = "of this recording contradict the other recordings', or theirs it" if recording else ""
    file = "" if recording else ", the one that the robot file describes"
    none = "none of them, but another robot or load" if recording else "none of them"
    return Check(
        "unrelated_torque",
        (),
        f"torques and motion {whose or 'contradict each other'}, and nothing tells by what: "
        f"{words[0]}{instead(words[1:])} would each explain as much, and it may be {none}: {fallen}",
        f"check that all signals are of one run and that the recordings are of one robot{file}",
        recording=recording,
        open=True,
    )


def turned_sign(names: tuple[str, ...], message: str, maps: Mapping[str, Any]) -> Check:
    """Torques with the other sign, and the line that turns them."""
    line = column_line(maps, {name: {"sign": -1} for name in names})
    return Check("torque_sign", names, message, line)
