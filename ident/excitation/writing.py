"""Files of an experiment: the motion for three kinds of controller, tables, a study for what comes back."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import yaml

from ident.excitation.experiment import Experiment
from ident.excitation.page import page, stick_figure
from ident.inspection.excitation import HARD
from ident.report.files import write_csv, write_document
from ident.report.render import render
from ident.summaries.arrow import table_of

Array = np.ndarray
SERVO_HZ = 125.0  # of URScript's servoj
ROS_HZ = 100.0  # points of a JointTrajectory
POSITIVE = ("Ia", "Fv", "Fc")  # what names begin with of parameters that no joint is without
NAMED = 6  # parameters in a sentence
MORE = "give it more time, wider limits, or more joints that move"
Row = tuple[str, ...]


def write_experiment(done: Experiment, folder: Path, rate_hz: float = 1000.0) -> tuple[str, ...]:
    """motion.parquet, motion.csv, trajectory/ (ROS 2 bag), motion.script, study.yaml, motion.html (stick
    figure); of a recording none of these; always parameters.csv, excitation.json, report.html.

    Returns why a file of these is not there, a sentence each."""
    missing = []
    write_csv(folder / "parameters.csv", parameter_rows(done))
    write_document(folder / "excitation.json", document(done))
    if done.optimum is not None:
        t = instants(done.seconds, rate_hz)
        states = done.motion.states(t)  # type: ignore[union-attr]
        columns = {"t": t}
        for name, values in zip(("q", "dq", "ddq"), states):
            columns |= {f"{name}{label}": values[:, k] for k, label in enumerate(done.bounds.labels)}
        pq.write_table(table_of(columns), folder / "motion.parquet")
        with (folder / "motion.csv").open("w", newline="", encoding="utf-8") as out:
            writer = csv.writer(out)
            writer.writerow(columns)
            writer.writerows([f"{value:.9g}" for value in row] for row in zip(*columns.values()))
        points = instants(done.seconds, min(rate_hz, ROS_HZ))
        if not _ros2(done, folder / "trajectory", points, done.motion.states(points)):  # type: ignore[union-attr]
            missing.append('trajectory/ (ROS 2) takes rosbags: pip install "dynident[ros]"')
        if any(done.bounds.slides):
            missing.append("motion.script is not written: URScript knows no joint that slides")
        else:
            (folder / "motion.script").write_text(urscript(done), encoding="utf-8")
        (folder / "study.yaml").write_text(study_text(done), encoding="utf-8")
        (folder / "motion.html").write_text(stick_figure(done), encoding="utf-8")
    (folder / "report.html").write_text(render(page(done)), encoding="utf-8")
    return tuple(missing)


def instants(seconds: float, rate_hz: float) -> Array:
    """(N,) a step of the rate apart, the last one the motion's end: there the robot is at rest."""
    t = np.arange(int(seconds * rate_hz + 1e-6) + 1) / rate_hz
    return t if seconds - t[-1] < 1e-6 / rate_hz else np.append(t, seconds)


def parameter_rows(done: Experiment) -> tuple[Row, list[Row]]:
    """Expected standard deviations: parameter, value, std, per cent."""
    rows = zip(done.names, done.known.chi, done.std, done.percent)
    header = ("parameter", "value", "expected_std", "expected_std_percent")
    return header, [
        (name, f"{v:.6g}", f"{s:.4g}", f"{p:.3g}" if np.isfinite(p) else "") for name, v, s, p in rows
    ]


def document(done: Experiment) -> dict[str, Any]:
    """excitation.json."""
    bounds, separated = done.bounds, done.separated
    out: dict[str, Any] = {
        "robot": done.robot.name,
        "model": done.request.model,
        "seconds": done.seconds,
        "scaled_condition_number": done.condition,
        "expected_std_percent": dict(zip(done.names, done.percent)),
        "noise_std": dict(zip(done.known.model.channels, done.sigma)),
        "limits": {
            key: dict(zip(bounds.labels, getattr(bounds, key)))
            for key in ("low", "high", "dq", "ddq", "jerk", "tau")
        },
        "largest_use_of_a_limit": {"share": done.largest_use[0], "of": done.largest_use[1]},
        "remarks": list(done.remarks),
        "smallest_visible": [asdict(visible) for visible in done.visible],
    }
    if done.optimum is not None:
        out["criterion"] = "separation" if separated else done.request.criterion
        out["stopped_early"] = done.stopped
    if separated is not None:
        out["separation"] = {
            "effects": list(separated.labels),
            "pairs": [pair.labels for pair in separated.pairs],
            "per_second": [
                0.0 if same else its.rate
                for pair in separated.pairs
                for same, its in zip(pair.same, pair.both)
            ],
            "imitated_here": [same for pair in separated.pairs for same in pair.same],
            "same_in_any_motion": [exact is not None for pair in separated.pairs for exact in pair.exact],
            "seconds_for_99_percent": separated.seconds,
            "identities": [exact for pair in separated.pairs for exact in pair.exact],
            "told": separated.sentence,
        }
    return out


