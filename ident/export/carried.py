"""What a model file cannot hold: how large each term of the fit is, and what leaving it out costs.

A URDF has bodies, viscous damping and dry friction, an MJCF rotor inertia (armature) besides; neither has
offsets, coupled drives, a sensor's own inertia or what `effects:` added. Sizes and errors come from the
triangular factors of the validate runs (identify where there are none), over the rows that count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ident.export.consistent import Consistent
from ident.export.saved import SavedFit

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


def left_out(fit: SavedFit, found: Consistent, form: str) -> tuple[LeftOut, ...]:
    """Largest first; `form` is "urdf" or "mjcf". A payload's parameters are not the robot's and stay out."""
    role = role_of(fit)
    with_all = fit.error_percent(found.chi, role)["total"]
    out = []
    for term, part in parts(fit, found).items():
        if term in HOLDS[form] or not part.any():
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
    """{term: its share (b,) of chi}: chi less all of them are the bodies."""
    c = found.combination
    first = 10 * c.links
    out: dict[str, np.ndarray] = {}
    own = set(fit.columns.model.parameters) | set(fit.columns.parameters[: len(fit.columns.model.parameters)])
    payloads = {f"{kind}{label}" for label in fit.study.payloads
                for kind in ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")}  # fmt: skip
    gains = {fit.columns.parameters[k] for k in fit.columns.gain_columns.values()}
    for k in range(first, len(c.names)):
        name = c.names[k]
        if name.removesuffix("R") in payloads or name in gains:
            continue
        term = next((term for term, kinds in KINDS.items() if name.startswith(kinds)), None)
        if term is None or (name not in own and term in HOLDS["mjcf"] and "." in name):
            term = name
        out[term] = out.get(term, np.zeros(len(fit.chi))) + c.G[:, k] * found.x[k]
    return out


def left_out_table(lost: Sequence[LeftOut]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows: term, where it is largest, its size, error with and without it."""
    rows = [
        (item.term, item.channel, f"{item.rms:.3g}", f"{item.error_with:.2f}", f"{item.error_without:.2f}")
        for item in lost
    ]
    return ("term", "largest in", "rms N m", "error with it %", "without it %"), rows


def cost_table(fit: SavedFit, found: Consistent) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows per channel: relative error of the fit and of the consistent parameters, by role."""
    roles = list(fit.factors)
    errors = [fit.error_percent(chi, role) for role in roles for chi in (fit.chi, found.chi)]
    header = ("channel", *(f"{role} {which}" for role in roles for which in ("fit", "consistent")))
    return header, [(name, *(f"{error[name]:.2f}" for error in errors)) for name in errors[0]]
