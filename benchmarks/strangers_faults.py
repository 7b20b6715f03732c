"""Faults of strangers' logs, drawn at random, planted in recordings of real robots: what ident says of each.

    python benchmarks/strangers_faults.py [--seed 17] [--draws 0 60] [--diagnose] [--table] [-o FOLDER]

A draw's robot, fault, joint, size and runs come from the seed and its number, sometimes in a slower log, in
coarse steps, without rates. The robot as it is, in the same log, is asked too: what that gets is no false
answer. `moved`: how far the fit foretells other torques of the clean test run than the fit as it is does, in
percent of these, the most of a channel. A JSON file a draw; what is there is not asked again. Whether an
answer is right is for its reader to judge.
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


def planted(log: Log) -> str:
    """A fault put into the log, in words."""
    log.joint, runs = int(log.rng.integers(1, log.n + 1)), sorted(log.tables)
    log.hit = runs if log.rng.random() < 0.6 else [log.drawn(*runs)]
    kind = log.drawn(*((row, names) for row in SIGNALS for names in row[1]), *OTHERS)
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
    everywhere = log.hit == runs or kind in (gravity, left_out, another_robot, rows_exchanged, row_off)
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
            faults.append(planted(log))
        except (ValueError, IndexError):  # not one of this robot
            log, faults = log_of(base, how, rng), []
    its = asked(log, a.output / f"{a.seed}-{number}", a.diagnose, motion, a.limit)
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
    parser.add_argument("--diagnose", action="store_true")
    parser.add_argument("--limit", type=int, default=300, help="processor seconds of one answer")
    parser.add_argument("--table", action="store_true", help="only what is there already")
    a = parser.parse_args()
    a.output.mkdir(parents=True, exist_ok=True)
    for number in range(*a.draws):
        file = a.output / f"{a.seed}-{number}.json"
        if not file.exists() and not a.table:
            file.write_text(json.dumps(draw(a, number)))
        if file.exists():
            print(line(file.stem, json.loads(file.read_text())), flush=True)


if __name__ == "__main__":
    main()
