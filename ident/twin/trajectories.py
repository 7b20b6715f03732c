"""Motions that excite a robot, as functions of time: point to point as in the paper, and Fourier series.

A motion is exact at any instant (position, rate and acceleration are formulas), so the twin can look at it at
1 kHz and at 25 Hz alike. Each begins and ends at rest. rad and s, or m of a prismatic joint.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modelgen.geometry.robot import Robot

Array = np.ndarray
State = tuple[Array, Array, Array]  # q, dq, ddq, each (N, n)


@dataclass(frozen=True, slots=True)
class Motion:
    """A planned motion of all joints; `at(t)` gives (q, dq, ddq), each (N, n)."""

    kind: str
    duration: float
    at: Callable[[Array], State]


@dataclass(frozen=True, slots=True)
class Reach:
    """How far and how fast each joint goes: centre, half range, peak rate and acceleration, (n,) each."""

    centre: Array
    half: Array
    rate: Array
    acceleration: Array


def reach(robot: Robot) -> Reach:
    """Nine tenths of the range of the robot file, six tenths of its rates but no more than 2 rad/s.

    Where the file states no limits: +-2.4 rad or +-0.3 m, 1.5 rad/s or 0.5 m/s. At most 8 rad/s^2.
    """
    centre, half, rate, acceleration = [], [], [], []
    for row in robot.moving:
        link = robot.link(row)
        limits = link.limits
        wide, fast, hard = (2.4, 1.5, 8.0) if link.sigma == 0 else (0.3, 0.5, 3.0)
        low, high = limits.q if limits and limits.q else (-wide / 0.9, wide / 0.9)
        centre.append((low + high) / 2)
        half.append(min(0.9 * (high - low) / 2, wide if link.sigma == 0 else np.inf))
        rate.append(min(0.6 * limits.dq, 2.0) if limits and limits.dq else fast)
        acceleration.append(min(limits.ddq, hard) if limits and limits.ddq else hard)
    return Reach(np.array(centre), np.array(half), np.array(rate), np.array(acceleration))


def point_to_point(
    space: Reach, points: int, duration: float, rng: np.random.Generator, dwell: float = 0.1
) -> Motion:
    """Start, `points` random points and stop, joined by moves of trapezoidal acceleration (paper, 4.B).

    All moves take the same time and all joints move together; 44 points in 90 s is 2 s a move. A move is as
    long as the rates and accelerations of `space` allow.
    """
    moves = points + 1
    T = duration / moves - dwell
    if T <= 0.2:
        raise ValueError(f"{points} points do not fit into {duration:g} s")
    profile = TrapezoidalAcceleration()
    longest = np.minimum(
        space.rate * T / profile.peak_rate, space.acceleration * T**2 / profile.peak_acceleration
    )
    places = [space.centre.copy()]
    for _ in range(points):
        aim = space.centre + space.half * rng.uniform(-1.0, 1.0, len(space.half))
        places.append(places[-1] + np.clip(aim - places[-1], -longest, longest))
    places.append(places[-1] + np.clip(space.centre - places[-1], -longest, longest))
    q_of = np.array(places)

    def at(t: Array) -> State:
        t = np.asarray(t, dtype=float)
        move = np.clip((t // (T + dwell)).astype(int), 0, moves - 1)
        s, ds, dds = profile(np.clip((t - move * (T + dwell)) / T, 0.0, 1.0))
        start, step = q_of[move], q_of[move + 1] - q_of[move]
        return start + step * s[:, None], step * ds[:, None] / T, step * dds[:, None] / T**2

    return Motion("point_to_point", duration, at)


class TrapezoidalAcceleration:
    """A rest-to-rest move of unit length in unit time: jerk +, 0, -, cruise, -, 0, +.

    Acceleration is a trapezoid over the first `accelerating` of the time and mirrored over the last; `ramp`
    is the share of each trapezoid's flank in it.
    """

    def __init__(self, accelerating: float = 0.4, ramp: float = 0.25) -> None:
        flank = accelerating * ramp
        spans = np.array([flank, accelerating - 2 * flank, flank, 1 - 2 * accelerating])
        self.spans = np.concatenate([spans, spans[:3]])
        jerk = np.array([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0])
        knots = np.zeros((len(jerk) + 1, 3))  # s, ds, dds at the start of each span
        for i, (span, j) in enumerate(zip(self.spans, jerk)):
            s, v, a = knots[i]
            knots[i + 1] = (
                s + v * span + a * span**2 / 2 + j * span**3 / 6,
                v + a * span + j * span**2 / 2,
                a + j * span,
            )
        length = knots[-1, 0]
        self.knots, self.jerk = knots / length, jerk / length
        self.starts = np.concatenate(([0.0], np.cumsum(self.spans)[:-1]))
        self.peak_rate = float(self.knots[:, 1].max())
        self.peak_acceleration = float(np.abs(self.knots[:, 2]).max())

    def __call__(self, x: Array) -> State:
        """s, ds/dx, d2s/dx2 at x in [0, 1]; exactly at rest at both ends."""
        i = np.clip(np.searchsorted(self.starts, x, side="right") - 1, 0, len(self.jerk) - 1)
        h, j = x - self.starts[i], self.jerk[i]
        s0, v0, a0 = self.knots[i].T
        s = s0 + v0 * h + a0 * h**2 / 2 + j * h**3 / 6
        v = np.maximum(v0 + a0 * h + j * h**2 / 2, 0.0)  # no rounding at its end turns a move round
        a = a0 + j * h
        ended = (x <= 0.0) | (x >= 1.0)
        return np.where(x >= 1.0, 1.0, s), np.where(ended, 0.0, v), np.where(ended, 0.0, a)


def fourier(
    space: Reach, duration: float, rng: np.random.Generator, harmonics: int = 7, base_hz: float = 0.05
) -> Motion:
    """A random Fourier series per joint (Swevers et al., IEEE T-RA 13(5), 1997), faded in and out over 2 s.

    Every joint gets its own amplitudes and phases, scaled until it just meets a limit of `space`.
    """
    n = len(space.half)
    w = 2 * np.pi * base_hz * np.arange(1, harmonics + 1)
    amplitude = rng.normal(size=(n, harmonics)) / np.sqrt(np.arange(1, harmonics + 1))
    phase = rng.uniform(0, 2 * np.pi, (n, harmonics))
    rest, fade = 0.5, 2.0

    def series(t: Array) -> State:
        angle = t[:, None, None] * w + phase
        return (
            np.einsum("nij,ij->ni", np.sin(angle), amplitude),
            np.einsum("nij,ij->ni", np.cos(angle), amplitude * w),
            -np.einsum("nij,ij->ni", np.sin(angle), amplitude * w**2),
        )

    def window(t: Array) -> State:
        """1 in the middle, smooth to the third derivative down to 0 at both ends."""
        early = t < duration / 2
        x = np.clip((np.where(early, t, duration - t) - rest) / fade, 0.0, 1.0)
        sign = np.where(early, 1.0, -1.0)
        value = x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3)
        rate = sign * 140 * x**3 * (1 - x) ** 3 / fade
        return value, rate, 420 * x**2 * (1 - x) ** 2 * (1 - 2 * x) / fade**2

    def faded(t: Array) -> State:
        f, df, ddf = series(t)
        g, dg, ddg = (v[:, None] for v in window(t))
        return f * g, df * g + f * dg, ddf * g + 2 * df * dg + f * ddg

    q, dq, ddq = faded(np.arange(0.0, duration, 0.01))
    scale = np.min(
        [
            space.half / np.abs(q).max(0),
            space.rate / np.abs(dq).max(0),
            space.acceleration / np.abs(ddq).max(0),
        ],
        axis=0,
    )

    def at(t: Array) -> State:
        f, df, ddf = faded(np.asarray(t, dtype=float))
        return space.centre + scale * f, scale * df, scale * ddf

    return Motion("fourier", duration, at)
