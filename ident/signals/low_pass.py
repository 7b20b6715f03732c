"""The zero-phase Butterworth low-pass: a Butterworth filter run forwards and backwards has the real response

    G(w) = |H(w)|^2 = 1 / (1 + (tan(w/2) / tan(w_c/2))^(2 order)),   w in rad per sample,

so it is applied as a product in the frequency domain (`numpy.fft`), block by block with a halo beyond which
its impulse response is below 1e-10. The result is that of `scipy.signal.sosfiltfilt` on the whole signal
(which the tests compare), in memory that does not grow with the log; importing scipy.signal alone would
cost a second."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

TAIL = 1e-10  # where the impulse response is cut off, relative to its peak
MAX_SHARE = 0.45  # of the sampling rate: highest usable cut-off


@dataclass(frozen=True, slots=True)
class LowPass:
    """Zero-phase Butterworth of `order` run both ways: -6 dB at cutoff_hz."""

    cutoff_hz: float
    rate_hz: float
    order: int = 4

    def response(self, frequency_hz: np.ndarray) -> np.ndarray:
        """G at frequencies up to rate/2; 1 for a cut-off of MAX_SHARE of the rate or more (nothing to
        remove)."""
        if self.cutoff_hz >= MAX_SHARE * self.rate_hz:
            return np.ones_like(frequency_hz)
        scale = np.tan(np.pi * self.cutoff_hz / self.rate_hz)
        with np.errstate(over="ignore", divide="ignore"):
            ratio = np.tan(np.pi * np.minimum(frequency_hz / self.rate_hz, 0.5)) / scale
            return 1.0 / (1.0 + ratio ** (2 * self.order))

    def up_to(self, hz: float) -> LowPass:
        """The same at a cut-off of so much at most."""
        return replace(self, cutoff_hz=min(self.cutoff_hz, hz))

    @property
    def halo(self) -> int:
        """Samples after which the impulse response stays below TAIL of its peak."""
        return _length(self, TAIL)

    @property
    def transient(self) -> int:
        """Samples at an end of a recording that its continuation, which nobody knows, still moves by 1 %."""
        return self.moved(1e-2)

    def moved(self, share: float) -> int:
        """Samples at an end that the continuation moves by such a share of itself."""
        return _length(self, share)

    def poles(self) -> np.ndarray:
        """The `order` stable poles of H(z) after the bilinear transform (pairs of conjugates)."""
        k = np.arange(self.order)
        s = (
            2
            * self.rate_hz
            * np.tan(np.pi * self.cutoff_hz / self.rate_hz)
            * np.exp(1j * np.pi * (2 * k + self.order + 1) / (2 * self.order))
        )
        return (2 * self.rate_hz + s) / (2 * self.rate_hz - s)


def _length(filter: LowPass, level: float) -> int:
    if filter.cutoff_hz >= MAX_SHARE * filter.rate_hz:
        return 0
    slowest = np.abs(filter.poles()).max()
    return int(np.ceil(np.log(level) / np.log(slowest)))


@cache
def fast_length(rows: int) -> int:
    """The next 2^a 3^b 5^c: of such a length transforms are fast."""
    best = 1 << (rows - 1).bit_length()
    five = 1
    while five < best:
        odd = five
        while odd < best:
            best = min(best, odd << max(-(-rows // odd) - 1, 0).bit_length())
            odd *= 3
        five *= 5
    return best


def zero_phase(x: np.ndarray, rate_hz: float, cutoff_hz: float, order: int = 4) -> np.ndarray:
    """Filter the columns of x (N, m) forwards and backwards; ends are continued by odd reflection."""
    (out,) = through(x if x.ndim == 2 else x[:, None], [LowPass(cutoff_hz, rate_hz, order)])
    return out if x.ndim == 2 else out[:, 0]


def through(x: np.ndarray, filters: Sequence[LowPass]) -> Iterator[np.ndarray]:
    """The columns of x (N, m), continued so, behind each of several filters of one rate; transformed once."""
    halo = max(its.halo for its in filters)
    padded = reflected(x, halo, halo)
    size = fast_length(len(padded))
    spectrum, frequency = np.fft.rfft(padded, size, axis=0), np.fft.rfftfreq(size, 1.0 / filters[0].rate_hz)
    for its in filters:
        whole = np.fft.irfft(spectrum * its.response(frequency)[:, None], size, axis=0)
        yield whole[halo : halo + len(x)]


def reflected(x: np.ndarray, before: int, after: int) -> np.ndarray:
    """Continue x (N, m) point-symmetrically about its first and last rows."""
    return np.pad(x, ((before, after), (0, 0)), mode="reflect", reflect_type="odd")


def filtered(filter: LowPass, window: np.ndarray, inner: slice) -> np.ndarray:
    """The inner rows of a window (R, m) with its halo, filtered."""
    size = fast_length(len(window))
    response = filter.response(np.fft.rfftfreq(size, 1.0 / filter.rate_hz))
    return np.fft.irfft(np.fft.rfft(window, size, axis=0) * response[:, None], size, axis=0)[inner]
