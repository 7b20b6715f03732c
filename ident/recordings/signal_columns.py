"""Which column of a table is which signal, and by what it is multiplied to be in SI units.

In this order: what the study's `columns:` say; a column that has the signal's name; the joint's own name
(`position.elbow` of a bag, `q_elbow`), for which the robot file or the study's `joints:` say the number; a
time whose name says its unit (`t_ms`). Units that the file itself states (a row of units, `q1 [deg]`) are
applied and said. What a driver means by effort is never guessed: the study says it (`effort:`).
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ident.errors import RecordingError, StudyError
from ident.recordings.counted_from_zero import from_zero
from ident.recordings.need import Need
from ident.recordings.study import ColumnMap, RecordingEntry, Study
from ident.recordings.tables import Table

KINDS = ("q", "dq", "ddq", "tau_m", "tau_l", "i")
EFFORT = {"motor_torque": "tau_m", "motor_current": "i", "joint_torque": "tau_l"}
QUANTITIES = {"q": "position", "dq": "velocity", "ddq": "acceleration"}
TIME = re.compile(r"(?:t|time|time_?stamp|stamp|clock)[ _.]?[\[(]?(s|sec|ms|us|µs|ns)[\])]?", re.IGNORECASE)
SECONDS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
ANGLES = {"deg": np.pi / 180, "degree": np.pi / 180, "degrees": np.pi / 180, "°": np.pi / 180, "mm": 1e-3}
SPEEDS = {f"{unit}{per}": factor for unit, factor in ANGLES.items() for per in ("/s", "/sec")}
SPEEDS["rpm"] = SPEEDS["1/min"] = SPEEDS["r/min"] = 2 * np.pi / 60
TORQUES = {"Nmm": 1e-3, "N mm": 1e-3, "mNm": 1e-3, "mN m": 1e-3, "kNm": 1e3, "kN m": 1e3, "kN": 1e3}
UNITS = {"t": SECONDS, "q": ANGLES, "dq": SPEEDS, "tau_m": TORQUES, "tau_l": TORQUES, "i": {"mA": 1e-3}}


@dataclass(frozen=True, slots=True)
class SignalColumns:
    """Columns of t (unless rows are counted), q, motor, sensor; SI value = factor * raw + offset."""

    names: tuple[str, ...]
    signals: tuple[str, ...]
    factors: np.ndarray
    offsets: np.ndarray
    maps: Mapping[str, ColumnMap]  # of the study, found by the joints' names, in units that the file states
    remarks: tuple[str, ...]


def signal_columns(study: Study, entry: RecordingEntry, need: Need, table: Table) -> SignalColumns:
    """Find the columns of a study's signals in one of its tables. Raises RecordingError, StudyError."""
    said = {**study.columns, **entry.columns}
    maps = {**_by_name(study, entry, need, table), **_by_study(study, entry, need, said)}
    _joints_are_there(study, table)
    names: list[str] = []
    factors: list[float] = []
    offsets: list[float] = []
    found: list[str] = []
    remarks: list[str] = []

    def add(signal: str, factor: float = 1.0) -> None:
        column = maps.get(signal, ColumnMap(column=signal))
        where = _place(table, signal, column, signal in maps, need.joints)
        unit, stated = _stated(table, signal, where, column)
        if stated != 1:
            remarks.append(f"{where} is in {unit} by the file's own word and was converted")
        names.append(where)
        factors.append(column.sign * column.scale * stated * factor)
        offsets.append(column.offset * factor)
        found.append(signal)

    def has(signal: str) -> bool:
        return signal in maps or signal in table.columns

    if has("t") or entry.rate_hz is None:
        add("t")
        if entry.rate_hz is not None:
            remarks.append("it has a column t, so rate_hz was not used")
    for j in need.joints:
        add(f"q{j}")
    _effort_is_known(study, entry, need, table, has)
    if need.motor:
        gains = study.drive_gains
        for k in need.motor:
            j = need.joints[k]
            if gains is not None and not has(f"i{j}") and has(f"tau_m{j}"):
                raise StudyError(
                    str(study.file),
                    "drive_gains",
                    f"{entry.file} holds the motor torque tau_m{j}, no current i{j}; leave the key out, or "
                    f"read torques in a drive's own unit as currents: columns: {{i{j}: tau_m{j}}}",
                )
            if gains is not None:
                add(f"i{j}", 1.0 if gains == "identify" else gains[k])
            elif not has(f"tau_m{j}") and has(f"i{j}"):
                raise StudyError(
                    str(study.file),
                    "drive_gains",
                    f"{entry.file} holds motor currents; give one gain "
                    "[N m/A] per joint, or drive_gains: identify where joint torques are recorded too",
                )
            else:
                add(f"tau_m{j}")
    for k in need.sensor:
        add(f"tau_l{need.joints[k]}")
    maps |= _in_their_units(need, table, maps)
    return SignalColumns(
        tuple(names), tuple(found), np.array(factors), np.array(offsets), maps, tuple(dict.fromkeys(remarks))
    )


