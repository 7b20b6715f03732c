"""Faults of strangers' logs, drawn at random, planted in recordings of real robots: what ident says of each.

    python benchmarks/strangers_faults.py [--seed 17] [--draws 0 60] [--more] [--diagnose] [-o DIR]

A draw's robot, fault, joint, size and runs come from the seed and its number, sometimes in a slower log, in
coarse steps, without rates. The robot as it is, in the same log, is asked too: what that gets is no false
answer. `moved`: how far the fit foretells other torques of the clean test run than the fit as it is does, in
percent of these, the most of a channel. --more draws from the faults of another person; draws without it are
what they were before. A JSON file a draw; what is there is not asked again. Whether an answer is right is
for its reader to judge.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.signal
import yaml

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.planted_faults import (
    BASES,
    DATA,
    JOINTS,
    Base,
    Table,
    _robot,
    _table,
    _twin,
    carried,
    limited,
    tilted,
)

# rate in Hz (0: as recorded), coarse steps, with rates, first run in two
How = tuple[float, bool, bool, bool]


@dataclass
class Log:
    """A robot's study and its runs, each a table of its own, before they are written."""

    base: Base
    rng: np.random.Generator
    study: dict[str, Any]
    robot: dict[str, Any]
    tables: dict[str, Table]
    joint: int = 1
    hit: list[str] = field(default_factory=list)  # runs that the fault is in

    @property
    def n(self) -> int:
        return len(self.robot["links"])

    def drawn(self, *of: Any) -> Any:
        return of[int(self.rng.integers(len(of)))]

    def signals(self, words: str) -> list[str]:
        """tau, q, dq: of the joint; taus, qs, dqs: of all; t."""
        kinds = [(w.removesuffix("s").replace("tau", self.base.torque), w[-1] == "s") for w in words.split()]
        joints = {False: [self.joint], True: range(1, self.n + 1)}
        names = [kind if kind == "t" else f"{kind}{j}" for kind, every in kinds for j in joints[every]]
        return [name for name in dict.fromkeys(names) if name in self.tables[self.hit[0]]]


Change = Callable[[np.ndarray, np.ndarray, float, float], np.ndarray]


def within(t: np.ndarray, s: float, u: float) -> np.ndarray:
    first = t[int(u * len(t))]
    return (t >= first) & (t < first + s)


def held(x: np.ndarray, t: np.ndarray, s: float, u: float) -> np.ndarray:
    return np.where(inside := within(t, s, u), x[np.argmax(inside)], x)


def lagged(x: np.ndarray, t: np.ndarray, s: float, u: float) -> np.ndarray:
    a = np.exp(-np.median(np.diff(t)) / s)
    return np.asarray(scipy.signal.lfilter([1 - a], [1, -a], x, zi=[a * x[0]])[0])


def slow(x: np.ndarray, t: np.ndarray, s: float, u: float) -> np.ndarray:
    return np.asarray(x[np.searchsorted(t, t[0] + s * np.floor((t - t[0]) / s)).clip(max=len(x) - 1)])


def spikes(x: np.ndarray, t: np.ndarray, s: float, u: float) -> np.ndarray:
    return x + s * np.isin(np.arange(len(x)), (u * len(x) * np.arange(0.1, 1.1, 0.17)).astype(int))


