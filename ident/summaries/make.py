"""From a study's recordings to windows: one pass, rows seen once and then left.

The temperature proxy of a joint is the heat its friction makes of its motion, up to a factor: dq^2 through a
first-order lag of half an hour, the time constant at which arms of 10 to 200 kg warm up. It starts cold.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ident.cores import one_blas_thread
from ident.equations.build import build
from ident.equations.columns import Columns
from ident.equations.observation import DecimatedSegment, GrowingFactor, RecordingSystem
from ident.equations.prepared import Prepared, prepare_study
from ident.estimation.estimators.recursive import WINDOW_S
from ident.estimation.least_squares import channel_sigma, weighted_least_squares
from ident.examination.check import worst_first
from ident.examination.examine import examine_fit, examine_tables
from ident.progress import Progress, silent
from ident.recordings.recording import RecordingStream
from ident.recordings.study import Study
from ident.signals.filtering import FilteredBlock
from ident.summaries.file import Header, Summary
from ident.summaries.window import Window

LAGS = 13  # of residual products, from lag 0
WARMING_S = 1800.0


def windows_of(prepared: Prepared, cutoff_hz: float, progress: Progress = silent) -> tuple[Window, ...]:
    """Every recording of a study in windows of 15 min. Raises IdentError."""
    motion = MotionKeeper(prepared.columns)
    systems = build(prepared, cutoff_hz, observer=motion, progress=progress)
    return tuple(window for system in systems for window in _windows(system, prepared.columns, motion))


@dataclass(slots=True)
class MotionKeeper:
    """An observer of `build`: seconds of motion, temperature proxy, |dq| and |tau| of each window."""

    columns: Columns
    sums: dict[tuple[str, int], list[np.ndarray]] = field(default_factory=dict)
    begun: dict[str, float] = field(default_factory=dict)
    warm: dict[str, np.ndarray] = field(default_factory=dict)
    last: dict[str, float] = field(default_factory=dict)

    def __call__(self, stream: RecordingStream, index: int, block: FilteredBlock) -> None:
        label, n = stream.label, len(self.columns.need.joints)
        first = self.begun.setdefault(label, stream.survey.segments[0].start)
        torque, joint_of = np.abs(self.columns.torque(block)), self.columns.joint_of
        number = np.floor((block.t - first) / WINDOW_S).astype(int)
        for k in np.unique(number):
            mine = number == k
            seconds = mine.sum() / stream.rate_hz
            rest = max(float(block.t[mine][0]) - self.last.get(label, first), 0.0)
            cool = self.warm.get(label, np.zeros(n)) * math.exp(-rest / WARMING_S)
            heat = np.mean(block.dq[mine] ** 2, axis=0)
            self.warm[label] = heat + (cool - heat) * math.exp(-seconds / WARMING_S)
            self.last[label] = float(block.t[mine][-1])
            load = np.zeros(n)
            load[joint_of] = np.mean(torque[mine], axis=0)
            new = [np.array([seconds]), seconds * (cool + self.warm[label]) / 2]
            new += [seconds * np.mean(np.abs(block.dq[mine]), axis=0), seconds * load]
            key = label, int(k)
            self.sums[key] = [a + b for a, b in zip(self.sums[key], new)] if key in self.sums else new


def _windows(system: RecordingSystem, columns: Columns, motion: MotionKeeper) -> Iterable[Window]:
    sigma = channel_sigma(system.factors)
    chi = weighted_least_squares(system.factors, sigma, columns.parameters).chi
    first = motion.begun[system.label]
    growing: dict[int, list[GrowingFactor]] = {}
    products: dict[int, np.ndarray] = defaultdict(lambda: np.zeros((len(sigma), LAGS)))
    counts: dict[int, np.ndarray] = defaultdict(lambda: np.zeros((len(sigma), LAGS), int))
    for segment in system.segments:
        number = np.floor((segment.t - first) / WINDOW_S).astype(int)
        for _, piece in segment.pieces():
            its = np.floor((piece.t - first) / WINDOW_S).astype(int)
            for k in np.unique(its):
                factors = growing.setdefault(int(k), [GrowingFactor(f.columns) for f in system.factors])
                _push(factors, system, piece, its == k)
        rho = segment.Y - system.predicted(segment, chi)
        for k in np.unique(number):
            mine = number == k
            products[k] += _products(rho[:, mine])
            counts[k] += _products(segment.used[:, mine].astype(float)).astype(int)
    for k, factors in sorted(growing.items()):
        done = tuple(factor.factor() for factor in factors)
        seconds, heat, speed, load = motion.sums.get((system.label, k), _none(len(columns.need.joints)))
        start = first + k * WINDOW_S
        yield Window(
            system.label,
            start,
            start + WINDOW_S,
            done,
            products[k],
            counts[k],
            float(seconds[0]),
            heat,
            speed,
            load,
        )


def _none(n: int) -> Sequence[np.ndarray]:
    return np.zeros(1), np.zeros(n), np.zeros(n), np.zeros(n)


def _push(
    factors: Sequence[GrowingFactor], system: RecordingSystem, piece: DecimatedSegment, mine: np.ndarray
) -> None:
    values = piece.values[:, mine]
    for j, factor in enumerate(factors):
        its = system.channel == j
        factor.add_entries(system.column[its], values[its], piece.Y[j, mine], piece.used[j, mine])


def _products(x: np.ndarray) -> np.ndarray:
    """sum_t x_t x_{t+lag} of each row of x (C, m) -> (C, LAGS)."""
    out = np.zeros((len(x), LAGS))
    for lag in range(min(LAGS, x.shape[1])):
        out[:, lag] = np.einsum("ct,ct->c", x[:, : x.shape[1] - lag], x[:, lag:])
    return out


def summarise(study: Study, key: str = "", progress: Progress = silent) -> Summary:
    """A study's recordings as a summary. Raises IdentError, GeneratedError, ModelgenError.

    An automatic cut-off is 0.08 times that of the positions (the paper's 0.8 Hz for 10): one that is chosen
    from the data would differ from recording to recording, and their factors could not be added.
    """
    with one_blas_thread():
        prepared = prepare_study(study, progress)
        study = prepared.study
        asked = study.filter.decimation_cutoff_hz
        cutoff = 0.08 * study.filter.position_cutoff_hz if asked == "auto" else asked
        checks = worst_first([*examine_tables(prepared), *examine_fit(prepared)])
        windows = windows_of(prepared, cutoff, progress)
    columns = prepared.columns
    header = Header(
        study.robot,
        study.model,
        columns.parameters,
        columns.units,
        columns.channels,
        tuple(str(joint) for joint in columns.need.joints),
        tuple(int(joint) for joint in columns.joint_of),
        tuple(tuple(factor.columns.tolist()) for factor in windows[0].factors),
        cutoff,
        study.filter.position_cutoff_hz,
        tuple(check.sentence for check in checks),
        key,
    )
    return Summary(header, windows)
