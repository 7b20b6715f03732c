"""What is left of a channel of which nothing was said, and is no noise all the same: an error far beyond
what noise and parameters make on the rows that judge, one that oscillates of its own, or one that is of a
stretch of a recording alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.special

from ident.diagnosis.evidence.metric import orthonormal
from ident.diagnosis.evidence.state import State
from ident.diagnosis.evidence.sufficiency import FORETOLD
from ident.diagnosis.evidence.turning_rows import keeping_direction
from ident.diagnosis.telling.findings import Finding, Unexplained
from ident.diagnosis.telling.loud_for_a_while import Stretch, loud_stretches
from ident.diagnosis.telling.oscillating import Oscillation, blocks, oscillation
from ident.diagnosis.telling.pictures import picture
from ident.estimation.fit import FitResult
from ident.signals.filtering import prepare

TINY = 1e-300
BY_CHANCE = 1e-3  # that so few fitted rows show so little noise; of many it is none
FAR_OFF = 3.0  # times what noise and parameters explain: an error of judged rows that is no noise


def beyond_noise(
    last: FitResult, state: State, findings: Sequence[Finding], told: Sequence[Unexplained], tau: float
) -> tuple[Unexplained, ...]:
    """Channels of which nothing was said, and whose residual is no noise all the same: its error on the rows
    that judge is far beyond what noise and the parameters' uncertainty make there, it oscillates of its own,
    foretold by its past (a vibration, a slosh), or it is that of a stretch alone. What only wanders is what
    slow noise does. (Of an arm with 3.3 Hz on one torque, 2.4 % of it, nothing was said beside a delay of a
    millisecond of the whole robot: what acts on all torques explains no oscillation of one.)"""
    known = {joint for f in findings for joint in f.joints} | {joint for u in told for joint in u.joints}
    everywhere = any(not f.joints for f in findings)
    rows, out = state.rows, list[Unexplained]()
    away, quiet = keeping_direction(state), list[int]()
    for c, channel in enumerate(last.columns.need.channels):
        joint = last.columns.need.joints[channel.joint]
        fitted, judged = (side & rows.use[c] for side in (rows.fitted, rows.judged))
        if joint in known or not fitted.any() or not judged.any():
            continue
        noise, free = np.mean(state.residual[c, fitted] ** 2), float(state.metric.fitted.free[c])
        new, news = state.whiteners[c].sigma ** 2, state.whiteners[c].news
        kind = last.columns.channels[c].rstrip("0123456789")
        found, own = _given(state, c, away[c])
        by_chance = scipy.special.fdtri(news * (judged & away[c]).sum(), max(news * free, 1.0), 1 - BY_CHANCE)
        far_off = FAR_OFF**2 * by_chance
        if not everywhere and found > far_off * own and _together(state, c, away[c]) > far_off:
            share = 100.0 * float(1.0 - own / found)
            out.append(Unexplained((joint,), kind, (), share, 0.0, None, False))
            continue
        swings = _oscillation(last, state, c, fitted, judged) if noise * FORETOLD > new else None
        if swings is not None and swings.log_e > tau:
            nats = 0.5 * float(fitted.sum()) * float(np.log(noise / new))
            share = 100.0 * float(1.0 - new / noise)
            shown = picture(state, None, c, ("t",))
            at = swings.frequency_hz
            its = Unexplained((joint,), kind, ("t",), share, nats, None, False, shown, oscillates_hz=at)
            out.append(its)
        elif not everywhere:
            quiet.append(c)
    stretches = loud_stretches(state, quiet, away)
    return (*out, *(u for its in stretches for u in _of_stretch(its, last, state)))


def _of_stretch(its: Stretch, last: FitResult, state: State) -> list[Unexplained]:
    """One of the motors' torques, one of the sensors'."""
    kinds: dict[str, list[int]] = {}
    for c in sorted(its.parts):
        kinds.setdefault(last.columns.channels[c].rstrip("0123456789"), []).append(c)
    where = its.recording, its.start, its.stop, state.begins(its.recording)
    need, out = last.columns.need, list[Unexplained]()
    for kind, own in kinds.items():
        joints = tuple(need.joints[need.channels[c].joint] for c in own)
        share = 100.0 * its.of(own)
        out.append(Unexplained(joints, kind, ("t",), share, 0.0, None, False, stretch=where))
    return out


def _lasting(state: State, c: int, judged: np.ndarray) -> np.ndarray:
    """(M,) what a channel's residual has in common all through a run of judged rows: the slowest of all
    noise; of stretches of fitted runs none, whose own offset it is in."""
    out, run = np.zeros(len(judged)), state.rows.recording
    if state.rows.held_apart:
        for r in np.unique(run[judged]):
            out[run == r] = state.residual[c, judged & (run == r)].mean()
    return out


def _oscillation(
    last: FitResult, state: State, c: int, fitted: np.ndarray, judged: np.ndarray
) -> Oscillation | None:
    """Of a channel's residual."""
    values, rows = state.design[0][c][1], state.rows
    learned, asked = (blocks(rows, state.residual[c], side, values) for side in (fitted, judged))
    deciding = [stream for stream in last.recordings if stream.role != "test"]
    banks = [bank for stream in deciding if (bank := prepare(stream, last.study.filter)).lowest]
    of_joints = zip(*([position for position, _ in bank.filters] for bank in banks))
    lowest = [min(its, key=lambda filter: filter.cutoff_hz) for its in of_joints]
    in_steps = [its for its in lowest if its.cutoff_hz < last.study.filter.position_cutoff_hz]
    return oscillation(rows.hop, learned, asked, in_steps)


