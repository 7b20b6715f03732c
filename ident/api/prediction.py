"""Torque of an identified model on a motion given exactly, or on a recording that is filtered first."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ident.api.study import Recording
from ident.api.tables import arrays, frame
from ident.equations import comparison
from ident.errors import IdentError
from ident.estimation.fit import FitResult
from ident.prediction.torque_free import open_log
from ident.recordings.opening import open_recording
from ident.recordings.recording import RecordingStream
from ident.signals.dry_friction import sign_within
from ident.signals.filtering import FilteredBlock, filter_stream, prepare, smooth_sign


def of_motion(result: FitResult, q: Any, dq: Any, ddq: Any, payload: str | None) -> np.ndarray:
    """(N, n) each, rad|m and s -> (N, channels). Raises IdentError."""
    columns = result.columns
    _check_payload(result, payload)
    if result.terms:
        raise IdentError("the fit has effects, which need a history; predict a recording with its torques")
    n = len(columns.need.joints)
    given = []
    for name, values in (("q", q), ("dq", dq), ("ddq", ddq)):
        array = np.asarray(values, dtype=float)
        if array.ndim != 2 or array.shape[1] != n or not np.isfinite(array).all():
            raise IdentError(f"{name} has shape {array.shape}; give (N, {n}) finite values, rad|m and s")
        given.append(np.ascontiguousarray(array))
    if len({len(array) for array in given}) > 1:
        raise IdentError("q, dq and ddq have different numbers of rows; give arrays of one length")
    rows = len(given[0])
    still = np.zeros(n)
    q, dq, ddq = given
    sign = smooth_sign(dq, still)
    for j, turn in enumerate(result.study.turn_overs):  # samples alone: no presliding, no steps between them
        sign[:, j] = sign_within(dq[:, j], turn.rate)
    t, all_of_it = np.arange(float(rows)), np.ones((rows, n))
    block = FilteredBlock(t, q, dq, ddq, sign, None, None, still, all_of_it)
    return comparison.modelled_torque(columns, result.estimate.chi, payload, block)


def of_recording(result: FitResult, data: Any, payload: str | None) -> Any:
    """A path, table or `Recording` -> table of t and the channels. Raises IdentError."""
    need = result.columns.need
    _check_payload(result, payload)
    study = result.study.with_(trim_rest=False)
    entry = data if isinstance(data, Recording) else Recording(data, payload=payload)
    if result.terms:
        stream = open_log(study, entry, need)
    else:
        bare = replace(need, motor=(), sensor=need.sensor if study.positions == "joint" else ())
        stream = open_recording(study, entry, bare)
    bank = prepare(stream, study.filter, study.turn_overs)
    t: list[np.ndarray] = []
    values: list[np.ndarray] = []
    for _, stretch in itertools.groupby(filter_stream(stream, bank), key=lambda item: item[0]):
        torques = _modelled(result, stream, (block for _, block in stretch), t)
        values += [rows for _, rows in comparison.low_pass_blocks(torques, bank.position)]
    return frame(arrays(t, values, result.columns.channels))


def _modelled(
    result: FitResult, stream: RecordingStream, blocks: Iterable[FilteredBlock], t: list[np.ndarray]
) -> Iterator[np.ndarray]:
    """Torque (N, channels) of the blocks of one stretch; their times go into `t`."""
    columns, chi = result.columns, result.estimate.chi
    if not result.terms:  # blocks without torques
        for block in blocks:
            t.append(block.t)
            yield comparison.modelled_torque(columns, chi, stream.payload, block)
        return
    fitted = comparison.Fitted(result.model, chi, result.terms)
    for block, _, (torque,) in comparison.fitted_torques(columns, stream, blocks, (fitted,)):
        t.append(block.t)
        yield torque


def _check_payload(result: FitResult, payload: str | None) -> None:
    known = [label for label in result.columns.sources if label]
    if payload is not None and payload not in known:
        said = f"the payloads are {', '.join(known)}" if known else "the study has no payload"
        raise IdentError(f"payload {payload!r} was not identified; {said}")
