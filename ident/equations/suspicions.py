"""A bad fit asks a question: were two joints swapped, was a sign reversed?

Only when a fit explains its own recordings badly, some hundred samples are fitted again under every single
hypothesis (two torque columns exchanged, two position columns exchanged, one of either reversed). One that
makes the error collapse is told as a warning; nothing is changed by it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, islice

import numpy as np

from ident.equations.columns import Columns
from ident.recordings.recording import RecordingStream
from ident.signals.filtering import FilterBank, filter_stream

BAD_PERCENT = 20.0  # error on its own recordings from which a fit is questioned
COLLAPSE = 0.6  # of the error must go
SAMPLES = 500


@dataclass(frozen=True, slots=True)
class _Sample:
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    sign: np.ndarray
    Y: np.ndarray


def suspected_mix_ups(
    streams: Sequence[RecordingStream], banks: Sequence[FilterBank], columns: Columns
) -> list[str]:
    """Warnings, at most one: the hypothesis that explains the recordings best, if it does so far better."""
    pairs = [(s, bank) for s, bank in zip(streams, banks) if s.role == "identify"]
    sample = _sample(pairs[0][0], pairs[0][1], columns)
    if sample is None or columns.gain_columns:
        return []
    joints = columns.need.joints
    plain = _error(_regressor(columns, sample), sample.Y)
    found = [(error, text) for error, text in _hypotheses(columns, sample, joints)]
    if not found:
        return []
    error, text = min(found)
    if error > (1 - COLLAPSE) * plain:
        return []
    return [
        f"{pairs[0][0].label}: {text}; with that undone the error falls "
        f"from {100 * plain:.0f} to {100 * error:.0f} %, "
        "so check the columns"
    ]


def _sample(stream: RecordingStream, bank: FilterBank, columns: Columns) -> _Sample | None:
    total = sum(s.move_end - s.move_start for s in stream.survey.segments) * stream.rate_hz
    stride = max(1, int(total / SAMPLES))
    parts = [
        (b.q[::stride], b.dq[::stride], b.ddq[::stride], b.sign_dq[::stride], columns.torque(b)[::stride])
        for _, b in islice(filter_stream(stream, bank, torque_too=True), 40)
    ]
    return _Sample(*(np.concatenate(part) for part in zip(*parts))) if parts else None


def _regressor(columns: Columns, s: _Sample) -> np.ndarray:
    """W (channels, N, b)."""
    W = columns.model.regressor(s.q, s.dq, s.ddq, sign=s.sign)[:, columns.rows]
    return np.ascontiguousarray(W.transpose(1, 0, 2))


def _error(W: np.ndarray, Y: np.ndarray) -> float:
    """Relative error of least squares with every channel divided by its rms."""
    scale = np.maximum(np.sqrt(np.mean(Y**2, axis=0)), 1e-12)
    rows = (W / scale[:, None, None]).reshape(-1, W.shape[2])
    right = (Y / scale).T.reshape(-1)
    length = np.linalg.norm(rows, axis=0)
    normal = rows / np.where(length > 0, length, 1.0)
    gram = normal.T @ normal
    gram[np.diag_indices_from(gram)] += 1e-9
    solution = np.linalg.solve(gram, normal.T @ right)
    return float(np.linalg.norm(right - normal @ solution) / np.linalg.norm(right))


def _hypotheses(columns: Columns, s: _Sample, joints: tuple[int, ...]) -> Iterator[tuple[float, str]]:
    n, W = len(joints), _regressor(columns, s)
    channels = [("motor" if c.side == "drive" else c.side, joints[c.joint]) for c in columns.need.channels]
    for a, b in combinations(range(len(channels)), 2):
        if channels[a][0] != channels[b][0]:
            continue
        order = np.arange(len(channels))
        order[[a, b]] = b, a
        yield (
            _error(W, s.Y[:, order]),
            f"the {channels[a][0]} torques of joints {channels[a][1]} and {channels[b][1]} look swapped",
        )
    for a, (side, joint) in enumerate(channels):
        sign = np.ones(len(channels))
        sign[a] = -1.0
        yield (
            _error(W, s.Y * sign),
            f"the {side} torque of joint {joint} looks recorded with the other sign",
        )
    for a, b in combinations(range(n), 2):
        order = np.arange(n)
        order[[a, b]] = b, a
        swapped = _Sample(s.q[:, order], s.dq[:, order], s.ddq[:, order], s.sign[:, order], s.Y)
        yield (
            _error(_regressor(columns, swapped), s.Y),
            f"the positions of joints {joints[a]} and {joints[b]} look swapped",
        )
    for a in range(n):
        sign = np.ones(n)
        sign[a] = -1.0
        turned = _Sample(s.q * sign, s.dq * sign, s.ddq * sign, s.sign * sign, s.Y)
        yield (
            _error(_regressor(columns, turned), s.Y),
            f"the position of joint {joints[a]} looks recorded with the other sign",
        )
