"""The equations of a study as the diagnosis reads them: rows that are fitted, rows that judge, rows left
alone.

They are `equations.build`'s own rows, at a higher cut-off than the fit's, divided by their weight (the
share of a row's samples that count) where that is at least one half; other rows are not used. Each channel
keeps the columns of W that are not zero in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.equations.observation import RecordingSystem

LEAST = 0.5  # weight of a row that is used: below it hardly half of its samples count
SIDES = 0.45  # share of the rows that judge where no recording was kept apart


@dataclass(frozen=True, slots=True)
class Rows:
    """All kept instants, recording after recording. M instants, C channels, b parameters.

    t (M,) [s], recording (M,), piece (M,) numbers; Y (C, M) [N m]; use (C, M) bool; fitted, judged (M,) bool:
    every choice is made on the fitted rows, every comparison on the judged ones. base[c] = (columns (k,),
    values (M, k)) of W. names, roles, payloads: of the recordings. hop: seconds between rows.
    """

    t: np.ndarray
    recording: np.ndarray
    piece: np.ndarray
    Y: np.ndarray
    use: np.ndarray
    fitted: np.ndarray
    judged: np.ndarray
    base: tuple[tuple[np.ndarray, np.ndarray], ...]
    b: int
    names: tuple[str, ...]
    roles: tuple[str, ...]
    payloads: tuple[str | None, ...]
    scale: np.ndarray  # (C, M) one over the weight, for columns that come decimated with it
    hop: float
    held_apart: bool  # the judged rows are recordings of their own

    @property
    def channels(self) -> int:
        return len(self.base)

    def only(self, chosen: np.ndarray) -> Rows:
        """Some of them (k,), by number."""
        return replace(
            self,
            **{name: getattr(self, name)[chosen] for name in ("t", "recording", "piece", "fitted", "judged")},
            **{name: getattr(self, name)[:, chosen] for name in ("Y", "use", "scale")},
            base=tuple((columns, values[chosen]) for columns, values in self.base),
        )

    @property
    def usable(self) -> np.ndarray:
        """(M,) bool: fitted or judged."""
        return self.fitted | self.judged


def rows_of(systems: Sequence[RecordingSystem], b: int) -> Rows:
    """Stack the decimated rows of all recordings; decide which of them judge."""
    t, recording, piece, Y, weight = [], [], [], [], []
    C = len(systems[0].factors)
    used = [np.unique(np.concatenate([s.column[s.channel == c] for s in systems])) for c in range(C)]
    values: list[list[np.ndarray]] = [[] for _ in range(C)]
    count = 0
    for number, system in enumerate(systems):
        for segment in system.segments:
            m = len(segment.t)
            t.append(segment.t)
            recording.append(np.full(m, number))
            piece.append(np.full(m, count))
            count += 1
            Y.append(segment.Y)
            weight.append(segment.weight)
            for c in range(C):
                mine = system.channel == c
                part = np.zeros((m, len(used[c])))
                np.add.at(part.T, np.searchsorted(used[c], system.column[mine]), segment.values[mine])
                values[c].append(part)
    whole = np.hstack(weight)
    use = whole >= LEAST
    scale = np.where(use, 1.0 / np.where(use, whole, 1.0), 0.0)
    time, its_run = np.concatenate(t), np.concatenate(recording)
    roles = tuple(system.role for system in systems)
    fitted, judged, apart = _sides(time, its_run, roles)
    hop = float(np.median(np.concatenate([np.diff(part) for part in t if len(part) > 1])))
    return Rows(
        time,
        its_run,
        np.concatenate(piece),
        np.hstack(Y) * scale,
        use,
        fitted,
        judged,
        tuple((used[c], np.concatenate(values[c]) * scale[c][:, None]) for c in range(C)),
        b,
        tuple(system.label for system in systems),
        roles,
        tuple(system.payload for system in systems),
        scale,
        hop,
        apart,
    )


def _sides(t: np.ndarray, recording: np.ndarray, roles: Sequence[str]) -> tuple[np.ndarray, np.ndarray, bool]:
    """Validate recordings judge. Without them identify recordings do, and with one alone, stretches of it."""
    role = np.array(roles)[recording]
    if (role == "validate").any():
        return role == "identify", role == "validate", True
    own = role == "identify"
    return _parted(t, recording, own)


def halved(rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    """(M,), (M,) bool: the fitted rows in two parts, by recordings where there is more than one of them."""
    first, second, _ = _parted(rows.t, rows.recording, rows.fitted)
    return first, second


def _parted(t: np.ndarray, recording: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    runs = np.unique(recording[own])
    if len(runs) > 1:
        sizes = np.array([(recording == r).sum() for r in runs])
        order = np.argsort(-sizes, kind="stable")
        judges: list[int] = []
        for k in order[1:]:
            if sizes[judges].sum() + sizes[k] <= SIDES * sizes.sum() or not judges:
                judges.append(int(k))
        judged = np.isin(recording, runs[judges])
        return own & ~judged, judged, True
    span = np.ptp(t[own]) + 1e-9
    place = (t - t[own].min()) / span * max(4, 2 * round(span / 10.0))
    judged = own & (np.floor(place).astype(int) % 2 == 1)
    return own & ~judged, judged, False
