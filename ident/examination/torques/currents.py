"""Motor signals of unknown gain beside torque sensors: only their sign can be wrong, the gain is a scale.

    i_j = (tau_j + friction and rotor of the motor) / g_j,   tau_j what the sensors' fit says

is linear in 1 / g_j and what stands before the gear. Where 1 / g_j is negative beyond its scatter on the
fitted recordings and on those that validate, and dry friction does not go with the motion, the signal has the
other sign. Where its friction does it is the joint's sensor that is turned, if that falls where the signal
rises: no other torque of this robot, and no geometry, has a say in it. (Turned sensors are told before:
they contradict each other; but in the geometry of another robot all torques do, and of a dual arm whose
sensors 1 and 3 are turned two currents were told.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ident.examination.check import Check, turned_sign
from ident.examination.fits.hypothesis import WHICH, Asked
from ident.examination.fits.quick import CLUSTERS
from ident.examination.fits.unexplained import contradicted
from ident.examination.torques.signs import FRICTION, SURE
from modelgen.geometry.names import ParameterName


def motor_signs(asked: Asked) -> Iterator[Check]:
    """Checks of the motor signals."""
    quick, columns, seen = asked.quick, asked.quick.columns, asked.seen
    sensors = {int(columns.joint_of[c]): c for c in seen if c not in columns.gain_columns}
    doubtful = bool(contradicted(asked).any())
    known = np.abs(np.einsum("cii->i", quick.identify.G[seen])) > 0 if seen else np.zeros(0, bool)
    for c in columns.gain_columns:
        slope, friction = _against(asked, "identify", c, known)
        if not slope < -SURE or _against(asked, "validate", c, known)[0] > -1.0:
            continue
        place = int(columns.joint_of[c])
        joint, sensor = columns.need.joints[place], sensors.get(place)
        name = f"{'i' if asked.currents else 'tau_m'}{joint}"
        its = None if sensor is None else asked.name(sensor)
        if friction > SURE:
            if its is not None and _against(asked, "identify", c, known, sensor)[0] < -SURE:
                why = f"it falls where {name} rises, whose dry friction goes with the motion"
                yield turned_sign((its,), f"{its} has the other sign: {why}", asked.maps)
            continue
        why = f"it falls where the torque that the sensors show at joint {joint} rises"
        said = f"{name} has the other sign"
        if friction < -SURE or not doubtful or its is None:
            yield turned_sign((name,), f"{said}: {why}", asked.maps)
            continue
        check = turned_sign((name,), f"{said}, or {its} has the other sign{WHICH}: {why}", asked.maps)
        line = asked.line({its: {"sign": -1}})
        yield replace(check, remedy=f"{check.remedy}  # or {line}, where it is that")


def _against(
    asked: Asked, role: str, c: int, known: np.ndarray, sensor: int | None = None
) -> tuple[float, float]:
    """1 / gain, of what the fit says of the joint or of what its sensor reads, and the power of the signal's
    own friction, each in its standard deviations, from the scatter between stretches; NaN where nothing is
    seen."""
    columns, samples = asked.quick.columns, [s for s in asked.quick.samples if s.role == role]
    gain, joint, unseen = columns.gain_columns[c], int(columns.joint_of[c]), (np.nan, np.nan)
    if not samples:
        return unseen
    W = np.concatenate([s.W[c] for s in samples])
    if sensor is None:
        torque = W[:, known] @ asked.fit.chi[known]
    else:
        torque = np.concatenate([s.Y[:, asked.how.order[sensor]] for s in samples])
    if not np.ptp(torque) > 0:
        return unseen
    own = np.flatnonzero(~known & np.any(W != 0, axis=0) & (np.arange(len(known)) != gain))
    X, y = np.column_stack([torque, W[:, own]]), -W[:, gain]
    size = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    inverse = np.linalg.pinv((X / size).T @ (X / size), rcond=1e-9)
    x = inverse @ (X / size).T @ y
    rubs = [name is not None and name.kind in FRICTION for name in map(ParameterName.of, columns.parameters)]
    asks = np.zeros((len(x), 2))
    asks[0, 0] = 1.0
    asks[1:, 1] = np.where(
        np.array(rubs)[own], np.concatenate([s.dq[:, joint] for s in samples]) @ W[:, own], 0
    )
    asks /= size[:, None]
    scores = (X / size) * (y - X / size @ x)[:, None] @ inverse @ asks
    scatter = sum(piece.sum(axis=0) ** 2 for piece in np.array_split(scores, CLUSTERS))
    slope, friction = x @ asks / np.maximum(np.sqrt(scatter), 1e-300)
    return float(slope), float(friction)
