"""How much white noise there can be in a channel, at most, by what its own past does not foretell.

White noise has no past. Through the filter of the rows it is foretold a little, by as much as the filter's
taps say; whatever else is foretold of what is left is slow noise, or something that the model lacks. (Of a
UR10e's first torque 8.7 % were left, 98.7 % of whose squares their past foretold; that the model lacks
nothing was said, as no frequencies of noise alone could be read.)
"""

from __future__ import annotations

import numpy as np
import scipy.integrate
import scipy.linalg

from ident.diagnosis.evidence.state import State
from ident.diagnosis.rows.whitened import Whitener
from ident.equations.fine import FineSegment
from ident.estimation.fit import FitResult
from ident.signals.filtering import LowPass

FREQUENCIES = 2000  # of the position filter's band


def white_at_most(fit: FitResult, state: State) -> dict[str, float]:
    """{channel: percent} of its rms torque on the fitted recordings, through the position filter, as the
    error is."""
    rates = {stream.label: stream.rate_hz for stream in fit.recordings}
    curves = [curve for curve in fit.errors.curves if curve.role == "identify"]
    segments = [s for s in state.segments if s.label in {curve.label for curve in curves}]
    if not segments:
        return {}
    segment, settings = segments[0], fit.study.filter
    passed = LowPass(settings.position_cutoff_hz, rates[segment.label], settings.order)
    f = np.linspace(0.0, rates[segment.label] / 2, FREQUENCIES)
    band = float(scipy.integrate.trapezoid(passed.response(f) ** 2, f))
    out = {}
    for c, name in enumerate(fit.columns.channels):
        measured = np.concatenate([curve.measured[:, c] for curve in curves])
        power = float(np.nanmean(measured**2)) if np.isfinite(measured).any() else 0.0
        if power > 0:
            density = 2 * _variance(state.whiteners[c], segment) / segment.rate_hz
            out[name] = float(100 * np.sqrt(density * band / power))
    return out


def _variance(w: Whitener, segment: FineSegment) -> float:
    """Of white noise at the fine samples whose rows are foretold no better than these."""
    lags = segment.every * np.arange(len(w.coefficients) + 1)
    taps = segment.taps
    r = np.array([taps[k:] @ taps[: len(taps) - k] if k < len(taps) else 0.0 for k in lags])
    past = scipy.linalg.solve_toeplitz(r[:-1], r[1:]) @ r[1:] if len(r) > 1 else 0.0
    return float(w.sigma**2 / (r[0] - past))
