"""How dry friction changes its sign: within a rate and within a travel of presliding.

    sign(dq) ~ z |tanh(dq / rate)|,   dz/dq = (1 - z sign dq) / travel   (Dahl, TOR-0158(3107-18)-1, 1968)

Both widths 0: the plain sign; the rate alone 0: z itself, which does not fall where the joint stops for a
moment to turn. A recorded torque is the mean over the cycle of its drive, or, as a simulator has it, what it
is at the instant. A mean takes the rate as linear about a sample and the sign over `CYCLE_S`, or over the
step to the next sample where that is shorter, so that a reversal between two samples moves the sign by its
own share. (Of samples 50 ms apart the mean over a step is another curve than what was sampled: a robot
without a fault had structure in the rate of every joint. Of samples of the instant, 5 ms apart, taken as
means, a friction that changed at once was told to give way for 0.3 mrad.)"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CYCLE_S = 0.005  # s: of a drive's current, at most; the step of the finest signals that are looked at
LN2 = float(np.log(2.0))
NONE = -40.0  # exponent of what is nothing beside LN2; far smaller ones are slow to compute


@dataclass(frozen=True, slots=True)
class TurnOver:
    """rate in rad/s, travel in rad (m/s, m of a joint that slides); 0: at once. instant: of a torque that is
    recorded as it is at the sample, no mean over a cycle."""

    rate: float = 0.0
    travel: float = 0.0
    instant: bool = False

    def sign(self, q: np.ndarray, dq: np.ndarray, hz: float, state: float | None = None) -> np.ndarray:
        """(N,) smoothed sign along one stretch or block of hz samples a second; state: z before its first
        one, None: slid in."""
        return self.followed(q, dq, hz, state)[0]

    def followed(
        self, q: np.ndarray, dq: np.ndarray, hz: float, state: float | None = None
    ) -> tuple[np.ndarray, float | None]:
        """The same, and z behind the last sample, None where it has none."""
        if self.travel <= 0 or not len(q):
            return self.direct(dq, hz), state
        z = self.state(q, dq, hz, state)
        return z if self.rate <= 0 else slid(z, self.direct(dq, hz)), float(z[-1])

    def direct(self, dq: np.ndarray, hz: float) -> np.ndarray:
        """(N,) what goes with the rate alone."""
        return sign_within(dq, self.rate) if self.instant else mean_sign(dq, self.rate, hz)

    def state(self, q: np.ndarray, dq: np.ndarray, hz: float, state: float | None = None) -> np.ndarray:
        """(N,) z of the presliding, along a path that turns where its rate is zero, not at the sample behind:
        that is half a sample late (and at 200 Hz, of a dry friction of 2.5 N m, a hysteresis of 0.04)."""
        from modelgen.effects.states import integrate_dahl  # not at the top: SymPy, which few fits need

        first = float(np.sign(dq[0])) if state is None else state
        path, own = with_turns(q, dq, hz)
        return integrate_dahl(path, {"width": self.travel}, first)[own]


def with_turns(q: np.ndarray, dq: np.ndarray, hz: float) -> tuple[np.ndarray, np.ndarray]:
    """(N + turns,) q with the places where a rate that is linear between two samples is zero; (N,) where its
    own samples are."""
    before = np.flatnonzero(dq[1:] * dq[:-1] < 0)
    turns = q[before] + dq[before] ** 2 / (2 * hz * (dq[before] - dq[before + 1]))
    every = np.arange(len(q))
    return np.insert(q, before + 1, turns), every + np.searchsorted(before, every)


def slid(state: np.ndarray, direct: np.ndarray) -> np.ndarray:
    """(N,) sign of friction that gives way before it slips: how far it has slid in, times how fast."""
    return np.asarray(state * np.abs(direct))


def sign_within(dq: np.ndarray, rate: float) -> np.ndarray:
    """(N,) tanh(dq / rate), the plain sign where it is 0."""
    return np.asarray(np.tanh(dq / rate) if rate > 0 else np.sign(dq))


def mean_sign(dq: np.ndarray, rate: float, hz: float) -> np.ndarray:
    """(N,) mean of tanh(dq / rate) over a drive's cycle about each sample, dq (N,) linear inside it."""
    if len(dq) < 2:
        return sign_within(dq, rate)
    half = 0.5 * min(CYCLE_S * hz, 1.0) * np.gradient(dq)
    a, b = dq - half, dq + half
    gap = b - a
    wide = np.abs(gap) > 1e-9 * (np.abs(a) + np.abs(b)) + 1e-300
    if wide.all():
        return np.asarray((_primitive(b, rate) - _primitive(a, rate)) / gap)
    mean = (_primitive(b, rate) - _primitive(a, rate)) / np.where(wide, gap, 1.0)
    return np.asarray(np.where(wide, mean, sign_within(dq, rate)))


def _primitive(x: np.ndarray, rate: float) -> np.ndarray:
    """Of tanh(x / rate): rate ln cosh(x / rate); |x| where rate is 0."""
    size = np.abs(x)
    if rate <= 0:
        return size
    return np.asarray(size + rate * (np.log1p(np.exp(np.maximum(-2 * size / rate, NONE))) - LN2))
