"""Which values of a study cannot be meant, whatever the recordings hold. ValueError: one sentence each.

`check_rates` is for when a recording's rate is known.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ident.errors import StudyError
from modelgen.errors import ModelgenError, shortened
from modelgen.geometry import labels, plausible

LARGEST = 1e12
HIGHEST_SHARE = 0.45  # of the sampling rate: `filtering.MAX_SHARE`
USUAL_SHARE = 0.4  # of a position cut-off that nobody wrote: what a log of nearly the same rate holds, too
RESAMPLED = 1.5  # times the recorded rate: rounding of stamps, not invention of samples
SIGNAL = re.compile(r"(q|tau_m|tau_l|i)([1-9][0-9]*)")


def finite(value: Any) -> float:
    """A number; text such as "1e3", which YAML does not take for one, too."""
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not abs(number) <= LARGEST:
        raise ValueError("must be a finite number")
    return number


def whole(value: Any) -> Any:
    """Not true or false, which Python takes for 1 and 0."""
    if isinstance(value, bool):
        raise ValueError("must be a whole number, not true or false")
    return value


def payload_label(label: str | None) -> str | None:
    """As in a robot file."""
    if label is not None:
        try:
            labels.check_payload_label(label)
        except ModelgenError as error:
            raise ValueError(str(error)) from None
    return label


def name(text: str | None) -> str | None:
    """What names a recording in tables, plots and files."""
    if text is not None and (not text.strip() or len(text) > 100 or not text.isprintable() or "/" in text):
        raise ValueError(f"{shortened(repr(text))} is no short name on one line without /; rename it")
    return text


def path(text: str | None) -> str | None:
    """What may be the path of a file or folder."""
    if text is not None and (not text.strip() or len(text) > 1000 or not text.isprintable()):
        raise ValueError(f"{shortened(repr(text))} is no path of a file; correct it")
    return text


def scale(value: float) -> float:
    """Of a column."""
    if not value:
        raise ValueError("scale is 0, which makes every value the same; give the factor to SI units")
    return value


def gains(values: Any) -> Any:
    """Drive gains in N m/A; the sign belongs to the current."""
    if isinstance(values, tuple) and (not values or min(values) <= 0):
        raise ValueError(
            "every gain must be positive (N m/A); where a current counts the other way, write sign: -1 in "
            "its column: columns: {i1: {column: i1, sign: -1}}"
        )
    return values


def gravity(vector: tuple[float, float, float] | None) -> tuple[float, float, float] | None:
    """m/s^2 in the base frame."""
    if vector is not None and (problem := plausible.gravity(vector)):
        raise ValueError(problem)
    return vector


def columns_apart(columns: Mapping[str, Any], where: str) -> None:
    """No two signals from one column. `columns`: signal -> its map, the study's and the recording's.

    A signal that is not mapped stands in the column of its own name, so tau_m1: q1 takes q1's.
    """
    taken: dict[Any, str] = {}
    for signal, place in columns.items():
        column = place.column
        other = taken.get(column)
        # a torque's own column may well hold currents, and a sensor's a motor's: they are not read together
        position = isinstance(column, str) and (found := SIGNAL.fullmatch(column)) and found[1] == "q"
        if other is None and position and column != signal and column not in columns:
            other = str(column)
        if other is not None:
            raise ValueError(
                f"{where}: {shortened(str(signal))} and {shortened(other)} are both read from the column "
                f"{shortened(str(column))}; give each its own"
            )
        taken[column] = signal


def estimator(study: Any) -> None:
    """What the chosen estimator needs of the other keys."""
    name = study.estimator
    if (name == "recursive") != (study.forgetting is not None):
        raise ValueError(
            "estimator: recursive weighs old rows less; give forgetting: 0.9, the share that 15 min leave"
            if study.forgetting is None
            else "forgetting: acts with estimator: recursive alone; write that, or leave the key out"
        )
    if name == "tls" and (study.drive_gains != "identify" or study.model == "B" or study.payload_mass):
        raise ValueError(
            "estimator: tls finds drive gains from currents and joint torques; write drive_gains: identify "
            "with model A, C or D and no payload_mass, or another estimator"
        )
    if name not in ("iv", "didim") and study.controller is None:
        return
    if name in ("iv", "didim") and study.controller is None:
        raise ValueError(
            f"estimator: {name} simulates the loop that moved the robot; add controller: "
            "{bandwidth_hz: 10} with its bandwidth, or its gains kp and kd, and log the commanded positions"
        )
    use = f"estimator: {name}" if name in ("iv", "didim") else "controller:"
    if study.model not in "AC" or study.channels is not None:
        raise ValueError(f"{use} needs every motor torque; write model: A or C without channels")
    beyond = [key for key in ("effects", "turn_over", "presliding", "stiffness") if getattr(study, key)]
    beyond += ["drive_gains"] if study.drive_gains == "identify" else []
    beyond += ["robust"] if study.robust and name in ("iv", "didim") else []
    if beyond:
        raise ValueError(
            f"{use} simulates the rigid robot with the model's own friction, without {beyond[0]}; leave "
            f"{beyond[0]} out, or leave controller out and write estimator: wls"
        )


def overlapping(entries: Iterable[Any], roles: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Recordings of several roles on the same rows: the label of that one whose role is the later of `roles`,
    and a sentence: its judgement is worth nothing."""
    found = []
    entries = list(entries)
    for k, one in enumerate(entries):
        for other in entries[k + 1 :]:
            if one.file != other.file or one.use == other.use or one.table is not None:
                continue
            start = max(-math.inf if e.from_s is None else e.from_s for e in (one, other))
            end = min(math.inf if e.to_s is None else e.to_s for e in (one, other))
            if start < end:
                judge = max(one, other, key=lambda entry: roles.index(entry.use))
                said = (
                    f"{shortened(one.file)} is used to {one.use} and to {other.use} on the same rows; part "
                    "them with from and to, or name another recording"
                )
                found.append((judge.label, said))
    return tuple(found)


def within_rates(study: Any, slowest_hz: float) -> Any:
    """The study with the position cut-off that its recordings can hold, where it does not say one itself."""
    settings = study.filter
    if "position_cutoff_hz" in settings.model_fields_set:
        return study
    held = float(f"{USUAL_SHARE * slowest_hz:.3g}")
    if held >= settings.position_cutoff_hz:
        return study
    return study.with_(filter=settings.model_copy(update={"position_cutoff_hz": held}))


def check_rates(study: Any, label: str, rate_hz: float) -> None:
    """Cut-offs and resampling that the study says against the rate of a recording. Raises StudyError."""
    settings = study.filter
    highest = HIGHEST_SHARE * rate_hz
    for key in ("position_cutoff_hz", "sign_cutoff_hz", "decimation_cutoff_hz"):
        value = getattr(settings, key)
        if key in settings.model_fields_set and isinstance(value, float) and value > highest:
            raise StudyError(
                str(study.file),
                f"filter.{key}",
                f"{value:g} Hz is above what {label}, recorded at {rate_hz:.4g} Hz, can hold; write at most "
                f"{highest:.3g}",
            )
    if settings.resample_hz is not None and settings.resample_hz > RESAMPLED * rate_hz:
        raise StudyError(
            str(study.file),
            "filter.resample_hz",
            f"{settings.resample_hz:g} Hz is more than {label} holds, recorded at {rate_hz:.4g} Hz; "
            "leave the key out, or write at most that",
        )
