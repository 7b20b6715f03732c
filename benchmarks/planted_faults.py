"""Everyday faults planted in recordings of real robots: what `ident.diagnose` says first, and what beside it.

    python benchmarks/planted_faults.py [-o FOLDER] [--robots NAME ...] [--faults NAME ...] [--summary]

Sign, scale and delay are written into copies of the recordings; gravity, `without` and an undeclared load
into the study. Every robot is diagnosed as it is too: what it lacks of its own is no false answer. Answers
are kept in FOLDER (build/planted): a broken run goes on where it stopped. A run marked *test* decides
nothing; the errors are its. DYNIDENT_DATA holds the recordings.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.signal
import yaml

DATA = Path(os.environ.get("DYNIDENT_DATA") or Path(__file__).parents[2] / "shared" / "data")
LATE_S = 0.02
SHOWS = 1.1  # times the test error of the robot as it is
JOINTS = {"barrett_wam_2dof": 2, "kinova_gen3_joint7_friction": 1, "franka_friction_j2": 1}  # those with few
SCALED, TURNED = 2, 3  # joints whose torque is scaled, and has the other sign (the last one at most)


@dataclass(frozen=True, slots=True)
class Base:
    """A robot's study with a run that decides nothing."""

    robot: str
    model: str
    runs: tuple[Mapping[str, Any], ...]
    keys: Mapping[str, Any]
    torque: str = "tau_m"  # name of its torque columns
    load: Mapping[str, Any] | None = None  # a run with a load that the study does not declare
    gains: tuple[float, ...] = ()  # N m per unit of its torque columns


def run(file: str, use: str, begin: float | None = None, end: float | None = None) -> dict[str, Any]:
    out: dict[str, Any] = {"file": file, "use": use, "name": f"{file.removesuffix('.parquet')}_{use}"}
    return out | ({"from": begin} if begin is not None else {}) | ({"to": end} if end is not None else {})


def cut(file: str, *at: float) -> tuple[dict[str, Any], ...]:
    """One recording as identify, validate and test run."""
    return (
        run(file, "identify", None, at[0]),
        run(file, "validate", at[0], at[1]),
        run(file, "test", at[1], at[2] if len(at) > 2 else None),
    )


SLOW_TO_FAST = ("0.03", "0.05", "0.10", "0.30", "0.70", "1.30")  # rad/s
GAINS = [11.976, 11.976, 9.839, 10.763, 10.764, 10.763]
BASES = (
    Base(
        "barrett_wam_2dof",
        "A",
        (run("identify.parquet", "identify"), *cut("validate.parquet", 0, 2.2)[1:]),
        {"robot": "robot.yaml"},
    ),
    Base("kuka_kr300", "A", (run("traj_a.parquet", "identify"), *cut("traj_b.parquet", 0, 5.0)[1:]), {}),
    Base(
        "airbot_play",
        "A",
        (run("identify_a.parquet", "identify"), run("identify_b.parquet", "identify"),
         run("validate.parquet", "validate"), run("test.parquet", "test")),
        {"robot": "robot.yaml"},
    ),
    Base("franka_panda", "B", cut("excite_first.parquet", 6.5, 9.8), {"link_inertia": True}, "tau_l"),
    Base("staubli_tx40", "A", cut("excite_first.parquet", 2.8, 3.9), {"coupled_drives": [[5, 6]]}),
    Base("rokae_xmate3pro", "B", cut("excite_first.parquet", 7, 9.7), {"link_inertia": True}, "tau_l"),
    Base(
        "ur10e",
        "A",
        (run("excite_a_50s.parquet", "identify"), run("excite_c_30s.parquet", "validate"),
         run("excite_f_20s.parquet", "test")),
        {"drive_gains": GAINS},
        "i",
        run("excite_e_50s_load.parquet", "identify"),
        tuple(GAINS),
    ),
    Base(
        "kuka_lwr4plus",
        "B",
        (run("traj_a_run1.parquet", "identify", 1, 24), *cut("traj_b_run1.parquet", 14, 19, 24)),
        {"robot": "kuka_lwr4p_ros", "link_inertia": True},
        "tau_l",
    ),
    Base(
        "dualarm_v2_7dof",
        "C",
        (run("identify_a.parquet", "identify"), run("identify_b.parquet", "validate"),
         run("validate.parquet", "test")),
        {"robot": "robot.yaml", "drive_gains": "identify", "channels": [
            *(f"tau_m{j}" for j in range(1, 8)), *(f"tau_l{j}" for j in range(1, 5))]},
        "tau_l",
    ),
    Base(
        "kinova_gen3_joint7_friction",
        "A",
        (*(run(f"identify_{v}.parquet", "identify") for v in SLOW_TO_FAST),
         *(run(f"validate_{v}.parquet", "validate") for v in ("0.09", "0.50")),
         run("validate_0.90.parquet", "test")),
        {"robot": "robot.yaml", "drive_gains": [7.6]},
        "i",
        None,
        (7.6,),
    ),
    Base(
        "franka_friction_j2",
        "A",
        (run("identify_a.parquet", "identify"), run("identify_b.parquet", "validate"),
         run("validate.parquet", "test")),
        {"robot": "robot.yaml"},
    ),
)  # fmt: skip

