"""Torques of the effects that move the link away from where the motor's encoder says it is.

A motion effect gives the deflection delta = q_link - q of one joint. Only what is beyond the gear follows the
link: `link_torque` is the model of the link side (B, or A without rotor inertia and motor friction).
"""

from collections.abc import Callable

import numpy as np

from modelgen.effects.place import Model, Motion

Array = np.ndarray


def derivatives(signal: Array, dt: float) -> tuple[Array, Array]:
    """First and second time derivative (N, ...) by central differences, one-sided at the ends."""
    first = np.gradient(signal, dt, axis=0)
    second = np.empty_like(first)
    second[1:-1] = (signal[2:] - 2 * signal[1:-1] + signal[:-2]) / dt**2
    second[0], second[-1] = second[1], second[-2]
    return first, second


def displaced_torque(
    model: Model,
    motion: Motion,
    j: int,
    shift: tuple[Array, Array, Array],
    drive_follows: bool = False,
    rigid: Array | None = None,
    rotor: float = 0.0,
) -> Array:
    """(N, C) change of the model's torques when joint j moves by `shift` (x, dx, ddx), (N,) each.

    Exact for the given shift. The motor stays where its encoder says, so the rotor's inertia and the viscous
    friction before the gear do not follow, unless `drive_follows`; nor do the signs of dry friction.
    `rigid`: model.torque(motion), if known. `rotor`: inertia of the rotor that stands inside a regrouped one.
    """
    q, dq, ddq = motion.q.copy(), motion.dq.copy(), motion.ddq.copy()
    for part, by in zip((q, dq, ddq), shift):
        part[:, j] += by
    rigid = model.torque(motion) if rigid is None else rigid
    change = model.torque(motion, q, dq, ddq) - rigid
    if not drive_follows:
        _let_stay(change, model, j, shift, rotor)
    return change


def little_displaced(
    model: Model,
    motion: Motion,
    j: int,
    shift: tuple[Array, Array, Array],
    drive_follows: bool = False,
    rotor: float = 0.0,
) -> Array:
    """(N, C) `displaced_torque` of a shift (x, dx, ddx) so small that the tangent is all of it, per unit of
    it."""
    change = sum(slope * part[:, None] for slope, part in zip(model.slopes(motion, j), shift))
    if not drive_follows:
        _let_stay(np.asarray(change), model, j, shift, rotor)
    return np.asarray(change)


def _let_stay(change: Array, model: Model, j: int, shift: tuple[Array, Array, Array], rotor: float) -> None:
    """Take off what of a change (N, C) the rotor and its friction would have had."""
    friction = model.number("Fvm", j) or 0.0
    for c, channel in enumerate(model.channels):
        if channel.joint == j and channel.side != "sensor":
            change[:, c] -= friction * shift[1] + (model.drive_inertia(j) + rotor) * shift[2]


def _third_order(rate_hz: float, cutoff_hz: float) -> tuple[Array, Array]:
    """Sections (2, 6) of a Butterworth low-pass, each of gain one, and their states (2, 2) of a constant one:
    cut-offs that follow a motion are many."""
    w = np.tan(np.pi * cutoff_hz / rate_hz)
    first = np.array([w, w, 0.0, 1 + w, w - 1, 0.0]) / (1 + w)
    second = np.array([w * w, 2 * w * w, w * w, 1 + w + w * w, 2 * (w * w - 1), 1 - w + w * w])
    sections = np.stack([first, second / second[3]])
    last = sections[:, 2] - sections[:, 5]
    return sections, np.stack([sections[:, 1] - sections[:, 4] + last, last], axis=1)


def smooth(signal: Array, dt: float, sigma_s: float) -> Array:
    """Zero-phase Gaussian of standard deviation sigma_s [s]; -3 dB at about 0.13/sigma_s Hz."""
    if sigma_s <= 0.2 * dt:
        return signal
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(signal, sigma_s / dt, axis=0, mode="nearest")