def _together(state: State, c: int, here: np.ndarray) -> float:
    """Mean square of a channel's judged rows in which its joint does not turn, all rows fitted, over that of
    the fitted rows' own fit. What one set of parameters explains on both lacks no term: the fitted rows told
    these worse than their noise says, as motions do that are hardly larger than their errors. (A clean arm's
    joint that crept through 0.06 rad was 26 times its noise where it went through 0.13 others; one fit left
    0.4 % of both.)"""
    both, judged = state.plain_metric.both, state.rows.judged & here
    return float(np.mean(both.residual[c, judged] ** 2)) if judged.any() else 0.0


def _given(state: State, c: int, here: np.ndarray) -> tuple[float, float]:
    """Mean square of a channel's judged rows in which its joint does not turn (`here`, of both sides), the
    parameters going as far after them as fitted rows of all channels allow, each of which counts by what is
    new in it; and its noise's on fitted ones, (0, 0) where none is left. (A joint that went one way tells its
    dry friction from an offset by starts and stops alone, and was far off where it went the other. A clean
    arm's slow turns, of which the fitted run had none, were twelve times its noise.)"""
    design, B = state.design
    fitted, judged = state.rows.fitted & here, state.rows.judged & here
    if not fitted.any() or not judged.any():
        return 0.0, 0.0
    rows = int((state.rows.fitted & state.rows.use[c]).sum())
    own = float(np.mean(state.residual[c, fitted] ** 2)) * rows / float(state.metric.fitted.free[c])
    gram = np.zeros((B, B))
    for k, (places, values) in enumerate(design):
        on = fitted if k == c else state.rows.fitted & state.rows.use[k]
        if on.any():
            X, power = values[on], own if k == c else float(np.mean(state.residual[k, on] ** 2))
            gram[np.ix_(places, places)] += X.T @ X * (state.whiteners[k].news / max(power, TINY))
    places, values = design[c]
    e, X = (state.residual[c] - _lasting(state, c, judged))[judged], values[judged]
    gram[np.ix_(places, places)] += X.T @ X / own
    basis = orthonormal(gram)[places]
    return float(e @ e - np.sum((basis.T @ (X.T @ e)) ** 2) / own) / len(e), own
