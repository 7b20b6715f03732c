"""Torques of the effects that move the link away from where the motor's encoder says it is.

A motion effect gives the deflection delta = q_link - q of one joint. Only what is beyond the gear follows the
link: `link_torque` is the model of the link side (B, or A without rotor inertia and motor friction).
"""

from collections.abc import Callable

import numpy as np

Array = np.ndarray
TorqueModel = Callable[[Array, Array, Array], Array]  # (q, dq, ddq) each (N, n) -> (N, channels)


def derivatives(signal: Array, dt: float) -> tuple[Array, Array]:
    """First and second time derivative (N, ...) by central differences, one-sided at the ends."""
    first = np.gradient(signal, dt, axis=0)
    second = np.empty_like(first)
    second[1:-1] = (signal[2:] - 2 * signal[1:-1] + signal[:-2]) / dt**2
    second[0], second[-1] = second[1], second[-2]
    return first, second


def moved_torque(
    link_torque: TorqueModel, q: Array, dq: Array, ddq: Array, joint: int, deflection: Array, dt: float
) -> Array:
    """(N, channels) change of the link-side torque when link `joint` (from 0) moves by `deflection` (N,).

    Exact for the given deflection; its rate and acceleration count too, so it has to be smooth
    (low-passed like the positions). Every joint of the arm feels it, not only `joint`.
    """
    rate, acceleration = derivatives(deflection, dt)
    q_link, dq_link, ddq_link = q.copy(), dq.copy(), ddq.copy()
    q_link[:, joint] += deflection
    dq_link[:, joint] += rate
    ddq_link[:, joint] += acceleration
    return link_torque(q_link, dq_link, ddq_link) - link_torque(q, dq, ddq)


def motion_column(
    link_torque: TorqueModel, q: Array, dq: Array, ddq: Array, joint: int, unit: Array, dt: float, size: float
) -> Array:
    """(N, channels) first-order column d tau / d p of a motion effect, deflection = p * unit.

    By central differences of the model at p = +-size, so `size` is about the parameter's expected value.
    """
    up = moved_torque(link_torque, q, dq, ddq, joint, size * unit, dt)
    down = moved_torque(link_torque, q, dq, ddq, joint, -size * unit, dt)
    return (up - down) / (2.0 * size)
