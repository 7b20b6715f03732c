"""An effect put somewhere (joint, channels, run, window) and the columns it makes at the kept instants.

Columns that depend on the model's own torque (gain, delay, elasticity, tilt, load) use the current
estimate: they are secants, exact at the estimate itself, and are recomputed until the estimate no longer
moves.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.signal

from ident.diagnosis.model_view import INERTIAL, ModelView, split_name
from ident.diagnosis.rows import Rows
from ident.diagnosis.scoring import Columns
from modelgen.effects import Effect
from modelgen.effects.effect import NonlinearParameter
from modelgen.effects.frames import frames
from modelgen.effects.loads import force_columns, tilt_columns

SHIFT_CUTOFF_HZ = 3.0
NEAR_RESONANCE = 3.0  # times that cut-off
BELOW_RESONANCE = 0.8
GENTLEST = 0.79  # exponent of a power law


@dataclass(frozen=True)
class Term:
    """One effect at one place with its nonlinear parameters."""

    effect: Effect
    joint: int | None  # 0-based
    channels: tuple[int, ...]
    terms: tuple[str, ...]  # names of the linear parameters in use
    theta: Mapping[str, float] = field(default_factory=dict)
    source: int | None = None
    run: int | None = None
    window: tuple[float, float] | None = None  # s since the start of the run; None: the whole run

    @property
    def key(self) -> tuple:
        """Identity without parameters."""
        return (self.effect.name, self.joint, self.channels, self.source, self.run)

    def at(self, **theta: float) -> "Term":
        return replace(self, theta={**self.theta, **theta})

    @property
    def free(self) -> tuple[NonlinearParameter, ...]:
        """Nonlinear parameters with a value of their own: the travel through a gap that passes all torque on
        is the gap itself, a contact is at the origin of the last frame unless it was moved, and a power law
        at the upper end of its exponents is the gentlest bend that differs from viscous friction."""
        if self.effect.name == "backlash" and "drop" not in self.terms:
            return ()
        if self.effect.name == "external_force" and not self.theta:
            return ()
        if self.effect.name == "base_tilt":  # here its angles are coefficients
            return ()
        if self.effect.name == "power_law_friction" and self.theta.get("p", 0.0) > GENTLEST:
            return ()
        return self.effect.nonlinear


@dataclass
class Context:
    """What columns are made from: signals, the model at its current estimate, and what was found so far."""

    rows: Rows
    view: ModelView
    chi: np.ndarray  # (b,) current model parameters
    torque: np.ndarray  # (channels, N) current predicted torque, found terms included
    tau_link: np.ndarray  # (n, N)
    size: Mapping[tuple, np.ndarray] = field(
        default_factory=dict
    )  # last coefficients of measurement/motion terms
    cache: dict = field(default_factory=dict)

    def signals(self, term: Term) -> dict[str, np.ndarray]:
        """What the columns of a term are made of, (N,) each."""
        fine, joint, source = self.rows.fine, term.joint, term.source
        out = {"t": fine.t}
        if joint is not None:
            out |= {
                "q": fine.q[:, joint],
                "dq": fine.dq[:, joint],
                "ddq": fine.ddq[:, joint],
                "sign_dq": fine.sign[:, joint],
                "tau_link": self.tau_link[joint],
            }
            if any(self.view.channels[c].startswith("tau_l") for c in term.channels):
                out["tau_link"] = passed_on(self, joint)  # a sensor must not explain itself
        if source is not None:
            total = fine.dq[:, joint] + fine.dq[:, source]
            out |= {
                "dq_source": fine.dq[:, source],
                "ddq_source": fine.ddq[:, source],
                "sign_sum": np.tanh(total / max(fine.sign_width[joint], fine.sign_width[source])),
            }
        return out

    def gate(self, term: Term) -> np.ndarray:
        """(N,) 1 inside the run and window of the term."""
        fine = self.rows.fine
        inside = np.ones(len(fine.t), dtype=bool) if term.run is None else fine.run == term.run
        if term.window is not None:
            inside &= (fine.t >= term.window[0]) & (fine.t < term.window[1])
        return inside.astype(float)


def state_values(effect: Effect, q: np.ndarray, theta: Mapping[str, float], pieces) -> np.ndarray:
    """(N,) state of the effect, integrated piece by piece."""
    assert effect.state is not None
    z = np.empty(len(q))
    for piece in pieces:
        z[piece] = effect.state.integrate(q[piece], theta, effect.state.initial)
    return z


def fine_columns(term: Term, context: Context) -> np.ndarray:
    """(N, p) columns of a `column` or `motion` term at the fine rate."""
    effect = term.effect
    signals = context.signals(term)
    if effect.state is not None:
        theta = effect.complete(term.theta)
        signals["z"] = state_values(effect, signals["q"], theta, context.rows.fine.pieces)
    needed = {k: v for k, v in signals.items() if k in effect.needs}
    values = effect.numpy_columns({**needed, "t": signals["t"]}, term.theta)
    pick = [effect.linear_names.index(name) for name in term.terms]
    return values[:, pick]


def columns(term: Term, context: Context) -> Columns:
    """{channel: (M, p)} of any kind of term, filtered as the torque is."""
    kind = term.effect.kind
    if kind == "column":
        filtered = context.rows.low_pass @ fine_columns(term, context)
        return dict.fromkeys(term.channels, filtered)
    if kind == "measurement":
        return _measurement(term, context)
    if kind == "motion":
        return _motion(term, context)
    fine = load_columns(term, context)
    gate = context.gate(term)[:, None]
    p = next(iter(fine.values())).shape[1]
    filtered = context.rows.low_pass @ (np.hstack(list(fine.values())) * gate)
    return {c: filtered[:, i * p : (i + 1) * p] for i, c in enumerate(fine)}


def _size(term: Term, context: Context) -> float:
    value = context.size.get(term.key)
    return float(value[0]) if value is not None else 0.0


def _measurement(term: Term, context: Context) -> Columns:
    name = term.effect.name
    out: Columns = {}
    for c in term.channels:
        if name == "drive_gain_error":
            out[c] = context.rows.low_pass @ context.torque[c][:, None]
        elif name == "sensor_crosstalk":
            assert term.joint is not None and term.source is not None
            source = c - term.joint + term.source
            out[c] = context.rows.low_pass @ context.torque[source][:, None]
    if name == "time_delay":  # secant of the exact shift, the derivative at zero
        delay = _size(term, context)
        step = delay if abs(delay) > 1e-5 else 1e-4
        torque = context.torque[list(term.channels)].T
        change = (context.rows.filter.matrix(step) @ torque - context.rows.low_pass @ torque) / step
        out = {c: change[:, [i]] for i, c in enumerate(term.channels)}
    return out


def smooth(x: np.ndarray, pieces, step: float, cutoff_hz: float) -> np.ndarray:
    """Zero-phase low-pass of (N,) piece by piece."""
    out = np.empty_like(x)
    sos = scipy.signal.butter(3, cutoff_hz, fs=1.0 / step, output="sos")
    for piece in pieces:
        part = x[piece]
        out[piece] = scipy.signal.sosfiltfilt(sos, part, padlen=min(len(part) - 1, int(2 / cutoff_hz / step)))
    return out


def _motion(term: Term, context: Context) -> Columns:
    """Rigid torque changed by the link's shift x: linear in x at first, the secant [tau(q + s x) -
    tau(q)]/s later."""
    if term.effect.name != "joint_elasticity":
        return _slack(term, context)
    fine, view = context.rows.fine, context.view
    size, cutoff = _size(term, context), SHIFT_CUTOFF_HZ
    j = term.joint
    assert j is not None
    own, drive = view.joint_of.index(j), view.drive_inertia(j)  # the drive does not follow the link
    by_q, by_dq, by_ddq = _sensitivity(context, j)
    friction = view.link_friction(context.chi, j)
    square = size * abs(float(np.median(by_ddq[own])))  # one over the resonance's rate squared
    bent = _measured_bending(j, square, context)
    if bent is None and square > 0:
        cutoff = min(cutoff, BELOW_RESONANCE / (2 * np.pi * np.sqrt(square)))
    shift = fine_columns(term, context)[:, 0] - friction if bent is None else bent
    if abs(size) < 1e-9:
        x, dx, ddx = _with_rates(shift, fine, cutoff)
        change = by_q * x + by_dq * dx + by_ddq * ddx
        change[own] -= drive * ddx
    else:
        rigid = _rigid(context).copy()
        rigid[own] -= drive * fine.ddq[:, j]
        moved = rigid
        turns = 3 if bent is None else 1
        for turn in range(turns):
            x, dx, ddx = _with_rates(size * shift, fine, cutoff)
            q, dq, ddq = fine.q.copy(), fine.dq.copy(), fine.ddq.copy()
            q[:, j] += x
            dq[:, j] += dx
            ddq[:, j] += ddx
            moved = view.shifted_torque(q, dq, ddq, context.chi)
            moved[own] -= drive * ddq[:, j]
            if turn + 1 < turns:
                shift = -(moved[own] + friction)
        change = (moved - rigid) / size
        lag = _link_friction_change(context, j, dx) / size
        for c, joint in enumerate(view.joint_of):
            if joint == j:
                change[c] += lag
    filtered = context.rows.low_pass @ change.T
    return {c: filtered[:, [c]] for c in range(len(view.channels))}


def _measured_bending(j: int, square: float, context: Context) -> np.ndarray | None:
    """(N,) minus the sensor's torque, which bends the joint, where the model's is of no use: its iteration
    diverges above the resonance, 1/sqrt(`square`) rad/s (0: none yet). None: no sensor, or a joint stiff
    enough for the model, which has no noise."""
    sensor = f"tau_l{j + 1}"
    stiff = square < (2 * np.pi * NEAR_RESONANCE * SHIFT_CUTOFF_HZ) ** -2
    if sensor not in context.view.channels or stiff:
        return None
    return -context.rows.y_fine[context.view.channels.index(sensor)]


def _link_friction_change(context: Context, j: int, dx: np.ndarray) -> np.ndarray:
    """(N,) what friction behind the gear changes when it follows the link's rate dq + dx."""
    fine, view = context.rows.fine, context.view
    viscous, dry = (view.number((kind,), j) for kind in ("Fvl", "Fcl"))
    out = np.zeros(len(dx))
    if viscous is not None:
        out += context.chi[viscous] * dx
    if dry is not None:
        width, dq = fine.sign_width[j], fine.dq[:, j]
        out += context.chi[dry] * (np.tanh((dq + dx) / width) - np.tanh(dq / width))
    return out