Table = dict[str, np.ndarray]
Planting = Callable[[Table, str, int, Table], None]  # ..., its torques, a joint, the first recording's


@dataclass(frozen=True, slots=True)
class Fault:
    """What is told or recorded wrongly, and the names that are a right answer to it."""

    name: str
    answers: tuple[str, ...]
    joint: int | None = None
    table: Planting | None = None
    study: Callable[[dict[str, Any], Base], bool] | None = None  # False: not for this robot
    runs: Callable[[Table, Base], None] | None = None  # only of the last identify run


def _robot(base: Base) -> str:
    """The robot's file beside the recordings, or a built-in name."""
    named = str(base.keys.get("robot", base.robot))
    return str(DATA / base.robot / named) if named.endswith(".yaml") else named


def gravity_of(base: Base) -> np.ndarray:
    from modelgen.geometry.robot_file import load_robot

    robot = load_robot(_robot(base))
    return np.array([float(g) for g in robot.gravity])


def tilted(degrees: float) -> Callable[[dict[str, Any], Base], bool]:
    def change(study: dict[str, Any], base: Base) -> bool:
        g = gravity_of(base)
        size = np.linalg.norm(g)
        axis = np.eye(3)[int(np.argmin(np.abs(g)))]
        side = size * (axis - g * (axis @ g) / size**2)
        angle = np.deg2rad(degrees)
        study["gravity"] = [float(x) for x in np.cos(angle) * g + np.sin(angle) * side]
        return True

    return change


def scaled(factor: float) -> Planting:
    def change(table: Table, torque: str, joint: int, first: Table) -> None:
        table[f"{torque}{joint}"] = factor * table[f"{torque}{joint}"]

    return change


def late(table: Table, torque: str, joint: int, first: Table) -> None:
    for name in table:
        if name.startswith(torque) and name[len(torque) :].isdigit():
            table[name] = np.interp(table["t"] - LATE_S, table["t"], table[name])


def without(term: str) -> Callable[[dict[str, Any], Base], bool]:
    def change(study: dict[str, Any], base: Base) -> bool:
        study["without"] = [term]
        return True

    return change


def loaded(study: dict[str, Any], base: Base) -> bool:
    if base.load is None:
        return False
    study["recordings"] = [study["recordings"][0], dict(base.load), *study["recordings"][1:]]
    return True


@dataclass(frozen=True)
class Usual:
    """What a joint does in the study's first recording: a law that is planted has the same numbers in all of
    its recordings."""

    middle: float  # of its position
    reach: float  # its position's standard deviation
    speed: float  # its rate's
    torque: float  # its torque's


