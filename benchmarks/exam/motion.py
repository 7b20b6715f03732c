"""Motions of the exam: random Fourier series from rest to rest, and point-to-point moves with dwells."""

from __future__ import annotations

import numpy as np


def _window(t: np.ndarray, duration: float, ramp: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A quintic rise and fall with its two derivatives."""
    w, dw, ddw = np.ones_like(t), np.zeros_like(t), np.zeros_like(t)
    for s, direction in ((t / ramp, 1.0), ((duration - t) / ramp, -1.0)):
        inside = s < 1.0
        u = np.clip(s[inside], 0.0, 1.0)
        w[inside] = u**3 * (10 - 15 * u + 6 * u**2)
        dw[inside] = direction * 30 * u**2 * (1 - u) ** 2 / ramp
        ddw[inside] = 60 * u * (1 - u) * (1 - 2 * u) / ramp**2
    return w, dw, ddw


def fourier(
    t: np.ndarray, speed: np.ndarray, reach: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, dq, ddq (N, n): harmonics of a base period of 10 to 20 s, peak speed and reach as told per joint."""
    n, duration = len(speed), float(t[-1])
    base = 1.0 / rng.uniform(10.0, 20.0)
    harmonics = int(rng.integers(5, 10))
    q, dq, ddq = (np.zeros((len(t), n)) for _ in range(3))
    window, dwindow, ddwindow = _window(t, duration, 2.0)
    for j in range(n):
        s, ds, dds = (np.zeros_like(t) for _ in range(3))
        for h in range(1, harmonics + 1):
            omega, phase = 2 * np.pi * base * h, rng.uniform(0, 2 * np.pi)
            amplitude = rng.normal() / h
            s += amplitude * np.sin(omega * t + phase)
            ds += amplitude * omega * np.cos(omega * t + phase)
            dds -= amplitude * omega**2 * np.sin(omega * t + phase)
        scale = min(speed[j] / np.abs(ds).max(), reach[j] / np.abs(s).max())
        centre = rng.uniform(-0.3, 0.3) * reach[j]
        q[:, j] = centre + scale * window * s
        dq[:, j] = scale * (window * ds + dwindow * s)
        ddq[:, j] = scale * (window * dds + 2 * dwindow * ds + ddwindow * s)
    return q, dq, ddq


def point_to_point(
    t: np.ndarray, speed: np.ndarray, reach: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, dq, ddq (N, n): quintic moves between random points, all joints together, short dwells."""
    n, duration = len(speed), float(t[-1])
    q, dq, ddq = np.zeros((len(t), n)), np.zeros((len(t), n)), np.zeros((len(t), n))
    here, now = rng.uniform(-0.5, 0.5, n) * reach, 0.5
    q[:] = here
    while now < duration - 0.5:
        goal = rng.uniform(-1, 1, n) * reach
        length = max(float(np.max(1.875 * np.abs(goal - here) / speed)), 0.8)
        if now + length > duration - 0.2:
            break
        s = (t - now) / length
        moving, after = (s >= 0) & (s < 1), s >= 1
        u, step = s[moving, None], (goal - here)[None, :]
        q[moving] = here + step * (u**3 * (10 - 15 * u + 6 * u**2))
        dq[moving] = step * 30 * u**2 * (1 - u) ** 2 / length
        ddq[moving] = step * 60 * u * (1 - u) * (1 - 2 * u) / length**2
        q[after] = goal
        here, now = goal, now + length + float(rng.choice([0.0, 0.15, 0.4]))
    return q, dq, ddq