def _slack(term: Term, context: Context) -> Columns:
    """Backlash: the position torques of the shifted link (its impacts are too short for the rows), and, for
    terms with "drop", the torque of the joint that is not passed on while the motor crosses the gap."""
    j = term.joint
    assert j is not None
    travel = term.effect.complete(term.theta)["travel"]
    parts = [_shifted(term, context, travel)] if "gap" in term.terms else []
    if "drop" in term.terms:
        crossing = 1.0 - np.clip(5.0 * np.abs(_place_in_gap(term, context, travel)) - 4.0, 0.0, 1.0)
        lost = context.rows.low_pass @ (-passed_on(context, j) * crossing)  # a sensor's has dropped already
        own = np.array([joint == j for joint in context.view.joint_of])
        parts.append(np.where(own, lost[:, None], 0.0))
    return {c: np.stack([part[:, c] for part in parts], axis=1) for c in range(len(context.view.channels))}


def _place_in_gap(term: Term, context: Context, travel: float) -> np.ndarray:
    """(N,) state of the play; those of the grid are kept, every step searches them."""
    key, kept = ("play", term.joint, travel), travel in term.effect.nonlinear[0].grid
    if kept and key in context.cache:
        return context.cache[key]
    fine = context.rows.fine
    z = state_values(term.effect, fine.q[:, term.joint], {"travel": travel}, fine.pieces)
    if kept:
        context.cache[key] = z
    return z


