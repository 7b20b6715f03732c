"""What was done to a recording, one sentence each. What is wrong with it is said by its checks."""

from __future__ import annotations

from ident.recordings.recording import Survey


def notes_on(label: str, survey: Survey) -> tuple[str, ...]:
    """What was changed or left out, each a sentence that begins with the label."""
    notes: list[str] = []
    if not survey.uniform:
        notes.append(
            f"{label}: time stamps jitter by {1e3 * survey.jitter_rms_s:.3g} ms rms; "
            f"resampled at {survey.rate_hz:g} Hz"
        )
    if survey.missing_rows:
        notes.append(f"{label}: {survey.missing_rows} missing samples in short holes were interpolated")
    if survey.same_stamp_rows:
        notes.append(f"{label}: {survey.same_stamp_rows} rows with a repeated time stamp dropped")
    if survey.repeated_rows and not survey.uniform:
        notes.append(f"{label}: {survey.repeated_rows} rows that repeat the previous row dropped")
    if survey.held_position_rows > 0.001 * survey.rows:
        share = 100 * survey.held_position_rows / survey.rows
        notes.append(
            f"{label}: {survey.held_position_rows} rows ({share:.2g} %) repeat the previous position "
            "while the torque moves on (sample and hold); kept"
        )
    if len(survey.segments) > 1:
        notes.append(
            f"{label}: gaps longer than {1e3 * survey.gap_s:.3g} ms split it into "
            f"{len(survey.segments)} segments"
        )
    rest = sum(s.move_start - s.start + s.end - s.move_end for s in survey.segments)
    if rest > 0.05:
        notes.append(f"{label}: {rest:.3g} s of rest at the ends not used")
    return tuple(notes)
