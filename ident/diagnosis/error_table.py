"""Relative errors of a fitted state, by role and by recording: 100 ||rho||/||Y|| of the filtered torque.

Summed over the kept instants, 2.5 times as many a second as the filter's cut-off in Hz: a band-limited
signal sampled above its Nyquist rate keeps its mean square, so this is the error at the full filtered rate.
Joints at rest are left out, their friction is undetermined.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from ident.diagnosis.state import State

Percent = dict[str, dict[str, float]]


def errors(state: State) -> Percent:
    """{role: {"total" | channel: percent}} with everything frozen at the identify fit."""
    runs = state.context.rows.runs
    roles = [role for role in ("identify", "validate", "test") if any(r.role == role for r in runs)]
    return _percent(state, {role: [k for k, r in enumerate(runs) if r.role == role] for role in roles})


def errors_by_recording(state: State) -> Percent:
    """The same for every recording alone, {label: {"total" | channel: percent}}."""
    return _percent(state, {run.label: [k] for k, run in enumerate(state.context.rows.runs)})


def _percent(state: State, groups: Mapping[str, Sequence[int]]) -> Percent:
    rows = state.context.rows
    out: Percent = {}
    for name, runs in groups.items():
        use = np.isin(rows.run, runs) & rows.keep
        if not use.any():
            continue
        rho, y = state.system.residual * use, rows.y * use
        own = {"total": 100 * _ratio(rho, y)}
        for c, channel in enumerate(rows.channels):
            own[channel] = 100 * _ratio(rho[c], y[c])
        out[name] = own
    return out


def _ratio(rho: np.ndarray, y: np.ndarray) -> float:
    return float(np.linalg.norm(rho)) / max(float(np.linalg.norm(y)), 1e-30)
