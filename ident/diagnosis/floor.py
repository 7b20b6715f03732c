"""The noise floor of a channel: what of its torque no model of the motion could ever explain.

Above the band of the motion a robot's torque holds noise alone. Its density there, the median of the
periodogram of short windows (lines and knocks do not move it), taken as flat down to rest, gives the noise
inside the band of the fit's position filter. It is read off the recorded torque itself, so it does not
follow the residual. Slow noise is not in it; a recording whose rate leaves nothing above the band has no
floor."""

from __future__ import annotations

import numpy as np
import scipy.signal

from ident.equations.prepared import Prepared
from ident.signals.filtering import filter_stream

SECONDS = 60.0  # of each recording
WINDOW_S = 1.0
LOWEST, HIGHEST = 2.5, 0.9  # of the position cut-off, of half the rate


def noise_floor(prepared: Prepared) -> dict[str, float]:
    """{channel: percent of the rms torque} over the identify recordings, at the full filtered rate."""
    noise, power = 0.0, 0.0
    cutoff = prepared.study.filter.position_cutoff_hz
    for stream, bank in zip(prepared.streams, prepared.banks):
        if stream.role != "identify" or stream.rate_hz * HIGHEST / 2 < 1.3 * LOWEST * cutoff:
            continue
        parts, seconds = [], 0.0
        for _, block in filter_stream(stream, bank):
            parts.append(prepared.columns.torque(block))
            seconds += len(block.t) / stream.rate_hz
            if seconds > SECONDS:
                break
        torque = np.concatenate(parts)
        size = int(WINDOW_S * stream.rate_hz)
        if len(torque) < 4 * size:
            continue
        f, P = scipy.signal.welch(torque, stream.rate_hz, "hann", size, axis=0, average="median")
        band = (f > LOWEST * cutoff) & (f < HIGHEST * stream.rate_hz / 2)
        density = np.median(P[band], axis=0)
        passed = bank.position.response(f)
        width = float(np.sum(passed**2) * (f[1] - f[0]))
        noise = noise + density * width
        power = power + np.mean(torque**2, axis=0)
    if np.ndim(noise) == 0:
        return {}
    share = 100 * np.sqrt(np.asarray(noise) / np.maximum(np.asarray(power), 1e-300))
    return {name: float(x) for name, x in zip(prepared.columns.channels, share)}