def low_passed(x: Array, rate_hz: float, cutoff_hz: float) -> tuple[Array, Array, Array]:
    """x (N,) through a zero-phase third-order Butterworth, with its first and second time derivative."""
    from scipy.signal import sosfilt

    if cutoff_hz < 0.45 * rate_hz and len(x) > 12:
        sections, rest = _third_order(rate_hz, cutoff_hz)
        pad = min(len(x) - 1, int(2 * rate_hz / cutoff_hz))
        x = np.concatenate((2 * x[0] - x[pad:0:-1], x, 2 * x[-1] - x[-2 : -pad - 2 : -1]))
        for _ in range(2):  # forward, backward
            x = sosfilt(sections, x, zi=rest * x[0])[0][::-1]
        x = x[pad:-pad]
    dx = np.gradient(x, 1.0 / rate_hz) if len(x) > 1 else np.zeros_like(x)
    return x, dx, np.gradient(dx, 1.0 / rate_hz) if len(x) > 1 else np.zeros_like(x)


def gear_columns(
    model: Model,
    motion: Motion,
    j: int,
    deflect: Callable[[Array], Array],
    size: Array | None,
    cutoff_hz: float,
    rotor: float = 0.0,
) -> Array:
    """(N, C, p) torque per unit of each part of a gear's deflection x = deflect(tau) @ size.

    `deflect(tau)`: (N, p) deflections of a torque (N,) that the gear passes on. Tangents where size is 0,
    else secants one part after the other, so that columns @ size is tau(q + x) - tau(q). The torque that
    bends the gear is the one behind the deflection: x and tau are found by three turns of the fixed point,
    which converges while the shift is low-passed below the joint's own resonance. `rotor`: of its inertia,
    the part that the model holds inside a regrouped one: the gear does not carry it, and it stays with the
    motor.
    """
    passed, rigid = passed_on(model, motion, j, rotor), model.torque(motion)
    units = deflect(passed)
    size = np.zeros(units.shape[1]) if size is None else np.asarray(size, dtype=float)
    own = next((c for c, k in enumerate(model.channels) if k.joint == j), None)

    def change(parts: Array, turns: int) -> Array:
        out = np.zeros_like(rigid)
        for turn in range(turns):
            bent = units if turn == 0 or own is None else deflect(passed + out[:, own])
            shift = low_passed(bent @ parts, motion.rate_hz, cutoff_hz)
            out = displaced_torque(model, motion, j, shift, rigid=rigid, rotor=rotor)
        return out

    columns = np.zeros((*rigid.shape, len(size)))
    parts, before = np.zeros(len(size)), np.zeros_like(rigid)
    for k, value in enumerate(size):
        largest = float(np.abs(units[:, k]).max()) or 1.0
        if abs(value) * largest > 1e-9:
            parts[k] = value
            after = change(parts, 3)
            columns[:, :, k] = (after - before) / value
            before = after
        else:
            little = 1e-5 / largest  # rad: small against any curvature of gravity
            columns[:, :, k] = change(little * np.eye(len(size))[k], 1) / little
    return columns


def passed_on(model: Model, motion: Motion, j: int, rotor: float) -> Array:
    """(N,) torque that the gear carries, without that of a rotor inside a regrouped inertia."""
    return np.asarray(model.link_torque(motion)[:, j] - rotor * motion.ddq[:, j])


def below_resonance(
    model: Model, motion: Motion, j: int, compliance: float, cutoff_hz: float, rotor: float = 0.0
) -> float:
    """A cut-off [Hz] at which the fixed point of `gear_columns` converges: 0.8 of the joint's resonance.

    The resonance is 1/sqrt(compliance x link inertia), the inertia d tau_j / d ddq_j at its median.
    """
    if compliance <= 0:
        return cutoff_hz
    one, nothing = np.ones(len(motion.t)), np.zeros(len(motion.t))
    change = displaced_torque(model, motion, j, (nothing, nothing, one), rotor=rotor)
    own = [c for c, k in enumerate(model.channels) if k.joint == j]
    inertia = abs(float(np.median(change[:, own[0]]))) if own else 0.0
    if inertia <= 0:
        return cutoff_hz
    return min(cutoff_hz, 0.8 / (2 * np.pi * np.sqrt(compliance * inertia)))
