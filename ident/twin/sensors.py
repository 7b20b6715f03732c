"""What the recorder makes of the true signals: encoder steps, coloured torque noise, time stamps."""

from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class Sensors:
    """How good the recording is. Defaults: a fit of the true model errs by about one per cent per joint."""

    rate_hz: float = 1000.0
    encoder_step: float = 2 * np.pi / 2**19  # rad on the joint side
    noise_percent: float = 1.0  # of the channel's rms over the recording
    noise_floor: float = 0.01  # N m
    noise_correlation_s: float = 0.01  # of the AR(1) noise
    torque_step: float = 1e-5  # N m, resolution of what is stored
    jitter_s: float = 0.0  # standard deviation of the sampling instants


def sampling_times(duration: float, sensors: Sensors, rng: np.random.Generator) -> Array:
    """(N,) instants [s] from 0, increasing; jitter never swaps two of them."""
    t = np.arange(round(duration * sensors.rate_hz) + 1) / sensors.rate_hz
    if sensors.jitter_s > 0:
        shift = np.clip(
            rng.normal(size=len(t)) * sensors.jitter_s, -0.45 / sensors.rate_hz, 0.45 / sensors.rate_hz
        )
        t = t + shift
        t -= t[0]
    return t


def encoder(q: Array, sensors: Sensors) -> Array:
    """Positions as an encoder counts them."""
    return np.round(q / sensors.encoder_step) * sensors.encoder_step


def coloured_noise(shape: tuple[int, int], sensors: Sensors, rng: np.random.Generator) -> Array:
    """(N, channels) AR(1) noise of unit variance: e[k] = a e[k-1] + sqrt(1 - a^2) w[k], stationary."""
    from scipy.signal import lfilter  # its import takes longer than a wrong request

    a = (
        np.exp(-1.0 / (sensors.rate_hz * sensors.noise_correlation_s))
        if sensors.noise_correlation_s > 0
        else 0.0
    )
    w = rng.normal(size=shape)
    w[1:] *= np.sqrt(1.0 - a * a)
    return lfilter([1.0], [1.0, -a], w, axis=0)


def noise_level(true: Array, sensors: Sensors) -> Array:
    """(channels,) standard deviation of the torque noise [N m]."""
    return np.maximum(np.sqrt(np.mean(true**2, axis=0)) * sensors.noise_percent / 100.0, sensors.noise_floor)


def measured(true: Array, noise: Array, level: Array, sensors: Sensors) -> Array:
    """Torque as it is stored: true plus noise, rounded to the recorder's resolution."""
    return np.round((true + noise * level) / sensors.torque_step) * sensors.torque_step