def joint_names(study: Study, need: Need) -> tuple[str, ...]:
    """The joints as recordings call them, in the order of the robot file. Raises StudyError."""
    if study.joints is not None and len(study.joints) != len(need.joints):
        raise StudyError(
            str(study.file),
            "joints",
            f"names {len(study.joints)} joints, the robot {study.robot} has {len(need.joints)}; "
            "give one per joint, in the robot file's order",
        )
    return study.joints or need.joint_names


def _joints_are_there(study: Study, table: Table) -> None:
    """Raises StudyError where `joints:` names one that a bag does not have."""
    present = [name.removeprefix("position.") for name in table.columns if name.startswith("position.")]
    absent = next((name for name in study.joints or () if present and name not in present), None)
    if absent is not None:
        close = difflib.get_close_matches(absent, present, n=1, cutoff=0.5)
        hint = f"did you mean {close[0]}?" if close else f"its joints are {', '.join(present[:12])}"
        where = Path(table.file).name
        raise StudyError(str(study.file), "joints", f"{absent} is no joint of {where}; {hint}")


def _by_name(study: Study, entry: RecordingEntry, need: Need, table: Table) -> dict[str, ColumnMap]:
    """Signals that the table does not have under their own names, but under the joints'."""
    present = set(table.columns)
    bare = {re.sub(r"\s*[\[(].*", "", name): name for name in table.columns if name in table.units}
    effort = entry.effort or study.effort
    known = {"t"} | {f"{kind}{j}" for kind in KINDS for j in need.joints}  # numbers go before names
    found: dict[str, str] = {}
    for j, name in zip(need.joints, joint_names(study, need)):
        for kind in KINDS:
            ways = [f"{kind}{j}", f"{kind}.{name}", f"{kind}_{name}"]
            ways += [f"{QUANTITIES[kind]}.{name}"] if kind in QUANTITIES else []
            ways += [name] if kind == "q" and name not in known else []
            ways += [f"effort.{name}"] if effort is not None and EFFORT[effort] == kind else []
            column = next((bare.get(way, way) for way in ways if bare.get(way, way) in present), None)
            if column is not None and column != f"{kind}{j}":
                found[f"{kind}{j}"] = column
    maps = {signal: ColumnMap(column=column) for signal, column in found.items()}
    times = [name for name in table.columns if TIME.fullmatch(name)]
    if "t" not in present and len(times) == 1:
        unit = TIME.fullmatch(times[0])[1].lower()  # type: ignore[index]
        stated = times[0] in table.units  # the unit is applied where units are
        maps["t"] = ColumnMap(column=times[0]) if stated else ColumnMap(column=times[0], scale=SECONDS[unit])
    return maps


def _by_study(
    study: Study, entry: RecordingEntry, need: Need, said: Mapping[str, ColumnMap]
) -> dict[str, ColumnMap]:
    """The study's maps under numbered signals: `tau_m_elbow` is tau_m2; `q: observation.state` is one map a
    joint."""
    effort = entry.effort or study.effort
    meant = EFFORT[effort] if effort else "effort"
    said = {re.sub("^effort", meant, key): column for key, column in said.items()}
    known = {"t"} | {f"{kind}{j}" for kind in (*KINDS, "effort") for j in need.joints}
    named = {
        f"{kind}{mark}{name}": f"{kind}{j}"
        for j, name in zip(need.joints, joint_names(study, need))
        for kind in KINDS
        for mark in "._"
    }
    named |= {name: f"q{j}" for j, name in zip(need.joints, joint_names(study, need)) if name not in known}
    maps: dict[str, ColumnMap] = {}
    for key, column in said.items():
        if key in (*KINDS, "effort") and isinstance(column.column, str):
            for k, j in enumerate(need.joints, 1):
                maps.setdefault(f"{key}{j}", column.model_copy(update={"column": f"{column.column}{k}"}))
        elif key in known or key in named:
            maps[named.get(key, key)] = column
        else:
            close = difflib.get_close_matches(key, sorted(known | set(named)), n=1)
            raise StudyError(
                str(study.file),
                f"columns.{key}",
                "is not a signal of this robot"
                + (f", did you mean {close[0]}?" if close else "; signals are t, q1, tau_m1, tau_l1, i1 ..."),
            )
    return maps


