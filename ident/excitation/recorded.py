"""The motion of a recording that exists, as `--evaluate` looks at it: filtered as an identification does."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ident.equations.prepared import banks_of, columns_of, resting_joints
from ident.errors import StudyError
from ident.excitation.limits import ExcitationError
from ident.prediction.torque_free import motion_alone, open_log
from ident.progress import Progress, silent
from ident.recordings.study import study_from
from ident.signals.filtering import filter_stream
from modelgen.effects.place import Motion

LONGEST = 120.0  # s of a recording that are looked at in every detail; the rest counts as more of the same


@dataclass(frozen=True)
class Recorded:
    """A recording's motion: its first stretch as a plan, how long the robot moved in all [s], the joints
    (from 0) that rest in it, and what its examination warns of."""

    file: str
    planned: Motion
    duration: float
    resting: tuple[int, ...] = ()
    warnings: tuple[str, ...] = ()


def recorded_motion(
    robot: str, model: str, file: Path, progress: Progress = silent, exact: bool = False
) -> Recorded:
    """Its torques may be missing. Raises IdentError for a file that cannot be read as a recording of this
    robot."""
    if not file.is_file():
        raise ExcitationError(f"--evaluate {file}: is no file; name a recording.")
    entry = {"file": str(file.resolve()), "use": "identify"}
    where = str(Path(robot).resolve()) if Path(robot).is_file() else robot
    keys = {"robot": where, "exact": exact, "model": model, "recordings": [entry]}
    study = study_from(keys, Path("the study"))
    columns = columns_of(study)
    progress("reading the recording")
    asked = study, study.recordings[0], columns.need, columns.model.prismatic
    try:
        stream = open_log(*asked)
    except StudyError:  # currents without gains: what the motion tells does not depend on them
        stream = motion_alone(*asked)
    bank = banks_of(study, (stream,))[0]
    parts, total, kept = [], 0, 0
    for number, block in filter_stream(stream, bank):
        total += len(block.t)
        if number == 0 and kept < LONGEST * stream.rate_hz:
            parts.append(block)
            kept += len(block.t)
    if kept < 50:
        raise ExcitationError(f"{file}: hardly moves; give a recording in which the joints move.")
    t, q, dq, ddq, sign = (
        np.concatenate([getattr(b, name) for b in parts]) for name in ("t", "q", "dq", "ddq", "sign_dq")
    )
    every = max(int(stream.rate_hz // 250), 1)
    t, q, dq, ddq, sign = (part[::every] for part in (t, q, dq, ddq, sign))
    motion = Motion("", None, t - t[0], q, dq, ddq, sign, None, stream.rate_hz / every)
    warnings = tuple(check.sentence for check in stream.checks if check.outcome == "warned")
    return Recorded(str(file), motion, total / stream.rate_hz, resting_joints((stream,)), warnings)
