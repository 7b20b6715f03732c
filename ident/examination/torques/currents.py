"""Motor signals of unknown gain beside torque sensors: only their sign can be wrong, the gain is a scale.

    i_j = (tau_j + friction and rotor of the motor) / g_j,   tau_j what the sensors' fit says

is linear in 1 / g_j and what stands before the gear; where 1 / g_j is negative beyond its scatter on the
fitted recordings and on those that validate, the signal has the other sign. (Turned sensors are told before:
they contradict each other; where what is told of them leaves them contradicting each other, it may be the
joint's sensor that is turned.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ident.examination.check import Check, turned_sign
from ident.examination.fits.hypothesis import WHICH, Asked
from ident.examination.fits.quick import CLUSTERS, Fit
from ident.examination.fits.samples import Sample
from ident.examination.fits.unexplained import contradicted
from ident.examination.torques.signs import SURE


def motor_signs(asked: Asked) -> Iterator[Check]:
    """Checks of the motor signals."""
    quick, columns, seen = asked.quick, asked.quick.columns, asked.seen
    sensors = {int(columns.joint_of[c]): c for c in seen if c not in columns.gain_columns}
    doubtful = bool(contradicted(asked).any())
    known = np.abs(np.einsum("cii->i", quick.identify.G[seen])) > 0 if seen else np.zeros(0, bool)
    for c, gain in columns.gain_columns.items():
        slopes = [
            _slope([s for s in quick.samples if s.role == role], asked.fit, c, gain, known)
            for role in ("identify", "validate")
        ]
        if slopes[0] is None or slopes[0] > -SURE or (slopes[1] is not None and slopes[1] > -1.0):
            continue
        place = int(columns.joint_of[c])
        joint, sensor = columns.need.joints[place], sensors.get(place)
        name = f"{'i' if asked.currents else 'tau_m'}{joint}"
        why = f"it falls where the torque that the sensors show at joint {joint} rises"
        said = f"{name} has the other sign"
        if not doubtful or sensor is None:
            yield turned_sign((name,), f"{said}: {why}", asked.maps)
            continue
        its = asked.name(sensor)
        check = turned_sign((name,), f"{said}, or {its} has the other sign{WHICH}: {why}", asked.maps)
        line = asked.line({its: {"sign": -1}})
        yield replace(check, remedy=f"{check.remedy}  # or {line}, where it is that")


def _slope(samples: Sequence[Sample], fit: Fit, c: int, gain: int, known: np.ndarray) -> float | None:
    """1 / gain in its standard deviations, from the scatter between stretches; None where nothing is seen."""
    parts, signals = [], []
    for s in samples:
        own = np.flatnonzero(~known & np.any(s.W[c] != 0, axis=0))
        own = own[own != gain]
        torque = s.W[c][:, known] @ fit.chi[known]
        parts.append((torque, s.W[c][:, own], own))
        signals.append(-s.W[c][:, gain])
    if not parts or not any(np.ptp(torque) > 0 for torque, _, _ in parts):
        return None
    every = np.unique(np.concatenate([own for _, _, own in parts]))
    rows = []
    for torque, W, own in parts:
        wide = np.zeros((len(torque), 1 + len(every)))
        wide[:, 0] = torque
        wide[:, 1 + np.searchsorted(every, own)] = W
        rows.append(wide)
    X, y = np.vstack(rows), np.concatenate(signals)
    size = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    inverse = np.linalg.pinv((X / size).T @ (X / size), rcond=1e-9)
    x = inverse @ (X / size).T @ y
    scores = (X / size) * (y - X / size @ x)[:, None] @ inverse[:, :1]
    scatter = sum(float(piece.sum()) ** 2 for piece in np.array_split(scores, CLUSTERS))
    return float(x[0] / max(np.sqrt(scatter), 1e-300))