def added(law: Callable[[np.ndarray, np.ndarray, Usual], np.ndarray]) -> Planting:
    """A torque of q, dq [rad, rad/s] of the joint, and of what is usual there."""

    def change(table: Table, torque: str, joint: int, first: Table) -> None:
        q, dq, tau = (first[f"{name}{joint}"] for name in ("q", "dq", torque))
        usual = Usual(float(np.mean(q)), *(float(np.std(x)) for x in (q, dq, tau)))
        extra = law(table[f"q{joint}"], table[f"dq{joint}"], usual)
        table[f"{torque}{joint}"] = table[f"{torque}{joint}"] + extra

    return change


def ripple(q: np.ndarray, dq: np.ndarray, usual: Usual) -> np.ndarray:
    return 0.1 * usual.torque * np.sin(30 * q)


def spring(q: np.ndarray, dq: np.ndarray, usual: Usual) -> np.ndarray:
    """As strong over the joint's own range as a fifth of its torque."""
    return 0.2 * usual.torque * (q - usual.middle) / usual.reach


def stribeck(q: np.ndarray, dq: np.ndarray, usual: Usual) -> np.ndarray:
    slow = 0.25 * usual.speed
    return 0.3 * usual.torque * np.tanh(dq / (0.05 * slow)) * np.exp(-((dq / slow) ** 2))


def carried(
    table: Table, base: Base, link: int, at: np.ndarray, mass: float | None = None, window: int = 21
) -> None:
    """A point mass [kg] at a point (3,) [m] of a link, by Pinocchio's equations and accelerations that are
    smoothed over so many samples; None: as heavy as turns the second joint with a fifth of its torque."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    twin = _twin(base)
    body = {(link, "M"): 1.0} | {(link, f"M{a}"): float(x) for a, x in zip("XYZ", at)}
    outer = np.dot(at, at) * np.eye(3) - np.outer(at, at)
    body |= {
        (link, a + b): float(outer["XYZ".index(a), "XYZ".index(b)])
        for a, b in ("XX", "XY", "XZ", "YY", "YZ", "ZZ")
    }
    n, period = twin.model.nv, np.median(np.diff(table["t"]))
    q, dq = (np.stack([table[f"{k}{j}"] for j in range(1, n + 1)], axis=1) for k in ("q", "dq"))
    ddq = scipy.signal.savgol_filter(np.gradient(dq, period, axis=0), window, 3, axis=0)
    states = (twin.regressor(*state) for state in zip(q, dq, ddq))
    tau = np.array([sum(x * columns[key] for key, x in body.items()) for columns in states])
    gains = np.array(base.gains or np.ones(n))
    if mass is None:
        mass = 0.2 * float(np.std(table[f"{base.torque}2"] * gains[1]) / np.std(tau[:, 1]))
    for j in range(n):
        table[f"{base.torque}{j + 1}"] = table[f"{base.torque}{j + 1}"] + mass * tau[:, j] / gains[j]


def _twin(base: Base) -> Any:
    from modelgen.geometry.robot_file import load_robot
    from tests.support.pinocchio_robot import PinocchioRobot

    return PinocchioRobot(load_robot(_robot(base)))


def weighted(table: Table, base: Base) -> None:
    """A point mass half-way along the second link."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    model = _twin(base).model
    reach = 0.5 * model.jointPlacements[3].translation if model.nv > 2 else np.array([0.2, 0.0, 0.0])
    if np.linalg.norm(reach[:2]) < 0.05:
        reach = reach + np.array([0.1, 0.0, 0.0])
    carried(table, base, 2, reach)