def _shifted(term: Term, context: Context, travel: float) -> np.ndarray:
    """(M, channels) filtered position torques per rad of gap; those of the grid are kept."""
    key, kept = ("shifted", term.joint, travel), travel in term.effect.nonlinear[0].grid
    if kept and key in context.cache:
        return context.cache[key]
    assert term.joint is not None
    by_q = _sensitivity(context, term.joint)[0]
    out = context.rows.low_pass @ (-0.5 * by_q * _place_in_gap(term, context, travel)).T
    if kept:
        context.cache[key] = out
    return out


def passed_on(context: Context, j: int) -> np.ndarray:
    """(N,) rigid torque of the model that the gear of a joint passes on to its link."""
    key = ("passed", j)
    if key not in context.cache:
        drive = context.view.drive_inertia(j) * context.rows.fine.ddq[:, j]
        context.cache[key] = context.view.link_torque(context.chi, j) - drive
    return context.cache[key]


def _with_rates(x: np.ndarray, fine, cutoff_hz: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Low-passed x with its first and second time derivative, piece by piece."""
    x = smooth(x, fine.pieces, fine.step, cutoff_hz)
    dx, ddx = np.empty_like(x), np.empty_like(x)
    for piece in fine.pieces:
        dx[piece] = np.gradient(x[piece], fine.step)
        ddx[piece] = np.gradient(dx[piece], fine.step)
    return x, dx, ddx


def _rigid(context: Context) -> np.ndarray:
    key = ("rigid",)
    if key not in context.cache:
        fine = context.rows.fine
        context.cache[key] = context.view.shifted_torque(fine.q, fine.dq, fine.ddq, context.chi)
    return context.cache[key]


def _sensitivity(context: Context, j: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """d tau/d q_j, d tau/d dq_j, d tau/d ddq_j, each (channels, N), by one-sided differences."""
    key = ("sensitivity", j)
    if key not in context.cache:
        fine = context.rows.fine
        parts = []
        for which, h in ((0, 1e-5), (1, 1e-4), (2, 1.0)):
            motion = [fine.q, fine.dq, fine.ddq]
            motion[which] = motion[which].copy()
            motion[which][:, j] += h
            parts.append(
                (context.view.shifted_torque(motion[0], motion[1], motion[2], context.chi) - _rigid(context))
                / h
            )
        context.cache[key] = (parts[0], parts[1], parts[2])
    return context.cache[key]


def load_columns(term: Term, context: Context) -> Columns:
    """{channel: (N, p)} of a load before its gate: unit body on the last link, unit wrench, unit tilt of
    gravity."""
    view = context.view
    name = term.effect.name
    if name == "payload_change":
        key = ("payload",)
        if key not in context.cache:
            context.cache[key] = _payload_columns(view)
        pick = [INERTIAL.index(k) for k in term.terms]
        return {c: x[:, pick] for c, x in context.cache[key].items()}
    if name == "external_force":
        wrench = _wrench_columns(term, context)
        pick = [("FX", "FY", "FZ", "NX", "NY", "NZ").index(k) for k in term.terms]
        return {c: wrench[:, view.joint_of[c]][:, pick] for c in range(len(view.channels))}
    return _tilt_columns(term, context)


def _wrench_columns(term: Term, context: Context) -> np.ndarray:
    """(N, n, 6); those at the origin of the last frame, which every step searches, are kept."""
    view, q = context.view, context.rows.fine.q
    if term.free:
        theta = term.effect.complete(term.theta)
        return force_columns(view.robot, q, view.payload_row, (theta["px"], theta["py"], theta["pz"]))
    key = ("wrench",)
    if key not in context.cache:
        context.cache[key] = force_columns(view.robot, q, view.payload_row)
    return context.cache[key]


def _payload_columns(view: ModelView) -> Columns:
    """{channel: (N, 10)}; the model's columns times what a body on the last link adds to its parameters."""
    selected = view.payload_map[view.kept]
    padded = np.zeros((len(view.parameters), selected.shape[1]))
    padded[: len(selected)] = selected
    return {c: values @ padded[index] for c, (index, values) in enumerate(view.entries)}


def _tilt_columns(term: Term, context: Context) -> Columns:
    """Derivative of the gravity torque by roll and pitch, and (names beyond these) what joint 1 did not
    show before."""
    view, fine = context.view, context.rows.fine
    bodies: dict[str, float] = {}
    for name, value in zip(view.parameters, context.chi):
        kind, row = split_name(name)
        if kind in ("MX", "MY", "MZ", "M"):
            bodies[f"{kind}{row}"] = float(value)
    key = ("arm",)
    if key not in context.cache:
        context.cache[key] = frames(view.robot, fine.q)
    tilt = tilt_columns(view.robot, fine.q, bodies, context.cache[key])
    parts = [tilt[:, :, ("roll", "pitch").index(name)] for name in term.terms]
    out = {}
    for c in range(len(view.channels)):
        columns = [p[:, view.joint_of[c]] for p in parts]
        own = view.joint_of[c] == 0
        columns += [np.cos(fine.q[:, 0]) * own, np.sin(fine.q[:, 0]) * own]  # moments that g did not show
        out[c] = np.stack(columns, axis=1)
    return out
