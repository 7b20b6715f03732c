"""What the examination of recordings names: eleven measured robots as they are, clean simulated recordings,
and everyday defects planted in every measured robot.

    python benchmarks/examination.py [--robots ur10e,...] [--defects torque_sign,...]
    python benchmarks/examination.py --clean 200 [--done FILE]

A planted defect counts as named when its check is among those said and touches the planted signal; every
other check that the robot as it is does not show is listed as extra.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ident.equations.prepared import prepare_study
from ident.errors import IdentError
from ident.examination.check import Check, worst_first
from ident.examination.examine import examine_fit, examine_tables
from ident.examination.undone import mended_study
from ident.recordings.study import Study, load_study
from ident.twin import PlannedRun, Sensors, simulate, write_simulation

DATA = Path(os.environ.get("DYNIDENT_DATA") or Path(__file__).parents[2] / "shared" / "data")
BUILT_IN = ("franka_panda", "kuka_kr300", "kuka_lwr4plus", "rokae_xmate3pro", "staubli_tx40", "ur10e")
Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Defect:
    """What is done to a table, or to the study, and which check must say so."""

    name: str
    expected: tuple[str, ...]
    change: Callable[[Columns, str, str], Columns] | None = None  # columns, position, torque -> columns
    study: Callable[[Study], Study] | None = None
    joints: int = 1  # fewest that it needs
    needs: str = ""
    signals: bool = True  # the check must name the planted joint


def put(c: Columns, name: str, values: np.ndarray) -> Columns:
    return {**c, name: values}


def at(x: np.ndarray, rows: np.ndarray | slice, values: object) -> np.ndarray:
    out = x.astype(float).copy()
    out[rows] = values
    return out


def some(x: np.ndarray, count: int) -> np.ndarray:
    return np.linspace(len(x) * 0.2, len(x) * 0.8, count).astype(int)


def torques(c: Columns) -> list[str]:
    kind = "tau_m" if "tau_m1" in c else "tau_l" if "tau_l1" in c else "i"
    return [k for k in c if k.startswith(kind) and k[len(kind) :].isdigit()]


def positions(c: Columns) -> list[str]:
    return [k for k in c if k[0] == "q" and k[1:].isdigit()]


def each(c: Columns, names: list[str], f: Callable[[np.ndarray], np.ndarray]) -> Columns:
    return {k: f(v) if k in names else v for k, v in c.items()}


def wrapped(c: Columns, q: str, tau: str) -> Columns:
    middle = np.median(c[q])
    return put(c, q, (c[q] - middle) % (2 * np.pi) + middle)


def frozen(c: Columns, q: str, tau: str) -> Columns:
    speed = np.abs(np.gradient(c[q]))
    start = int(np.argmax(np.convolve(speed[: len(speed) * 3 // 4], np.ones(20), "same")[20:])) + 20
    count = int(1.0 / np.median(np.diff(c["t"])))
    return {
        k: at(v, slice(start, start + count), v[start]) if k != "t" else v
        for k, v in c.items()
        if v.dtype.kind == "f"
    }


def bursts(c: Columns, q: str, tau: str) -> Columns:
    uniform = np.arange(len(c["t"])) * (c["t"][-1] - c["t"][0]) / (len(c["t"]) - 1)
    return put(c, "t", uniform[np.minimum(np.arange(len(uniform)) // 10 * 10 + 9, len(uniform) - 1)])


def noise(c: Columns, q: str, tau: str) -> Columns:
    return put(c, tau, np.random.default_rng(3).normal(size=len(c[tau])) * c[tau].std())


def clipped(c: Columns, q: str, tau: str) -> Columns:
    low, high = np.quantile(c[tau], [0.02, 0.9])
    return put(c, tau, np.clip(c[tau], low, high))


def swap(c: Columns, a: str, b: str) -> Columns:
    return {**c, a: c[b], b: c[a]}


def other(name: str, c: Columns) -> str:
    """The neighbour of a joint's signal."""
    kind, number = name.rstrip("0123456789"), int("".join(ch for ch in name if ch.isdigit()))
    return f"{kind}{number + 1}" if f"{kind}{number + 1}" in c else f"{kind}{number - 1}"


def gravity(*g: float) -> Callable[[Study], Study]:
    return lambda study: study.with_(gravity=g)


