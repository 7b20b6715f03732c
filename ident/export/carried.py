"""What a model file cannot hold: how large each term of the fit is, and what leaving it out costs.

A URDF has bodies, viscous damping and dry friction, an MJCF rotor inertia (armature) besides; neither has
offsets, coupled drives, a sensor's own inertia or what `effects:` added, but an MJCF holds the delay of a
motor's torque. Sizes and errors come from the
triangular factors of the validate runs (identify where there are none), over the rows that count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ident.export.consistent import Consistent
from ident.export.saved import SavedFit, TextTable
from modelgen.geometry.names import INERTIAL

if TYPE_CHECKING:
    from ident.equations.terms import Term

KINDS = {
    "offset": ("Offm", "Offl"),
    "rotor inertia": ("Iam",),
    "coupled drives": ("Iac", "Fvc", "Fcc"),
    "inertia beyond the sensor": ("Ial",),
    "dry friction": ("Fcm", "Fcl"),
    "viscous friction": ("Fvm", "Fvl"),
}
HOLDS = {
    "urdf": ("dry friction", "viscous friction"),
    "mjcf": ("dry friction", "viscous friction", "rotor inertia"),
}


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A term that a file does not hold: rms in N m [N] where it is largest, errors in percent."""

    term: str
    channel: str
    rms: float
    error_with: float  # of the role, all channels
    error_without: float


def role_of(fit: SavedFit) -> str:
    return "validate" if "validate" in fit.factors else "identify"


def delays(fit: SavedFit) -> dict[int, float]:
    """{joint from 0: s} that its motor torque is recorded after the position; negative: before it."""
    out: dict[int, float] = {}
    for term in fit.terms:
        if _is_delay(fit, term):
            for channel in term.place.rows(fit.columns.need.channels):
                joint = fit.columns.need.channels[channel].joint
                out[joint] = out.get(joint, 0.0) + float(term.size[0])
    return {joint: delay for joint, delay in out.items() if delay}


def _is_delay(fit: SavedFit, term: Term) -> bool:
    """Whether all that a term does is to shift motor torques in time."""
    channels = fit.columns.need.channels
    motors = all(channels[c].side == "motor" for c in term.place.rows(channels))
    return motors and term.place.recording is None and term.effect.stages(term.place) == ("delay",)


def left_out(fit: SavedFit, found: Consistent, form: str) -> tuple[LeftOut, ...]:
    """Largest first; `form` is "urdf" or "mjcf". A payload's parameters are not the robot's and stay out."""
    role = role_of(fit)
    with_all = fit.error_percent(found.chi, role)["total"]
    held = {*HOLDS[form], *(term.label for term in fit.terms if form == "mjcf" and _is_delay(fit, term))}
    out = []
    for term, part in parts(fit, found).items():
        if term in held or not part.any():
            continue
        rms = np.array(
            [_rms(factor.R[:, :-1] @ part[factor.columns], factor.rows) for factor in fit.factors[role]]
        )
        worst = int(np.argmax(rms))
        without = fit.error_percent(found.chi - part, role)["total"]
        out.append(LeftOut(term, fit.columns.channels[worst], float(rms[worst]), with_all, without))
    return tuple(sorted(out, key=lambda item: -item.rms))


def _rms(torque: np.ndarray, rows: int) -> float:
    return float(np.sqrt(np.sum(torque**2) / max(rows, 1)))


def parts(fit: SavedFit, found: Consistent) -> dict[str, np.ndarray]:
    """{term: its share (b,) of chi}: chi less all of them are the bodies. Of an effect, its sizes: its torque
    is their columns' where it is linear in them, whatever its shape parameters."""
    c = found.combination
    sizes = {f"{term.label}.{name}": term.label for term in fit.terms for name in term.unknown}
    shapes = {f"{term.label}.{name}" for term in fit.terms for name in term.free}
    payloads = {f"{kind}{label}{r}" for label in fit.study.payloads for kind in INERTIAL for r in ("", "R")}
    gains = {fit.columns.parameters[k] for k in fit.columns.gain_columns.values()}
    out: dict[str, np.ndarray] = {}
    for k in range(10 * c.links, len(c.names)):
        name = c.names[k]
        if name in payloads | gains | shapes:
            continue
        kind = next((term for term, kinds in KINDS.items() if name.startswith(kinds)), name)
        term = sizes.get(name, kind)
        out[term] = out.get(term, np.zeros(len(fit.chi))) + c.G[:, k] * found.x[k]
    return out


def left_out_table(lost: Sequence[LeftOut]) -> TextTable:
    """Header and rows: term, where it is largest, its size, error with and without it."""
    rows: list[tuple[str, ...]] = [
        (item.term, item.channel, f"{item.rms:.3g}", f"{item.error_with:.2f}", f"{item.error_without:.2f}")
        for item in lost
    ]
    return ("term", "largest in", "rms N m", "error with it %", "without it %"), rows


def cost_table(fit: SavedFit, found: Consistent) -> TextTable:
    """Header and rows per channel: relative error of the fit and of the consistent parameters, by role."""
    roles = list(fit.factors)
    errors = [fit.error_percent(chi, role) for role in roles for chi in (fit.chi, found.chi)]
    header = ("channel", *(f"{role} {which}" for role in roles for which in ("fit", "consistent")))
    return header, [(name, *(f"{error[name]:.2f}" for error in errors)) for name in errors[0]]