FAULTS = (
    Fault("as it is", ()),
    Fault("gravity told wrong by 180 degrees", ("base_tilt",), study=tilted(180)),
    Fault("gravity told wrong by 90 degrees", ("base_tilt",), study=tilted(90)),
    Fault("gravity told wrong by 10 degrees", ("base_tilt",), study=tilted(10)),
    Fault(f"sign of torque {TURNED}", ("torque_sign",), TURNED, table=scaled(-1.0)),
    Fault(f"torque {SCALED} x 5", ("drive_gain_error",), SCALED, table=scaled(5.0)),
    Fault(f"torque {SCALED} x 1.3", ("drive_gain_error",), SCALED, table=scaled(1.3)),
    Fault("torques late by 20 ms", ("time_delay",), table=late),
    Fault("a load on one run not declared", ("payload_change",), study=loaded),
    Fault("a weight on link 2 of one run", ("payload_change",), runs=weighted),
    Fault("a ripple of 30 a turn on joint 2", ("torque_ripple", "gear_ripple"), 2, table=added(ripple)),
    Fault("a spring on joint 3", ("spring",), 3, table=added(spring)),
    Fault("Stribeck friction on joint 1", ("stribeck_friction",), 1, table=added(stribeck)),
    Fault("Coulomb friction left out", ("coulomb_friction",), study=without("coulomb_friction")),
    Fault("viscous friction left out", ("viscous_friction",), study=without("viscous_friction")),
)


def _table(file: Path) -> Table:
    """A recording, with rates where it has none."""
    read = pq.read_table(file)
    table = {key: read.column(key).to_numpy() for key in read.column_names}
    for j in (name[1:] for name in list(table) if name[0] == "q" and name[1:].isdigit()):
        if f"dq{j}" not in table:
            table[f"dq{j}"] = np.gradient(table[f"q{j}"], np.median(np.diff(table["t"])))
    return table


def planted(base: Base, fault: Fault, folder: Path) -> Path | None:
    """The study with the fault in it, written; None where it is not one of this robot."""
    if fault.answers and JOINTS.get(base.robot) == 1:
        return None  # nothing to compare a joint's torque with
    source = DATA / base.robot
    study: dict[str, Any] = {"robot": base.robot, "model": base.model, **base.keys}
    study["recordings"] = [dict(entry) for entry in base.runs]
    study["robot"] = _robot(base)
    if fault.study is not None and not fault.study(study, base):
        return None
    if fault.runs is not None and not second_part(study, source):
        return None
    tables: dict[str, Table] = {}
    if fault.table is None and fault.runs is None:
        study["folder"] = str(source)
    else:
        for name in dict.fromkeys(entry["file"] for entry in study["recordings"]):
            tables[name] = _table(source / name)
            table = dict(tables[name])
            if fault.table is not None:
                fault.table(table, base.torque, _joint(base, fault) or 1, next(iter(tables.values())))
            pq.write_table(pa.table(table), folder / name)
        if fault.runs is not None:
            entry = [e for e in study["recordings"] if e["use"] == "identify"][-1]
            fault.runs(table := dict(tables[entry["file"]]), base)
            entry["file"] = "weighted.parquet"
            pq.write_table(pa.table(table), folder / "weighted.parquet")
    path = folder / "study.yaml"
    path.write_text(yaml.safe_dump(study, sort_keys=False), encoding="utf-8")
    return path


def second_part(study: dict[str, Any], source: Path) -> bool:
    """At least two identify runs: the only one is parted in the middle where it is long enough."""
    own = [e for e in study["recordings"] if e["use"] == "identify"]
    if len(own) > 1:
        return True
    (entry,) = own
    t = pq.read_table(source / entry["file"], columns=["t"]).column("t").to_numpy()
    begin, end = entry.get("from", 0.0), entry.get("to", float(t[-1] - t[0]))
    if end - begin < 6.0:
        return False
    middle = (begin + end) / 2
    first = entry | {"to": middle, "name": entry["name"] + "_1"}
    later = entry | {"from": middle, "name": entry["name"] + "_2"}
    at = study["recordings"].index(entry)
    study["recordings"][at : at + 1] = [first, later]
    return True