ALL = "qs dqs taus"
SIGNALS: tuple[tuple[str, tuple[str, ...], tuple[float, ...], Change], ...] = (
    # words, signals, sizes s (of deviations: times it), what is done, u: a number between 0.2 and 0.7
    ("clean", ("t",), (0,), lambda x, t, s, u: x),
    ("times {}", ("t",), (0.5, 0.8, 1.03, 1.2, 2, 1e3, 1e6), lambda x, t, s, u: x * s),
    ("other sign", ("tau", "taus", "q dq", "dq", "q dq tau"), (-1,), lambda x, t, s, u: x * s),
    ("times {}", ("tau", "taus"), (0.1, 0.5, 0.8, 1.15, 1.5, 3, 9.81, 1e3), lambda x, t, s, u: x * s),
    ("without sign", ("tau", "taus"), (0,), lambda x, t, s, u: abs(x)),
    ("times {}", ("dq", "dqs"), (0.5, 9.5493, 57.29578), lambda x, t, s, u: x * s),
    ("times {}", ("q dq", "dq"), (0.5, 0.9, 1.2, 2, 50), lambda x, t, s, u: x * s),
    ("degrees", ("q dq", "qs dqs"), (57.29578,), lambda x, t, s, u: x * s),
    ("zero off by {} degrees", ("q", "q"), (3, 10, 30, -90), lambda x, t, s, u: x + np.deg2rad(s)),
    ("dead", ("tau", "q dq"), (0,), lambda x, t, s, u: 0 * x),
    ("held for {} s", ("tau", "q", ALL), (0.3, 2), held),
    ("new every {} s only", ("tau", "taus", ALL), (0.01, 0.04), slow),
    ("rounded to {} s", ("t",), (0.01, 0.1, 1), lambda x, t, s, u: np.round(x / s) * s),
    ("late by {} s", ("tau", "taus"), (0.008, 0.015, 0.03, -0.03), lambda x, t, s, u: np.interp(t - s, t, x)),
    ("late by {} s", ("taus",), (0.3, 1.5), lambda x, t, s, u: np.interp(t - s, t, x)),
    ("lag of {} s", ("tau", "dqs"), (0.01, 0.03, 0.1), lagged),
    ("spikes of {} deviations", ("q", "tau"), (3, 10, 30), spikes),
    ("wraps", ("q",), (0.3, 0.5, 0.7), lambda x, t, s, u: (x - (c := np.quantile(x, s))) % (2 * np.pi) + c),
    ("noise of {} deviations", ("tau",), (0.3, 1, 3), lambda x, t, s, u: x + s * np.sin(1e9 * u * t**2)),
    ("dead band of {} deviations", ("tau",), (0.2, 0.5, 1), lambda x, t, s, u: np.where(abs(x) > s, x, 0)),
    ("clipped at {} deviations", ("tau",), (0.9, 1.3, 2), lambda x, t, s, u: np.clip(x, -s, s)),
    ("steps of {} deviations", ("tau",), (0.1, 0.5, 1), lambda x, t, s, u: np.round(x / s) * s),
    ("steps of {} degrees", ("q",), (0.1, 0.5, 2), lambda x, t, s, u: np.round(x / (a := np.deg2rad(s))) * a),
    ("drifts by {} deviations", ("tau",), (0.2, 0.6, 2), lambda x, t, s, u: x + s * (t - t[0]) / np.ptp(t)),
    ("jumps by {} deviations", ("tau",), (0.2, 0.6, 2), lambda x, t, s, u: x + s * (t > t[int(u * len(t))])),
    ("nan for {} s", ("tau",), (0.05, 1), lambda x, t, s, u: np.where(within(t, s, u), np.nan, x)),
)


def exchanged(log: Log) -> str:
    other = log.drawn(*sorted({*range(1, log.n + 1)} - {log.joint}))
    a = log.signals(log.drawn("tau", "q dq", "dq", "q dq tau"))
    b = [f"{name.rstrip('0123456789')}{other}" for name in a]
    for name in log.hit:
        table = log.tables[name]
        log.tables[name] = table | dict(zip([*a, *b], [table[name] for name in [*b, *a]]))
    return f"{a[0]} and {b[0]} exchanged"


def lost(log: Log) -> str:
    length, anew, u = log.drawn(0.03, 0.3, 1.0), log.drawn(True, False), log.rng.uniform(0.2, 0.7)
    for name in log.hit:
        t = log.tables[name]["t"]
        kept = {k: x[~within(t, length, u)] for k, x in log.tables[name].items()}
        log.tables[name] = kept | ({"t": t[: len(kept["t"])]} if anew else {})
    return f"{length} s of rows lost, stamps {'anew' if anew else 'kept'}"


