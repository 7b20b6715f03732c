"""What was done to a recording, and what about it looks wrong: one sentence each.

Notes tell what was changed or left out. Warnings are for what can only be suspected (degrees, N mm) or
will be missed later (a joint that never moves); each gives its reason and the remedy.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from ident.recordings.recording import RecordingStream, Survey

MOVED = 1e-3  # rad or m from the first position: motion has begun


def describe(stream: RecordingStream, survey: Survey) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Notes (what was done) and warnings (what looks wrong), each one sentence that begins with the label."""
    notes: list[str] = []
    warnings: list[str] = []
    if not survey.uniform:
        notes.append(
            f"{stream.label}: time stamps jitter by {1e3 * survey.jitter_rms_s:.3g} ms rms; "
            f"resampled at {survey.rate_hz:g} Hz"
        )
    if survey.missing_rows:
        notes.append(
            f"{stream.label}: {survey.missing_rows} missing samples in short holes were interpolated"
        )
    if survey.same_stamp_rows:
        notes.append(f"{stream.label}: {survey.same_stamp_rows} rows with a repeated time stamp dropped")
    if survey.repeated_rows and not survey.uniform:
        notes.append(f"{stream.label}: {survey.repeated_rows} rows that repeat the previous row dropped")
    if survey.held_position_rows > 0.001 * survey.rows:
        share = 100 * survey.held_position_rows / survey.rows
        notes.append(
            f"{stream.label}: {survey.held_position_rows} rows ({share:.2g} %) repeat the previous position "
            "while the torque moves on (sample and hold); kept"
        )
    if len(survey.segments) > 1:
        notes.append(
            f"{stream.label}: gaps longer than {1e3 * survey.gap_s:.3g} ms split it into "
            f"{len(survey.segments)} segments"
        )
    rest = sum(s.move_start - s.start + s.end - s.move_end for s in survey.segments)
    if rest > 0.05:
        notes.append(f"{stream.label}: {rest:.3g} s of rest at the ends not used")
    warnings += _suspicious_units(stream, survey)
    return tuple(notes), tuple(warnings)


def _suspicious_units(stream: RecordingStream, survey: Survey) -> Iterator[str]:
    """What can only be suspected: degrees, N mm, a joint that never moves."""
    joints, n = stream.need.joints, len(stream.need.joints)
    reach = np.maximum(np.abs(survey.lowest), np.abs(survey.highest))
    columns = stream.names[-len(reach) :]
    degrees = [k for k in range(n) if reach[k] > 4 * np.pi]
    if degrees:
        k = degrees[0]
        yield (
            f"{stream.label}: {columns[k]} reaches {reach[k]:.4g}, more than two turns in rad, "
            "it looks like degrees "
            f"(joints {_list(joints[k] for k in degrees)}); if so add columns: {{q{joints[k]}: {{column: "
            f"{columns[k]}, scale: 0.0174533}}}} to the study"
        )
    still = [k for k in range(n) if survey.highest[k] - survey.lowest[k] < MOVED]
    if still:
        yield (
            f"{stream.label}: joint {_list(joints[k] for k in still)} never moves, "
            "so its own parameters cannot "
            "be seen here; record it moving"
        )
    large = [k for k in range(n, len(reach)) if reach[k] > 2e4]
    if large:
        k = large[0]
        yield (
            f"{stream.label}: {columns[k]} reaches {reach[k]:.3g} N m, more than robots' joints give, "
            "it looks like "
            f"N mm; if so add scale: 0.001 to that column in the study ({_list(columns[k] for k in large)})"
        )


def _list(items: Iterable[object]) -> str:
    return ", ".join(str(item) for item in items)
