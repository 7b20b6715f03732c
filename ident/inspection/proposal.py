"""Which columns are probably which signals: what names say, and as a question what they do not say.

Names are evidence only of what they name: `actual_q_3` is a position, `tau_J3` a torque of unknown side,
`current_3` a current whose gain nobody recorded. Commands and references are never taken for measurements.
Nothing of this is used by a fit: it is written into a first study file, where its reader sees it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ident.inspection.profile import TableProfile
from ident.recordings.fill_in import FILL_IN
from ident.recordings.signal_columns import SECONDS, TIME
from ident.recordings.tables.joint_messages import DRIVERS

KIND_OF = {
    "q": r"q|qpos|pos|positions?|joint_?pos(itions?)?|angles?|theta|observation\.state|state|axis",
    "dq": r"dq|qd|qvel|vel|velocity|velocities|joint_?vel(ocity|ocities)?|speeds?",
    "i": r"i|currents?|curr|cur|motor_?currents?",
    "tau_m": r"tau_?m(otor)?|motor_?(torques?|tau)",
    "tau_l": r"tau_?(l|j|s|link|sensor|ext)|(link|sensor)_?(torques?|tau)",
    "effort": r"tau|torques?|efforts?|trq|moments?|joint_?torques?|qfrc\w*",
}
MEASURED = re.compile(
    r"(actual|measured|meas|act|msr|joint|robot|arm|observation|state)s?[_. ]*", re.IGNORECASE
)
COMMANDED = re.compile(r"target|desired|cmd|command|ref|setpoint|action|goal|error|_d$|output", re.IGNORECASE)
NUMBERED = re.compile(r"(.*?)[_. ]?[\[(]?(\d{1,3})[\])]?(\s*[\[(].*)?")
TIMES = re.compile(r"t|time|time_?stamp|stamp|clock|secs?|seconds", re.IGNORECASE)
STEPS = (("s", 1e-4, 0.1), ("ms", 0.1, 100.0), ("us", 100.0, 1e5), ("ns", 1e5, 1e8))  # of 10 Hz to 10 kHz


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the study: `key: value  # why`. A value of FILL IN is a question."""

    key: str
    value: str
    why: str = ""


@dataclass(frozen=True, slots=True)
class Proposal:
    """Lines of the study beside robot and recordings; `kinds` are the signals found, `n` the joints."""

    n: int
    kinds: tuple[str, ...]
    model: str
    columns: Mapping[str, str]  # signal (or kind) -> YAML value
    lines: tuple[Line, ...]
    counted: bool  # there is no time: rate_hz is asked for


def propose(table: TableProfile, names: Sequence[str] = (), n: int = 0) -> Proposal:
    """From the columns of one table; `names` and `n` are the robot's joints where it is known."""
    columns: dict[str, str] = {}
    lines: list[Line] = []
    present = [column.name for column in table.columns]
    kinds: dict[str, int] = {}
    if any(name.startswith("position.") for name in present):
        lines += _of_bag(present, names, n, kinds)
    for kind, choices in _groups(present).items():
        if kind in kinds:
            continue
        best = choices[0]
        if len(choices) > 1:
            texts = " or ".join(f"{c[0]} ..." for c in choices[:4])
            lines.append(Line(f"columns.{kind}", FILL_IN, f"measured by which columns: {texts}?"))
            continue
        count = min(len(best), n) if n else len(best)
        kinds[kind] = count
        if best[:count] == [f"{kind}{k + 1}" for k in range(count)]:
            continue
        stem = best[0][:-1]
        if best[:count] == [f"{stem}{k + 1}" for k in range(count)]:
            columns[kind] = stem
        else:
            columns |= {f"{kind}{k + 1}": name for k, name in enumerate(best[:count])}
    found = set(kinds) | {line.key.removeprefix("columns.") for line in lines}
    if "q" not in found:
        lines.append(Line("columns.q", FILL_IN, "joint positions: the columns' name without the number"))
    if not {"tau_m", "tau_l", "i", "effort"} & found:
        lines.append(Line("columns.tau_m", FILL_IN, "motor torques: the columns' name without the number"))
    if "effort" in kinds and not {"tau_m", "tau_l"} & set(kinds):
        hints = "; ".join(f"{driver}: {meaning}" for driver, meaning, _ in DRIVERS)
        lines.append(
            Line(
                "effort",
                FILL_IN,
                f"motor_torque, motor_current or joint_torque, as the driver has it ({hints})",
            )
        )
    elif "i" in kinds and "tau_m" not in kinds and "tau_l" not in kinds:
        lines.append(
            Line("drive_gains", FILL_IN, "a list, one per joint: torque constant times gear ratio in N m/A")
        )
    time, counted = _time(table)
    columns = time | columns
    model = "A"
    if "tau_l" in kinds:
        model = "C" if "tau_m" in kinds else "B"
    joints = n or kinds.get("q", 0)
    return Proposal(joints, tuple(kinds), model, columns, tuple(lines), counted)