def rearranged(log: Log) -> str:
    """A block of rows is elsewhere, or there twice; stamps are as they were, or begin anew after it."""
    what, u = log.drawn("later", "twice", "under stamps that begin anew"), log.rng.uniform(0.2, 0.7)
    for name in log.hit:
        rows = np.arange(len(log.tables[name]["t"]))
        before, block, after = np.split(rows, [int(u * len(rows)), int((u + 0.1) * len(rows))])
        order = {"later": [before, after, block], "twice": [before, block, block, after]}.get(what, [rows])
        table = log.tables[name] = {k: x[np.concatenate(order)] for k, x in log.tables[name].items()}
        if what not in ("later", "twice"):
            table["t"] = table["t"] - np.where(rows < len(before), 0, table["t"][len(before)])
    return f"a tenth of the rows {what}"


def gravity(log: Log) -> str:
    tilted(degrees := log.drawn(3, 8, 20, 45, 90, 180))(log.study, log.base)
    return f"gravity off by {degrees} degrees"


def left_out(log: Log) -> str:
    log.study["without"] = [log.drawn("coulomb_friction", "viscous_friction", "offset")]
    return f"without {log.study['without'][0]}"


def another_robot(log: Log) -> str:
    tables = {b.robot: links for b in BASES if len((links := _links(b))["links"]) == log.n}
    log.robot = tables[robot := log.drawn(*sorted({*tables} - {log.base.robot}))]
    return f"the table of a {robot}"


def rows_exchanged(log: Log) -> str:
    first = min(log.joint, log.n - 1)
    a, b = log.robot["links"][first - 1 : first + 1]
    for key in ("alpha", "d", "r"):
        a[key], b[key] = b[key], a[key]
    return f"rows {first} and {first + 1} of the table exchanged"


def row_off(log: Log) -> str:
    key, off = log.drawn(("alpha", log.drawn("pi/2", "pi")), ("theta", log.drawn("pi/2", "0.2")),
                         ("d", log.drawn("0.05", "0.3")), ("r", "0.3"), ("joint", ""))  # fmt: skip
    row = log.robot["links"][log.joint - 1]
    slides = {"joint": "prismatic", "theta": 0, "r": f"q{log.joint}"}
    row.update({key: f"{row[key]} + {off}"} if off else slides)
    return f"row {log.joint} of the table: {key} {'+ ' + off if off else 'prismatic'}"


def load(log: Log) -> str:
    kg = log.drawn(0.5, 2.0, 5.0)
    log.hit = [log.drawn(*sorted(log.tables))]
    table = log.tables[log.hit[0]]
    rates = {f"dq{j}": np.gradient(table[f"q{j}"], table["t"]) for j in range(1, log.n + 1)}
    carried(moved := rates | table, log.base, log.n, np.array([0.02, 0.03, 0.1]), kg)
    log.tables[log.hit[0]] = {key: moved[key] for key in table}
    return f"{kg} kg on the last link"


OTHERS: tuple[Callable[[Log], str], ...] = (exchanged, exchanged, lost, gravity, left_out, another_robot)
OTHERS += (rearranged, rows_exchanged, row_off, row_off, load, load)  # as often as they are met


def ahead(x: np.ndarray, t: np.ndarray, s: float, u: float) -> np.ndarray:
    return np.interp(t + s, t, x)


def filtered(x: np.ndarray, t: np.ndarray, s: float, u: float, both: bool = False) -> np.ndarray:
    low = scipy.signal.butter(2, s, fs=1 / float(np.median(np.diff(t))), output="sos")
    return np.asarray(
        scipy.signal.sosfiltfilt(low, x) if both else scipy.signal.sosfilt(low, x - x[0]) + x[0]
    )


def bursts(x: np.ndarray, t: np.ndarray, s: float, u: float) -> np.ndarray:
    return x + s * np.sin(1e9 * u * t**2) * (np.sin(10 * np.pi * (t - t[0]) / np.ptp(t)) > 0.8)


