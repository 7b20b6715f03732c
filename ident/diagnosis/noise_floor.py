"""Noise floor of each channel from the band above the rows' cut-off: an upper bound, friction reversals
reach there."""

import numpy as np
import scipy.signal

from ident.diagnosis.rows import Rows


def noise_floor(rows: Rows, torque: np.ndarray) -> np.ndarray:
    """(channels,) rms that noise as strong as just above the cut-off would leave in the rows, N m.

    `torque` (channels, N) is the model's; the median over stretches of 1 s keeps single reversals out.
    """
    step, cutoff = rows.fine.step, rows.filter.cutoff_hz
    low, high = 1.6 * cutoff, min(4.0 * cutoff, 0.42 / step)
    sos = scipy.signal.butter(4, (low, high), btype="bandpass", fs=1.0 / step, output="sos")
    out = np.zeros(len(torque))
    width = max(8, int(1.0 / step))
    for c in range(len(torque)):
        powers = []
        for piece in rows.fine.pieces:
            e = rows.y_fine[c, piece] - torque[c, piece]
            if len(e) < 4 * width:
                continue
            e = scipy.signal.sosfiltfilt(sos, e)[width:-width]
            count = len(e) // width
            powers += list((e[: count * width].reshape(count, width) ** 2).mean(axis=1))
        if powers:
            out[c] = np.sqrt(np.median(powers) * cutoff / (high - low))
    return out