def _of_bag(present: Sequence[str], names: Sequence[str], n: int, kinds: dict[str, int]) -> list[Line]:
    """Signals by their joints' names; the names' order where the robot does not know them."""
    found = [name.removeprefix("position.") for name in present if name.startswith("position.")]
    kinds["q"] = n or len(found)
    for kind, quantity in (("dq", "velocity"), ("effort", "effort")):
        if any(name.startswith(f"{quantity}.") for name in present):
            kinds[kind] = kinds["q"]
    if names and set(names) <= set(found):
        return [Line("joints", f"[{', '.join(names)}]", "the robot's own names, in its order")]
    numbers = {name: re.findall(r"\d+", name)[-1:] for name in found}
    ordered = sorted(found, key=lambda name: int((numbers[name] or ["0"])[0]))
    values = [int(numbers[name][0]) for name in ordered if numbers[name]]
    whole = len(values) == len(found) and values == list(range(values[0], values[0] + len(values)))
    if whole and n in (0, len(found)):
        return [
            Line("joints", f"[{', '.join(ordered)}]", "their order is that of the numbers in their names")
        ]
    return [Line("joints", FILL_IN, f"in the robot's order, a list of {n or 'the'} of {', '.join(found)}")]


def _groups(present: Sequence[str]) -> dict[str, list[list[str]]]:
    """kind -> columns of consecutive numbers from 0 or 1, measured ones; several where it is open."""
    stems: dict[str, dict[int, str]] = {}
    for name in present:
        match = NUMBERED.fullmatch(name)
        if match and match[1] and not COMMANDED.search(match[1]):
            stems.setdefault(match[1], {})[int(match[2])] = name
    found: dict[str, list[tuple[bool, list[str]]]] = {}
    for stem, by_number in stems.items():
        numbers = sorted(by_number)
        if numbers != list(range(numbers[0], numbers[0] + len(numbers))) or numbers[0] > 1:
            continue
        plain = MEASURED.sub("", stem) or stem
        for kind, pattern in KIND_OF.items():
            if any(re.fullmatch(pattern, text, re.IGNORECASE) for text in (stem, plain)):
                exact = stem == kind or MEASURED.match(stem) is not None
                found.setdefault(kind, []).append((exact, [by_number[k] for k in numbers]))
                break
    return {
        kind: [names for exact, names in choices if exact == max(e for e, _ in choices)]
        for kind, choices in found.items()
    }


def clock(table: TableProfile) -> tuple[str, float | None]:
    """The column of the time and what makes seconds of it; ("", None) where there is none, None as the factor
    where neither name, nor unit, nor step tells it."""
    names = [column.name for column in table.columns]
    if "t" in names:
        return "t", SECONDS.get(table.units.get("t", ""), 1.0)
    told = [name for name in names if TIME.fullmatch(name)]
    if len(told) == 1:
        return told[0], SECONDS[TIME.fullmatch(told[0])[1].lower()]  # type: ignore[index]
    timed = [name for name in names if table.units.get(name, "") in SECONDS and _rises(table, name)]
    if timed:
        return timed[0], SECONDS[table.units[timed[0]]]
    for name in (name for name in names if TIMES.fullmatch(name)):
        steps = np.diff(table.values(name))
        steps = steps[steps > 0]
        step = float(np.median(steps)) if len(steps) else 0.0
        unit = next((unit for unit, least, most in STEPS if least <= step < most), None)
        return name, None if unit is None else SECONDS[unit]
    return "", None


def _rises(table: TableProfile, name: str) -> bool:
    return all((np.diff(piece) > 0).all() for piece in table.pieces_of(name))


def _time(table: TableProfile) -> tuple[dict[str, str], bool]:
    """The map of `t`, with a scale where name and unit do not say it; and whether there is no time at all."""
    name, scale = clock(table)
    if name in ("", "t") or TIME.fullmatch(name):
        return {}, not name
    if name in table.units or scale == 1.0:  # a stated unit is applied by itself
        return {"t": name}, False
    return {"t": f"{{column: {name}, scale: {FILL_IN if scale is None else f'{scale:.1e}'}}}"}, False