DEFECTS = (
    Defect("time in ms", ("time_unit",), lambda c, q, u: put(c, "t", c["t"] * 1e3), signals=False),
    Defect("time in us", ("time_unit",), lambda c, q, u: put(c, "t", c["t"] * 1e6), signals=False),
    Defect("time in ns", ("time_unit",), lambda c, q, u: put(c, "t", c["t"] * 1e9), signals=False),
    Defect(
        "clock 2 times slow",
        ("clock_rate",),
        lambda c, q, u: put(c, "t", c["t"] * 2),
        needs="dq1",
        signals=False,
    ),
    Defect(
        "clock 20 times fast",
        ("clock_rate", "time_unit"),
        lambda c, q, u: put(c, "t", c["t"] / 20),
        needs="dq1",
        signals=False,
    ),
    Defect(
        "dq in degrees",
        ("clock_rate",),
        lambda c, q, u: each(c, ["d" + p for p in positions(c)], np.degrees),
        needs="dq1",
        signals=False,
    ),
    Defect(
        "dq on the motor side",
        ("clock_rate",),
        lambda c, q, u: put(c, "d" + q, c["d" + q] * 100),
        needs="dq1",
    ),
    Defect(
        "q in degrees",
        ("angle_unit",),
        lambda c, q, u: each(c, [p for k in positions(c) for p in (k, "d" + k)], np.degrees),
        signals=False,
    ),
    Defect("q in counts", ("angle_unit",), lambda c, q, u: put(c, q, c[q] * 1e5)),
    Defect("wrap", ("wrap",), wrapped),
    Defect("3 spikes in q", ("spike",), lambda c, q, u: put(c, q, c[q] + at(0 * c[q], some(c[q], 3), 0.3))),
    Defect(
        "3 spikes in a torque",
        ("spike",),
        lambda c, q, u: put(c, u, c[u] + at(0 * c[u], some(c[u], 3), 5 * np.ptp(c[u]))),
    ),
    Defect(
        "3 % spikes",
        ("spike",),
        lambda c, q, u: put(c, q, c[q] + at(0 * c[q], some(c[q], len(c[q]) // 33), 0.3)),
    ),
    Defect(
        "0.5 % NaN",
        ("missing_values",),
        lambda c, q, u: put(c, u, at(c[u], some(c[u], len(c[u]) // 200), np.nan)),
    ),
    Defect(
        "10 % NaN",
        ("missing_values",),
        lambda c, q, u: put(c, u, at(c[u], slice(0, len(c[u]) // 10), np.nan)),
    ),
    Defect(
        "truncated",
        ("truncated",),
        lambda c, q, u: put(c, u, at(c[u], slice(-1, None), np.nan)),
        signals=False,
    ),
    Defect(
        "sentinel 9999",
        ("missing_values", "spike"),
        lambda c, q, u: put(c, u, at(c[u], np.arange(500, 505), 9999.0)),
    ),
    Defect("1e300", ("missing_values",), lambda c, q, u: put(c, u, at(c[u], np.arange(500, 501), 1e300))),
    Defect("frozen for 1 s", ("frozen",), frozen, signals=False),
    Defect("stamps in bursts", ("time_stamps",), bursts, signals=False),
    Defect("dead torque", ("dead_channel",), lambda c, q, u: put(c, u, 0 * c[u]), joints=2),
    Defect(
        "all torques dead",
        ("dead_channel",),
        lambda c, q, u: each(c, torques(c), lambda x: 0 * x),
        signals=False,
    ),
    Defect(
        "switch as torque",
        ("flag_column",),
        lambda c, q, u: put(c, u, (c[u] > np.median(c[u])).astype(float)),
    ),
    Defect("clipped torque", ("saturation",), clipped),
    Defect(
        "step in q",
        ("position_step",),
        lambda c, q, u: put(c, q, c[q] + 0.2 * (np.arange(len(c[q])) > len(c[q]) // 2)),
    ),
    Defect("torque sign", ("torque_sign",), lambda c, q, u: put(c, u, -c[u])),
    Defect(
        "sign that changes half way",
        ("torque_sign",),
        lambda c, q, u: put(c, u, c[u] * np.where(np.arange(len(c[u])) < len(c[u]) // 2, 1, -1)),
    ),
    Defect(
        "all torque signs",
        ("torque_sign",),
        lambda c, q, u: each(c, torques(c), np.negative),
        joints=2,
        signals=False,
    ),
    Defect("torque in N mm", ("torque_scale",), lambda c, q, u: put(c, u, c[u] * 1e3), joints=2),
    Defect("torque 5 times", ("torque_scale",), lambda c, q, u: put(c, u, c[u] * 5), joints=2),
    Defect("torques swapped", ("swapped_signals",), lambda c, q, u: swap(c, u, other(u, c)), joints=2),
    Defect(
        "positions swapped",
        ("swapped_signals",),
        lambda c, q, u: (
            swap(swap(c, q, other(q, c)), "d" + q, "d" + other(q, c))
            if "d" + q in c
            else swap(c, q, other(q, c))
        ),
        joints=2,
    ),
    Defect("torque is noise", ("dead_channel", "unrelated_torque"), noise),
    Defect(
        "positions of another run",
        ("wrong_robot", "unrelated_torque", "clock_rate"),
        lambda c, q, u: each(
            c,
            [p for k in positions(c) for p in (k, "d" + k)],
            lambda x: x[::-1].copy(),
        ),
        signals=False,
    ),
    Defect("on a wall", ("base_orientation",), study=gravity(9.81, 0, 0), signals=False, joints=2),
    Defect("on the ceiling", ("base_orientation",), study=gravity(0, 0, 9.81), signals=False, joints=2),
    Defect(
        "tilted 30 degrees", ("base_orientation",), study=gravity(0, 4.905, -8.496), signals=False, joints=2
    ),
)


def studies(names: set[str]) -> Iterator[tuple[str, Study]]:
    for file in sorted(DATA.glob("*/study.yaml")):
        study = load_study(file)
        if "dualarm" in file.parent.name:  # three of its sensors are dead; currents have no known gain
            keep = tuple(f"tau_l{j}" for j in range(1, 5))
            study = study.with_(model="B", drive_gains=None, channels=keep)
        if not names or file.parent.name in names:
            yield file.parent.name, study
    for name in BUILT_IN:
        if not names or name in names:
            yield name, load_study(str(files("ident").joinpath("studies", f"{name}.yaml")))


def examined(study: Study) -> tuple[tuple[Check, ...], str]:
    """(checks, text of the refusal)."""
    try:
        prepared = prepare_study(study)
        return worst_first([*examine_tables(prepared), *examine_fit(prepared)]), ""
    except IdentError as error:
        return getattr(error, "checks", ()), str(error)


def said_before(check: Check, clean: tuple[Check, ...]) -> bool:
    """Whether the recordings as they are show the same, in these rows."""
    same = [c for c in clean if replace(check, message="", rows=None) == replace(c, message="", rows=None)]
    first, last = check.rows or (0, np.inf)
    return any(c.rows is None or (c.rows[0] <= first and last <= c.rows[1]) for c in same)


def planted(study: Study, defect: Defect, folder: Path, q: str, tau: str) -> Study | None:
    if defect.study is not None:
        return defect.study(study)
    assert defect.change is not None
    windows: dict[Path, tuple[float, float]] = {}  # a defect outside of what the study reads is none
    for entry in study.recordings:
        path = study.recording_path(entry)
        begin, end = windows.get(path, (np.inf, -np.inf))
        begin, end = min(begin, entry.from_s or -np.inf), max(end, entry.to_s or np.inf)
        windows[path] = begin, end
    for path, (begin, end) in windows.items():
        table = pq.read_table(path)
        names = [name for name in table.column_names if name != "pose"]
        columns = {name: table[name].to_numpy().astype(float) for name in names}
        if "t" in columns:
            inside = (columns["t"] >= begin) & (columns["t"] < end)
            columns = {name: values[inside] for name, values in columns.items()}
        if defect.needs and defect.needs not in columns:
            return None
        changed = defect.change(columns, q, tau)
        pq.write_table(
            pa.table({k: pa.array(np.asarray(v, float)) for k, v in changed.items()}), folder / path.name
        )
    return study.with_(folder=str(folder))


CLEAN = (  # robot, model, rate in Hz, seconds of a run
    ("kuka_lwr4p", "A", 1000.0, 30.0),
    ("ur10e", "A", 125.0, 40.0),
    ("franka_panda", "B", 1000.0, 20.0),
    ("kuka_kr300", "A", 250.0, 30.0),
    ("staubli_tx40", "A", 500.0, 15.0),
    ("kuka_lwr4p", "C", 4000.0, 10.0),
    ("rokae_xmate3pro", "B", 200.0, 25.0),
    ("scara", "A", 2000.0, 10.0),
    ("ur10e", "A", 50.0, 60.0),
    ("franka_panda", "A", 100.0, 30.0),
)
SENSORS = (  # encoder step in rad, noise in percent, torque step in N m
    (2 * np.pi / 2**19, 1.0, 1e-5),
    (2 * np.pi / 2**16, 1.0, 1e-2),
    (2 * np.pi / 2**13, 1.0, 1e-1),
    (2 * np.pi / 2**19, 5.0, 1e-5),
    (2 * np.pi / 2**14, 10.0, 1e-1),
)


def clean_simulated(count: int, file: Path) -> None:
    """Simulated recordings without a defect: robots and rates of CLEAN by sensors of SENSORS, another seed
    each time. What is done stands in `file`, a line a study, and is not done again."""
    done = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    for number in range(len(done), count):
        robot, model, rate, seconds = CLEAN[number % len(CLEAN)]
        step, noise, torque = SENSORS[number // len(CLEAN) % len(SENSORS)]
        runs = (PlannedRun("run1", "identify", seconds), PlannedRun("run2", "validate", seconds, 12))
        sensors = Sensors(rate, step, noise, torque_step=torque)
        with tempfile.TemporaryDirectory() as folder:
            made = simulate(robot, model, seed=1000 + number, sensors=sensors, runs=runs)
            checks, refusal = examined(load_study(write_simulation(made, Path(folder))))
        said = [check.sentence for check in checks] + ([refusal] if refusal else [])
        done.append({"case": [number, robot, model, rate, step, noise, torque], "said": said})
        with file.open("a") as lines:
            lines.write(json.dumps(done[-1]) + "\n")
    table: dict[tuple[str, float], list[int]] = {}
    for each in done:
        row = table.setdefault((each["case"][1], each["case"][3]), [0, 0])
        row[0] += 1
        its_own = [f"in steps of {each['case'][k]:.3g}," for k in (4, 6)]  # the sensors' resolution, as it is
        each["said"] = [text for text in each["said"] if not any(own in text for own in its_own)]
        row[1] += bool(each["said"])
        for sentence in each["said"]:
            print(f"   false alarm: {each['case']}: {sentence[:200]}")
    print(f"{'clean simulated':18s} {'Hz':>6s} {'studies':>8s} {'something said':>15s}")
    for (robot, rate), (studies_, alarms) in table.items():
        print(f"{robot:18s} {rate:6.0f} {studies_:8d} {alarms:15d}")
    quiet = sum(not each["said"] for each in done)
    print(f"nothing but a sensor's coarse steps is said of {quiet} of {len(done)}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", default="")
    parser.add_argument("--defects", default="")
    parser.add_argument("--clean", type=int, default=0)
    parser.add_argument("--done", type=Path, default=Path(tempfile.gettempdir()) / "examination_clean.jsonl")
    args = parser.parse_args()
    names, wanted = set(filter(None, args.robots.split(","))), [d for d in args.defects.split(",") if d]
    if args.clean:
        clean_simulated(args.clean, args.done)
        return
    right = missed = 0
    extras: list[str] = []
    for robot, study in studies(names):
        begin = time.perf_counter()
        clean, refusal = examined(study)
        print(f"{robot}: {time.perf_counter() - begin:.1f} s as it is", refusal, flush=True)
        for check in clean:
            print(f"   {check.outcome} {check.check}: {check.sentence[:150]}")
        if mended := mended_study(study, clean):  # as the dual arm's sensors, two of which are turned
            study, clean = mended, examined(mended)[0]
        label = (
            "2"
            if (study.channels or ()) or (robot != "franka_friction_j2" and "kinova" not in robot)
            else "1"
        )
        kind = "tau_l" if study.model == "B" else "i" if study.drive_gains else "tau_m"
        q, tau = f"q{label}", f"{kind}{label}"
        for defect in DEFECTS:
            if wanted and not any(w in defect.name for w in wanted):
                continue
            if label == "1" and defect.joints > 1:
                continue
            with tempfile.TemporaryDirectory() as folder:
                changed = planted(study, defect, Path(folder), q, tau)
                if changed is None:
                    continue
                begin = time.perf_counter()
                checks, refusal = examined(changed)
            said = [c for c in checks if not said_before(c, clean) and c.check != "poor_excitation"]
            hit = [
                c
                for c in said
                if c.check in defect.expected and (not defect.signals or {q, tau, "d" + q} & set(c.signals))
            ]
            others = sorted({c.check for c in said} - set(defect.expected))
            verdict = "named" if hit else "MISSED"
            right, missed = right + bool(hit), missed + (not hit)
            extras += [f"{robot}, {defect.name}: {o}" for o in others]
            seconds = time.perf_counter() - begin
            print(
                f"   {verdict:7s} {defect.name:26s} {seconds:4.1f} s "
                f"{'EXTRA ' + ', '.join(others) if others else ''}"
                f"{'' if hit else ' | ' + ' / '.join(c.sentence[:90] for c in said) + refusal[:160]}",
                flush=True,
            )
    print(f"named {right} of {right + missed}; extras {len(extras)}")
    for text in extras:
        print("   extra:", text)


if __name__ == "__main__":
    main()