def _joint(base: Base, fault: Fault) -> int | None:
    return fault.joint and min(fault.joint, JOINTS.get(base.robot, 9))


@contextmanager
def limited(seconds: int) -> Iterator[None]:
    """TimeoutError after so much processor time."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"no answer after {seconds} s of processor time")

    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def examine(base: Base, fault: Fault, limit: int) -> dict[str, Any] | None:
    """The document of the diagnosis with the seconds it took, or the error that came instead."""
    import ident

    with tempfile.TemporaryDirectory() as scratch:
        path = planted(base, fault, Path(scratch))
        if path is None:
            return None
        begun = time.process_time()
        try:
            with limited(limit):
                document = ident.diagnose(ident.load(path)).document()
        except Exception as error:
            return {"error": f"{type(error).__name__}: {error}"[:300]}
    return {
        "cpu_seconds": time.process_time() - begun,
        "document": json.loads(json.dumps(document, default=float)),
    }


def named(finding: Mapping[str, Any]) -> str:
    joints = ", ".join(map(str, finding["joints"]))
    return finding["effect"].replace("_", " ") + (f" {joints}" if joints else "")


def right(base: Base, fault: Fault, finding: Mapping[str, Any]) -> bool:
    joint = _joint(base, fault)
    return finding["effect"] in fault.answers and (joint is None or joint in finding["joints"])


def row(base: Base, fault: Fault, answer: Mapping[str, Any], plain: Mapping[str, Any]) -> list[str]:
    """Planted, said first (bold: right), other names (new: the robot as it is does not get it), the rest."""
    joint = _joint(base, fault)
    name = fault.name if joint is None else fault.name.replace(str(fault.joint), str(joint), 1)
    if "error" in answer:
        return [base.robot.replace("_", " "), name, answer["error"][:90], "", "", "", ""]
    document = answer["document"]
    findings = document["findings"]
    own = {named(f) for f in plain.get("document", {}).get("findings", ())}
    first = named(findings[0]) if findings else document["verdict"]
    if findings and right(base, fault, findings[0]):
        first = f"**{first}**"
    elif any(right(base, fault, f) for f in findings):
        first += " (the fault later)"
    elif findings and first not in own and fault.answers:
        first += " (new)"
    others = [named(f) for f in findings[1:] if not right(base, fault, f)]
    others = [text if text in own else f"{text} (new)" for text in others]
    warned = [c["check"].replace("_", " ") for c in document["checks"] if c["outcome"] != "mended"]
    before, after = (
        document["error_percent"][k].get("test", {}).get("total", np.nan) for k in ("before", "after")
    )
    left = [
        f"{','.join(map(str, u['joints']))} ({', '.join(u['depends_on'])})" for u in document["unexplained"]
    ]
    return [
        base.robot.replace("_", " "),
        name,
        first,
        ", ".join(others) or "-",
        "; ".join(left) or "-",
        ", ".join(dict.fromkeys(warned)) or "-",
        f"{before:.1f} → {after:.1f}",
    ]


def test_error(answer: Mapping[str, Any]) -> float:
    """Percent, before anything was found; NaN without an answer."""
    errors = answer.get("document", {}).get("error_percent", {}).get("before", {})
    return float(errors.get("test", {}).get("total", np.nan))


def warned(base: Base, fault: Fault, answer: Mapping[str, Any]) -> bool:
    """Whether a warning names the fault and its signal, beside what the recordings do not tell it from."""
    from modelgen.effects import catalogue

    checks = {name for effect in fault.answers for name in catalogue()[effect].told_by}
    joint = _joint(base, fault)
    return joint is not None and any(
        c["check"] in checks and c["outcome"] == "warned" and f"{base.torque}{joint}" in c["signals"]
        for c in answer.get("document", {}).get("checks", ())
    )


def table(folder: Path) -> str:
    head = ["robot", "planted", "said first", "also named", "unexplained", "warnings", "test error, %"]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    count = first_right = shown = shown_right = shown_open = new = 0
    for base in BASES:
        stored = {f.name: _read(folder, base, f) for f in FAULTS}
        plain = stored["as it is"] or {}
        for fault in FAULTS:
            answer = stored[fault.name]
            if not answer:
                continue
            cells = row(base, fault, answer, plain)
            lines.append("| " + " | ".join(cells) + " |")
            if fault.answers:
                good = cells[2].startswith("**")
                shows = test_error(answer) > SHOWS * test_error(plain)
                count, shown, new = count + 1, shown + shows, new + sum(c.count("(new)") for c in cells[2:4])
                first_right, shown_right = first_right + good, shown_right + (shows and good)
                shown_open += shows and not good and warned(base, fault, answer)
    lines += [
        "",
        f"{first_right} of {count} faults were said first; of the {shown} that raise the test error by "
        f"more than a tenth, {shown_right}, and of {shown_open} more a warning names the signal beside what "
        f"the recordings do not tell it from. {new} wrong names that the robot as it is does not get.",
    ]
    return "\n".join(lines)


def page(folder: Path, commit: str) -> str:
    """Markdown: what is said of every robot as it is, and the table of faults."""
    from ident.report.verdict_words import told, verdict

    lines = [
        "# Measured robots",
        f"Written by `python benchmarks/planted_faults.py --page {commit}` from answers of commit {commit}.",
        "Errors are those of the filtered torque; the *test* run decides nothing.",
        "",
    ]
    for base in BASES:
        answer = _read(folder, base, FAULTS[0])
        if answer is None or "document" not in answer:
            continue
        document = answer["document"]
        before, after = (document["error_percent"][k] for k in ("before", "after"))
        errors = ", ".join(
            f"{use} {before[use]['total']:.1f} → {after[use]['total']:.1f} %" for use in before
        )
        lines += [f"## {base.robot.replace('_', ' ')}, as it is", "", f"**{verdict(document)}**", ""]
        lines += [f"- {sentence}" for sentence in told(document)]
        lines += ["", f"Error, before → after: {errors}.", ""]
    return "\n".join([*lines, "## Faults planted", "", table(folder)])


def _path(folder: Path, base: Base, fault: Fault) -> Path:
    return folder / f"{base.robot}-{fault.name.replace(' ', '_')}.json"


def _read(folder: Path, base: Base, fault: Fault) -> dict[str, Any] | None:
    path = _path(folder, base, fault)
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("build/planted"))
    parser.add_argument("--robots", nargs="+", choices=[b.robot for b in BASES])
    parser.add_argument("--faults", nargs="+", help="words of their names")
    parser.add_argument("--limit", type=int, default=240, help="processor seconds of one diagnosis")
    parser.add_argument("--page", metavar="COMMIT", help="only the page of what is there already")
    parser.add_argument("--summary", action="store_true", help="only the table of what is there already")
    a = parser.parse_args()
    a.output.mkdir(parents=True, exist_ok=True)
    if a.page:
        print(page(a.output, a.page))
        return
    for base in BASES:
        for fault in FAULTS:
            wanted = not a.faults or any(word in fault.name for word in a.faults)
            if a.summary or not wanted or (a.robots and base.robot not in a.robots):
                continue
            if not (DATA / base.robot).is_dir() or _path(a.output, base, fault).exists():
                continue
            answer = examine(base, fault, a.limit)
            if answer is None:
                continue
            if "error" not in answer or "TimeoutError" in answer["error"]:
                _path(a.output, base, fault).write_text(json.dumps(answer), encoding="utf-8")
            print(
                " | ".join(row(base, fault, answer, {})), f"{answer.get('cpu_seconds', 0):.0f} s", flush=True
            )
    print(table(a.output))


if __name__ == "__main__":
    main()