def _place(table: Table, signal: str, column: ColumnMap, mapped: bool, joints: Sequence[object]) -> str:
    """The name of the column in the table."""
    where = column.column
    if isinstance(where, int):
        if not 0 <= where < len(table.columns):
            raise RecordingError(
                table.file,
                f"has {len(table.columns)} columns, so column {where} for {signal} does not exist "
                "(the first is 0); correct the study's columns",
            )
        return table.columns[where]
    if where not in table.columns:
        raise _missing(table, signal, where, mapped, joints)
    return where


def _stated(table: Table, signal: str, where: str, column: ColumnMap) -> tuple[str, float]:
    """The unit that the file states for a column, and its factor; the study's own scale goes first."""
    unit = table.units.get(where, "")
    if "scale" in column.model_fields_set:
        return unit, 1.0
    return unit, UNITS.get(signal.rstrip("0123456789"), {}).get(unit, 1.0)


def _in_their_units(need: Need, table: Table, maps: Mapping[str, ColumnMap]) -> dict[str, ColumnMap]:
    """Maps of columns whose unit the file states, velocities, too, with its factor as their scale, in whose
    place a line puts another one. (Of a log whose header said deg and deg/s the velocities were told to be in
    degrees.)"""
    known = {}
    for signal in ("t", *(f"{kind}{j}" for kind in KINDS for j in need.joints)):
        column = maps.get(signal, ColumnMap(column=signal))
        where = column.column
        name = table.columns[where] if isinstance(where, int) and where < len(table.columns) else where
        if isinstance(name, str) and name in table.columns:
            _, stated = _stated(table, signal, name, column)
            if stated != 1:
                known[signal] = column.model_copy(update={"scale": stated})
    return known


def _effort_is_known(
    study: Study, entry: RecordingEntry, need: Need, table: Table, has: Callable[[str], bool]
) -> None:
    """Raises StudyError where a torque could only be a driver's effort, and that is unknown or not it."""
    effort = entry.effort or study.effort
    places = (*table.columns, *study.columns, *entry.columns)
    if not any(re.match(r"effort(\.|\d*$)", name) for name in places):
        return
    wanted: list[tuple[str, ...]] = [(f"tau_m{need.joints[k]}", f"i{need.joints[k]}") for k in need.motor]
    wanted += [(f"tau_l{need.joints[k]}",) for k in need.sensor]
    if all(any(has(signal) for signal in signals) for signals in wanted):
        return
    if effort is None:
        raise StudyError(
            str(study.file),
            "effort",
            f"{entry.file} holds effort, whose meaning depends on the driver; add effort: motor_torque, "
            "effort: motor_current (Universal Robots) or effort: joint_torque (Franka, behind the gear)",
        )
    if need.motor and effort == "joint_torque":
        raise StudyError(
            str(study.file), "effort", "joint_torque is measured behind the gear; write model: B"
        )
    if need.sensor and effort != "joint_torque":
        raise StudyError(str(study.file), "effort", f"{effort} is measured at the motor; write model: A")


def _missing(table: Table, signal: str, where: str, mapped: bool, joints: Sequence[object]) -> RecordingError:
    if not table.has_names:
        return RecordingError(
            table.file,
            f"has no header, so {signal} must be told by its index; "
            f"add columns: {{{signal}: {{column: 0}}}} (the first is 0) to the study",
        )
    close = difflib.get_close_matches(where, table.columns, n=1, cutoff=0.6)
    columns = ", ".join(table.columns[:12]) + (" ..." if len(table.columns) > 12 else "")
    hint = f"the nearest is {close[0]}" if close else f"the columns are {columns}"
    if signal == "t" and not mapped:
        return RecordingError(
            table.file,
            f"column t is missing ({hint}); map it with columns: {{t: ...}}, or give "
            "rate_hz: beside the file when samples are uniform",
        )
    if any(name.startswith("position.") for name in table.columns) and not mapped:
        named = [name.removeprefix("position.") for name in table.columns if name.startswith("position.")]
        return RecordingError(
            table.file,
            f"names its joints {', '.join(named[:12])}, and none of them is known for {where}; "
            "add joints: [...] with these names in the robot's order to the study",
        )
    if not mapped and (counted := from_zero(table.columns, joints)):
        return RecordingError(
            table.file,
            f"column {where} is missing, and the joints are counted from 0; write columns: {counted}",
        )
    return RecordingError(
        table.file,
        f"column {where} is missing ({hint}); map it in the study with "
        f"columns: {{{signal}: {{column: NAME}}}}",
    )
