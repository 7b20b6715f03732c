"""What noise alone would leave in the rows of each channel, estimated from the data in two ways.

`white_floor` carries the noise just above the rows' cut-off into the rows: it knows nothing of slow noise.
`noise_floor` adds the background between the lines of the final residual's spectrum: slow noise is in it, and
so is structure without a period (an upper bound); what repeats with the motion stands in lines and is not.
"""

import numpy as np
import scipy.ndimage
import scipy.signal

from ident.diagnosis.rows import Rows

STRETCH_SECONDS = 0.25
BACKGROUND_BINS = 41  # of the running median over the spectrum


def noise_floor(rows: Rows, torque: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """(channels,) rms in the rows, N m, at most the rms of `residual` (channels, M) itself."""
    moving = residual * rows.keep  # friction at rest is undetermined, not noise
    share = np.sqrt(rows.keep.mean(axis=1) + 1e-12)
    out = np.maximum(white_floor(rows, torque), background(rows, moving) / share)
    return np.minimum(out, np.sqrt(np.mean(moving**2, axis=1)) / share)


def background(rows: Rows, residual: np.ndarray) -> np.ndarray:
    """(channels,) rms of the running median of the residual's spectrum, N m."""
    power = np.zeros(len(residual))
    for r in range(len(rows.runs)):
        e = residual[:, rows.run == r]
        spectrum = np.abs(np.fft.rfft(e * np.hanning(e.shape[1]), axis=1)) ** 2
        middle = scipy.ndimage.median_filter(spectrum, (1, min(BACKGROUND_BINS, spectrum.shape[1])))
        share = middle.sum(axis=1) / np.log(2) / np.maximum(spectrum.sum(axis=1), 1e-300)
        power += np.minimum(share, 1.0) * np.sum(e**2, axis=1)
    return np.sqrt(power / residual.shape[1])


def white_floor(rows: Rows, torque: np.ndarray) -> np.ndarray:
    """(channels,) rms that noise as strong as just above the cut-off would leave in the rows, N m.

    `torque` (channels, N) is the model's; the median over stretches of a quarter of a second keeps reversals
    out (their pulses reach beyond the cut-off), even where a joint turns around every second. In each stretch
    the weaker of torque and residual counts: up there the model's own torque is mostly the noise of ddq.
    """
    step, cutoff = rows.fine.step, rows.filter.cutoff_hz
    low, high = 1.6 * cutoff, min(4.0 * cutoff, 0.42 / step)
    sos = scipy.signal.butter(4, (low, high), btype="bandpass", fs=1.0 / step, output="sos")
    out = np.zeros(len(torque))
    edge = max(8, int(1.0 / step))
    width = max(8, int(STRETCH_SECONDS / step))
    freedom = 2 * (high - low) * STRETCH_SECONDS  # of the power of one stretch
    median_of_mean = (1 - 2 / (9 * freedom)) ** 3  # of a chi-square (Wilson and Hilferty 1931)
    for c in range(len(torque)):
        powers: list[float] = []
        for piece in rows.fine.pieces:
            y = rows.y_fine[c, piece]
            if len(y) < 4 * edge:
                continue
            both = np.stack([y, y - torque[c, piece]])
            both = scipy.signal.sosfiltfilt(sos, both)[:, edge:-edge]
            count = both.shape[1] // width
            each = (both[:, : count * width].reshape(2, count, width) ** 2).mean(axis=2)
            powers += each.min(axis=0).tolist()
        if powers:
            out[c] = np.sqrt(np.median(powers) / median_of_mean * cutoff / (high - low))
    return out