def study_text(done: Experiment) -> str:
    """A study that waits for recording.parquet."""
    source = done.request.robot
    robot = str(Path(source).resolve()) if Path(source).is_file() else source
    entries = [{"file": "recording.parquet", "use": "identify"}]
    data: dict[str, Any] = {"robot": robot, "model": done.request.model, "recordings": entries}
    data |= {"exact": True} if done.request.exact else {}
    head = "# Put what the robot recorded on motion.parquet here as recording.parquet, then: ident diagnose\n"
    return head + yaml.safe_dump(data, sort_keys=False)


def urscript(done: Experiment) -> str:
    """A program of servoj at 125 Hz that first moves to where the motion starts."""
    t = instants(done.seconds, SERVO_HZ)
    q = done.motion.states(t)[0]  # type: ignore[union-attr]
    lines = [f"# {done.robot.name}, {done.seconds:g} s, {SERVO_HZ:g} Hz; look at motion.html before it runs"]
    lines += ["def excite():", f"  movej({_list(q[0])}, a=0.5, v=0.3)"]
    lines += [f"  servoj({_list(row)}, t={1 / SERVO_HZ:g}, lookahead_time=0.05, gain=500)" for row in q]
    return "\n".join([*lines, "  stopj(1.0)", "end", "excite()", ""])


def _list(values: Sequence[float]) -> str:
    return "[" + ", ".join(f"{value:.6f}" for value in values) + "]"


def _ros2(done: Experiment, folder: Path, t: Array, states: Sequence[Array]) -> bool:
    """One trajectory_msgs/JointTrajectory, a point every 10 ms; False without the extra `ros`."""
    try:
        from rosbags.rosbag2 import Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        return False
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    Time, Duration = types["builtin_interfaces/msg/Time"], types["builtin_interfaces/msg/Duration"]
    Point = types["trajectory_msgs/msg/JointTrajectoryPoint"]
    kind = "trajectory_msgs/msg/JointTrajectory"
    none = np.zeros(0)
    points = []
    for k, at in enumerate(t):
        whole = int(at)
        q, dq, ddq = (np.ascontiguousarray(part[k]) for part in states[:3])
        points.append(Point(q, dq, ddq, none, Duration(whole, round((at - whole) * 1e9))))
    header = types["std_msgs/msg/Header"](Time(0, 0), "")
    message = types[kind](header, list(done.robot.joint_names), points)
    with Writer(folder, version=9) as writer:
        connection = writer.add_connection("/joint_trajectory", kind, typestore=store)
        writer.write(connection, 0, store.serialize_cdr(message, kind))
    return True


def sentences(done: Experiment) -> list[str]:
    """What the command prints."""
    b = len(done.names)
    out = [f"{b} base parameters, scaled condition number {done.condition:.3g}, {done.seconds:g} s."]
    unseen = [name for name, std in zip(done.names, done.std) if not np.isfinite(std)]
    if unseen:
        out.append(f"It does not show {_listed(unseen)}: {MORE}.")
    elif done.condition > HARD and done.separated is None:
        out.append(f"That is beyond {HARD:g}: some of them hardly differ in this motion; {MORE}.")
    worst = sorted(zip(done.percent, done.names), reverse=True)
    vague = [name for percent, name in worst if 100 < percent < np.inf and name.startswith(POSITIVE)]
    if vague:
        out.append(f"It hardly tells {_listed(vague)} from nothing: {MORE}.")
    if done.largest_use[1]:
        out.append(f"Largest use of a limit: {100 * done.largest_use[0]:.1f} % of {done.largest_use[1]}.")
    if done.separated is not None:
        out.append(done.separated.sentence)
    if done.stopped:
        out.append("Stopped early: this is the best so far.")
    return out


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMED} others" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more