def stale(x: np.ndarray, t: np.ndarray, s: float, u: float) -> np.ndarray:
    over = np.maximum((t - t[0]) % s - 0.8 * s, 0)
    return np.asarray(x[np.searchsorted(t, t - over).clip(max=len(x) - 1)])


def interpolated(x: np.ndarray, t: np.ndarray, s: float, u: float) -> np.ndarray:
    return np.interp(t, new := np.arange(t[0], t[-1], 1 / s), np.interp(new, t, x))


def later(x: np.ndarray, t: np.ndarray, u: float) -> np.ndarray:
    return np.arange(len(x)) > u * len(x)


MORE_SIGNALS: tuple[tuple[str, tuple[str, ...], tuple[float, ...], Change], ...] = (
    ("commanded, {} s ahead", ("q dq", "qs dqs"), (0.03, 0.06), ahead),
    ("behind a filter of {} Hz", ("tau", "taus"), (1, 3), filtered),
    ("smoothed to {} Hz", ("taus",), (1, 3), lambda x, t, s, u: filtered(x, t, s, u, both=True)),
    ("hum of {} deviations", ("tau",), (0.3, 0.7), lambda x, t, s, u: x + s * np.sin(2 * np.pi * 50.02 * t)),
    ("slow hum of {} deviations", ("tau",), (0.3,), lambda x, t, s, u: x + s * np.sin(2 * np.pi * 3.1 * t)),
    ("bursts of {} deviations", ("tau",), (1, 3), bursts),
    ("times {} from there on", ("tau", "taus"), (-1, 0.7, 1.3), lambda x, t, s, u: x * s ** later(x, t, u)),
    ("overflows at {} deviations", ("tau",), (1.5, 2.5), lambda x, t, s, u: (x + s) % (2 * s) - s),
    (
        "by a clock {} as fast",
        ("taus",),
        (0.995, 1.003),
        lambda x, t, s, u: np.interp(t[0] + s * (t - t[0]), t, x),
    ),
    ("stale once in {} s", (ALL, "taus"), (0.8, 3), stale),
    ("zero for {} s", ("taus", ALL), (0.3, 2), lambda x, t, s, u: np.where(within(t, s, u), 0, x)),
    ("{} now and then", ("tau", "q"), (-9999, 0), lambda x, t, s, u: np.where(spikes(0 * x, t, 1, u), s, x)),
    (
        "in counts of {} a turn",
        ("q dq", "qs dqs"),
        (4096, 131072),
        lambda x, t, s, u: np.round(x * s / 6.2832),
    ),
    ("from {} Hz, interpolated", ("qs dqs", ALL), (20,), interpolated),
    ("slips by {} degrees", ("q",), (1, 5), lambda x, t, s, u: x + np.deg2rad(s) * later(x, t, u)),
    ("eccentric by {} degrees", ("q",), (1, 3), lambda x, t, s, u: x + np.deg2rad(s) * np.sin(x)),
    ("twice each", ("t",), (0,), lambda x, t, s, u: x[np.arange(len(x)) // 2 * 2]),
    ("set by {} s on the way", ("t",), (0.4, -0.4), lambda x, t, s, u: x + s * later(x, t, u)),
    ("in float32 since 1970", ("t",), (1.7e9,), lambda x, t, s, u: (x + s).astype(np.float32).astype(float)),
)


def renamed(log: Log) -> str:
    """Joints numbered from the tip, or columns under the names of those before them."""
    tip = log.drawn(True, False)
    for name in log.hit:
        table, names = log.tables[name], log.signals("qs dqs taus")
        turned = [
            f"{x.rstrip('0123456789')}{log.n + 1 - int(x[len(x.rstrip('0123456789')) :])}" for x in names
        ]
        log.tables[name] = table | {x: table[k] for x, k in zip(names, turned if tip else names[1:])}
    return "joints numbered from the tip" if tip else "a header that lost its first name"


def copied(log: Log) -> str:
    kind, other = log.drawn("dq", log.base.torque), log.joint % log.n + 1
    for name in log.hit:
        log.tables[name][f"{kind}{log.joint}"] = log.tables[name][f"{kind}{other}"]
    return f"{kind}{log.joint} is {kind}{other}"


def absolute(log: Log) -> str:
    """A position against the link before the last, as linkages and coupled wrists have it."""
    a, sign = max(log.joint, 2), log.drawn(1, -1)
    for name in log.hit:
        table = log.tables[name]
        both = [kind for kind in ("q", "dq") if f"{kind}{a}" in table]
        log.tables[name] = table | {f"{k}{a}": table[f"{k}{a}"] + sign * table[f"{k}{a - 1}"] for k in both}
    return f"q{a} {'+' if sign > 0 else '-'} q{a - 1} as q{a}"


def of_drives(log: Log) -> str:
    """Per cent of what is rated, or motors in the place of joints."""
    gears, torque = np.array([101, -101, 101, 80, -80, 51, 51]), log.base.torque
    what = log.drawn("torques in per cent of what is rated", "torques of the motors", "all of the motors")
    rated = np.array([100, 90, 50, 20, 15, 10, 10]) / 30 if "rated" in what else gears
    for name in log.hit:
        table = log.tables[name]
        for k in range(log.n):
            size = {torque: 1 / rated[k]} | (
                {"q": gears[k], "dq": gears[k]} if what.startswith("all") else {}
            )
            there = [(kind, f"{kind}{k + 1}") for kind in size if f"{kind}{k + 1}" in table]
            table |= {key: table[key] * size[kind] for kind, key in there}
    return what


def weighing(
    log: Log, gravity: Callable[[Table, np.ndarray], np.ndarray], share: float, tool: bool = False
) -> None:
    """Adds to torques what bodies weigh under gravity(table, g) (N, 3): those of a fit, or one of 1 kg at the
    tip."""
    twin, n, gains = _twin(log.base), log.n, np.array(log.base.gains or np.ones(log.n))
    first = next(iter(log.tables.values()))
    told, none = np.array(twin.model.gravity.linear), np.zeros(n)

    def of(table: Table, kind: str) -> np.ndarray:
        return np.stack([table[f"{kind}{j}"] for j in range(1, n + 1)], axis=1)

    def columns(q: np.ndarray, g: np.ndarray) -> np.ndarray:
        twin.model.gravity.linear = g
        its = twin.regressor(q, none, none)
        return np.stack([x for key, x in its.items() if key[1][0] == "M"], axis=1)

    heavy = [key for key in twin.regressor(none, none, none) if key[1][0] == "M"]
    rows = np.linspace(0, len(first["t"]) - 1, 400).astype(int)
    A = np.concatenate([columns(x, told) for x in of(first, "q")[rows]])
    y = (of(first, log.base.torque)[rows] * gains).ravel()
    bodies = (
        np.array([key == (n, "M") for key in heavy], float) if tool else np.linalg.lstsq(A, y, rcond=1e-4)[0]
    )
    for name in log.hit:
        table = log.tables[name]
        added = np.array([columns(q, g) @ bodies for q, g in zip(of(table, "q"), gravity(table, told))])
        torques = {f"{log.base.torque}{j + 1}": share * added[:, j] / gains[j] for j in range(n)}
        log.tables[name] = table | {key: table[key] + x for key, x in torques.items()}


def compensated(log: Log) -> str:
    weighing(log, lambda table, g: np.tile(g, (len(table["t"]), 1)), -1.0)
    return "torques less a controller's gravity"


def rolling(log: Log) -> str:
    """By small angles what is added is gravity along the ground."""
    degrees, u = log.drawn(2, 5), log.drawn(0, 1)

    def aside(table: Table, g: np.ndarray) -> np.ndarray:
        slope = np.linspace(u, 1, len(table["t"]))
        return np.outer(slope, np.deg2rad(degrees) * np.linalg.norm(g) * np.eye(3)[int(np.argmin(np.abs(g)))])

    weighing(log, aside, 1.0)
    return f"a cart that tilts {'' if u else 'slowly '}by {degrees} degrees"


def touched(log: Log) -> str:
    """A hand or a collision at the tip: what 1 kg would weigh there under another gravity."""
    log.hit, share, u = log.hit[:1], log.drawn(0.03, 0.25), log.rng.uniform(0.2, 0.7)
    size = log.drawn(10, 40)

    def force(table: Table, g: np.ndarray) -> np.ndarray:
        at = (np.arange(len(table["t"])) / len(table["t"]) - u) / share
        return np.outer(np.sin(np.pi * at) * ((at > 0) & (at < 1)), size * np.array([0.6, 0.6, 0.5]))

    weighing(log, force, 1.0, tool=True)
    return f"{size} N at the tip for {share} of the run"


def concatenated(log: Log) -> str:
    a, b = (log.tables[name] for name in [*log.tables][:2])
    begin = a["t"][-1] + a["t"][1] - a["t"][0] - b["t"][0]
    log.tables[next(iter(log.tables))] = {k: np.concatenate([a[k], b[k] + begin * (k == "t")]) for k in a}
    return "two runs in one"


def braked(log: Log) -> str:
    """Stands at both ends without torque."""
    for name in log.hit:
        table = log.tables[name]
        count = len(t := table["t"]) // 2
        ends = {k: [np.full(count, x[i] if k[0] == "q" else 0.0) for i in (0, -1)] for k, x in table.items()}
        dt = np.diff(t)[:count].cumsum()
        ends["t"] = [t[0] - dt[::-1], t[-1] + dt]
        log.tables[name] = {k: np.concatenate([ends[k][0], x, ends[k][1]]) for k, x in table.items()}
    return "brakes at both ends"


def twice(log: Log) -> str:
    first, *_, last = log.tables
    log.tables[last] = dict(log.tables[first])
    return f"{last} is {first}"


def table_of_another_hand(log: Log) -> str:
    """Of the other convention, two lengths of a row exchanged, alpha turned round, or millimetres."""
    links, row = log.robot["links"], log.robot["links"][log.joint - 1]
    what = log.drawn("standard Denavit-Hartenberg", "d and r exchanged", "-alpha", "d and r in mm")
    if what.startswith("standard"):
        lower = [(x["alpha"], x["d"]) for x in links[1:]] + [(0, 0)]
        for link, (alpha, d) in zip(links, lower):
            link["alpha"], link["d"] = alpha, d
        return f"the table is of {what}"
    if what.startswith("-"):
        row["alpha"] = f"-({row['alpha']})"
    else:
        size = 1000 if "mm" in what else 1
        d, r = (row[k] for k in ("d", "r")) if "mm" in what else (row[k] for k in ("r", "d"))
        row["d"], row["r"] = (f"{size} * ({x})" for x in (d, r))
    return f"row {log.joint} of the table: {what}"


MORE: tuple[Callable[[Log], str], ...] = (renamed, copied, absolute, of_drives, compensated, rolling)
MORE += (touched, concatenated, braked, twice, table_of_another_hand, table_of_another_hand)
WHOLE = (
    gravity,
    left_out,
    another_robot,
    rows_exchanged,
    row_off,
    concatenated,
    twice,
    table_of_another_hand,
)


def planted(log: Log, more: bool = False) -> str:
    """A fault put into the log, in words."""
    log.joint, runs = int(log.rng.integers(1, log.n + 1)), sorted(log.tables)
    log.hit = runs if log.rng.random() < 0.6 else [log.drawn(*runs)]
    signals, others = (MORE_SIGNALS, MORE) if more else (SIGNALS, OTHERS)
    kind = log.drawn(*((row, names) for row in signals for names in row[1]), *others)
    if callable(kind):
        said = kind(log)
    else:
        (words, _, sizes, change), of = kind
        s, u, names = log.drawn(*sizes), log.rng.uniform(0.2, 0.7), log.signals(of)
        if not names:
            raise ValueError("no such signal")
        said = f"{' '.join(names) if len(names) < 3 else of} {words.format(s)}"
        for name in log.hit:
            table = log.tables[name]
            size = {k: s * (float(np.std(table[k])) if "deviations" in words else 1) for k in names}
            log.tables[name] = table | {k: change(table[k], table["t"], size[k], u) for k in names}
    everywhere = log.hit == runs or kind in WHOLE
    return said if everywhere else f"{said} in {log.hit[0]}"


def _links(base: Base) -> dict[str, Any]:
    file = Path(_robot(base))
    text = file if file.suffix else files("modelgen").joinpath("robots", f"{file}.yaml")
    return dict(yaml.safe_load(text.read_text(encoding="utf-8")))


def slower(table: Table, rate: float, steps: bool) -> Table:
    """Decimated as a careful recorder does it; in steps of a 2000th of each span."""
    t, own = table["t"], 1 / float(np.median(np.diff(table["t"])))
    if rate and own > 1.5 * rate:
        low, new = scipy.signal.butter(4, 0.4 * rate, fs=own, output="sos"), np.arange(t[0], t[-1], 1 / rate)
        smooth = {k: scipy.signal.sosfiltfilt(low, x) for k, x in table.items()}
        table = {k: np.interp(new, t, x) for k, x in smooth.items()} | {"t": new}
    size = {k: max(np.ptp(x), 1e-9) / 2000 for k, x in table.items()}
    return {k: np.round(x / size[k]) * size[k] if steps and k != "t" else x for k, x in table.items()}


def log_of(base: Base, how: How, rng: np.random.Generator) -> Log:
    rate, steps, rates, parted = how
    log = Log(base, rng, {"model": base.model, **base.keys, "robot": "robot.yaml"}, _links(base), {})
    log.study["recordings"] = []
    for entry in base.runs:
        table = _table(file := DATA / base.robot / entry["file"])
        t = table["t"] - table["t"][0]
        inside = (t >= entry.get("from", 0)) & (t < entry.get("to", np.inf))
        own = [k for k in pq.read_schema(file).names if k != "pose" and (rates or k[:2] != "dq")]
        table = slower({k: table[k][inside].astype(float) for k in own}, rate, steps)
        half = len(table["t"]) // 2
        for part in (slice(half), slice(half, None)) if parted and not log.tables else (slice(None),):
            log.tables[name := f"run{len(log.tables) + 1}"] = {k: x[part] for k, x in table.items()}
            log.study["recordings"].append({"file": f"{name}.parquet", "use": entry["use"], "name": name})
    return log


def asked(log: Log, folder: Path, diagnose: bool, motion: Table, limit: int) -> dict[str, Any]:
    """What ident says of the log, written into a folder."""
    import ident
    from ident.report.verdict_words import told, verdict

    folder.mkdir(parents=True, exist_ok=True)
    for name, table in log.tables.items():
        pq.write_table(pa.table(table), folder / f"{name}.parquet")
    for name, what in (("robot.yaml", log.robot), ("study.yaml", log.study)):
        (folder / name).write_text(yaml.safe_dump(what, sort_keys=False), encoding="utf-8")
    begun, said = time.process_time(), dict[str, Any]()
    try:
        with limited(limit):
            its: Any = (ident.diagnose if diagnose else ident.fit)(ident.load(folder / "study.yaml"))
            fit = its.fit if diagnose else its
            said |= {"checks": [c.sentence for c in its.checks], "error": fit.error_percent}
            if diagnose:
                said["checks"] += [verdict(document := its.document()), *told(document)]
            predicted = fit.predict(dict(motion))
            said["torque"] = {name: np.asarray(predicted[name]).tolist() for name in fit.channels}
    except ident.Error as error:
        said["ended"] = str(error)
    except Exception:
        said["ended"] = traceback.format_exc()[-1500:]
    return said | {"seconds": time.process_time() - begun}


def draw(a: argparse.Namespace, number: int) -> dict[str, Any]:
    rng = np.random.default_rng([a.seed, number])
    bases = [b for b in BASES if b.robot in a.robots and (DATA / b.robot).is_dir()]
    weight = np.array([0.1 if JOINTS.get(b.robot) == 1 else 0.3 if b.model == "C" else 1.0 for b in bases])
    base = bases[int(rng.choice(len(bases), p=weight / weight.sum()))]
    how = (int(rng.choice([0, 0, 0, 100, 50])), *(bool(rng.random() < p) for p in (0.15, 0.5, 0.5)))
    log = log_of(base, how, rng)
    motion = {k: x for k, x in [*log.tables.values()][-1].items() if k[0] in "tq" and "a" not in k}
    folder = a.output / f"{base.robot}-{'-'.join(f'{h:d}' for h in how)}{'-diagnosed' * a.diagnose}"
    if not (kept := folder.with_suffix(".json")).exists():
        kept.write_text(json.dumps(asked(log, folder, a.diagnose, motion, 2 * a.limit)))
    plain, faults, wanted = json.loads(kept.read_text()), list[str](), 1 + (rng.random() < 0.12)
    while len(faults) < wanted:
        try:
            faults.append(planted(log, a.more))
        except (ValueError, IndexError, KeyError):  # not one of this robot
            log, faults = log_of(base, how, rng), []
    its = asked(log, a.output / f"{a.seed}-{number}{'-more' * a.more}", a.diagnose, motion, a.limit)
    torques = [{k: np.array(x) for k, x in said.get("torque", {}).items()} for said in (its, plain)]
    away = [
        np.linalg.norm(torques[0][k] - x) / np.linalg.norm(x) for k, x in torques[1].items() if torques[0]
    ]
    moved = 100 * max(away, default=np.nan)
    keep = [{k: x for k, x in said.items() if k != "torque"} for said in (its, plain)]
    how_it_is = {"robot": base.robot, "how": how, "faults": faults}
    return how_it_is | {"said": keep[0], "plain": keep[1], "moved": moved}


def line(name: str, d: Mapping[str, Any]) -> str:
    """Planted | said first | others | error as the robot is -> now."""
    its, plain = d["said"], d["plain"]
    said = [f"{'(always) ' * (text in plain.get('checks', ()))}{text}" for text in its.get("checks", ())]
    first, *others = [*([its["ended"]] if "ended" in its else []), *said] or ["-"]
    then, now = plain.get("error", {}), its.get("error", {})
    was = {use: f"{then[use]['total']:.1f} -> " if use in then else "" for use in now}
    errors = ", ".join(f"{use} {was[use]}{e['total']:.1f} %" for use, e in now.items())
    how = " ".join(f"{name} {its}" for name, its in zip(("Hz", "coarse", "rates", "parted"), d["how"]) if its)
    planted = f"{name} {d['robot']} ({how}): {' and '.join(d['faults'])}"
    return " | ".join([planted, first, " // ".join(others), f"{errors}, moved {d['moved']:.0f} %"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("build/strangers"))
    parser.add_argument("--seed", type=int, default=17)
    parser.add_argument("--draws", type=int, nargs=2, default=[0, 60], help="from, to")
    parser.add_argument("--robots", nargs="+", default=[b.robot for b in BASES])
    parser.add_argument("--more", action="store_true", help="other faults, another person's")
    parser.add_argument("--diagnose", action="store_true")
    parser.add_argument("--limit", type=int, default=300, help="processor seconds of one answer")
    parser.add_argument("--table", action="store_true", help="only what is there already")
    a = parser.parse_args()
    a.output.mkdir(parents=True, exist_ok=True)
    for number in range(*a.draws):
        file = a.output / f"{a.seed}-{number}{'-more' * a.more}.json"
        if not file.exists() and not a.table:
            file.write_text(json.dumps(draw(a, number)))
        if file.exists():
            print(line(file.stem, json.loads(file.read_text())), flush=True)


if __name__ == "__main__":
    main()
