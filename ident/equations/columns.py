"""Which column of W belongs to which parameter of a study, and what stands on the left of Y = W chi + rho.

The compiled model gives the structurally non-zero entries of W. A study changes what becomes of them: terms
left out (`without`), one set of ten payload columns per label and only in the runs that carry it, columns of
its own for unknown drive gains (-i_j, so that 0 = W chi - g_j i_j) and for drives that a gearbox couples.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ident.errors import StudyError
from ident.recordings.need import Need
from ident.recordings.study import Study
from ident.signals.filtering import FilteredBlock, smooth_sign
from modelgen.geometry.names import INERTIAL, ParameterName, unit_of

TERMS = {
    "coulomb_friction": ("Fcm", "Fcl"),
    "viscous_friction": ("Fvm", "Fvl"),
    "offset": ("Offm", "Offl"),
    "rotor_inertia": ("Iam",),
}
Values = Callable[[FilteredBlock], np.ndarray]  # -> (N,)


@dataclass(frozen=True, slots=True)
class Extra:
    """A column that the compiled model does not have: entries (channel, parameter) with their values."""

    channel: int
    column: int
    values: Values


@dataclass(frozen=True, slots=True)
class Columns:
    """The parameters of a study's fit and where their columns come from."""

    model: Any  # a model of `generated.load`
    need: Need
    channels: tuple[str, ...]
    rows: np.ndarray  # (channels,) rows of the compiled model that they are
    parameters: tuple[str, ...]  # b names
    units: tuple[str, ...]
    known: dict[str, float]  # parameters with a given value: moved to the side of Y
    regroups: dict[str, str]
    gain_columns: dict[int, int]  # channel -> column of its unknown drive gain
    extras: tuple[Extra, ...]
    sources: dict[str | None, tuple[np.ndarray, np.ndarray]]
    # payload label -> entries of model.nonzeros to use (E,), their columns (E,); -1 - k is known parameter k

    @property
    def joint_of(self) -> np.ndarray:
        """(channels,) position of each channel's joint among the moving joints."""
        return np.array([channel.joint for channel in self.need.channels], int)

    def entries(self, payload: str | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Model entries used in a run with this payload: (index into nonzeros, channel, column)."""
        used, columns = self.sources[payload]
        return used, np.searchsorted(self.rows, np.asarray(self.model.nonzeros)[used, 0]), columns

    def torque(self, block: FilteredBlock) -> np.ndarray:
        """Y (N, channels) of a block; channels with an unknown gain carry what is known of them (C: 0, D:
        -tau_l)."""
        motor, sensor = block.motor, block.sensor
        if self.gain_columns and motor is not None:
            motor = np.zeros_like(motor)
        return self.need.torque(motor, sensor)

    def model_chi(self, chi: np.ndarray, payload: str | None) -> np.ndarray:
        """chi (b,) of the study -> the compiled model's own vector in a run with this payload."""
        used, columns = self.sources[payload]
        out = np.zeros(len(self.model.parameters))
        known = np.array(list(self.known.values()))
        values = np.where(columns >= 0, chi[np.maximum(columns, 0)], 0.0)
        if len(known):
            values = np.where(columns < 0, known[np.minimum(-1 - columns, len(known) - 1).clip(0)], values)
        out[np.asarray(self.model.nonzeros)[used, 1]] = values
        return out


def study_columns(study: Study, model: Any, need: Need) -> Columns:
    """Lay out the parameters of a study on a compiled model. Raises StudyError."""
    first = study.payloads[0] if study.payloads else None
    rows = np.array([model.channels.index(name) for name in need.names], int)
    nonzeros = np.asarray(model.nonzeros)
    reached = set(nonzeros[np.isin(nonzeros[:, 0], rows), 1].tolist())
    load = {k: its for k, name in enumerate(model.parameters) if (its := _payload_kind(name, first))}
    own = [k for k in range(len(model.parameters)) if k not in load]
    _check_labels(study, tuple(model.parameters[k] for k in own))
    dropped = left_out(study, model.parameters, dict(model.rules))
    kept = [k for k in own if k in reached and model.parameters[k] not in dropped]
    parameters = [model.parameters[k] for k in kept]
    place = {k: position for position, k in enumerate(kept)}
    known: dict[str, float] = {}
    gains_unknown = study.drive_gains == "identify"
    if study.model == "B" and study.drive_gains is not None:
        raise StudyError(
            str(study.file),
            "drive_gains",
            "model B has no motor signal, so gains do nothing; leave the key out, or choose C or D",
        )
    placed: dict[str | None, dict[int, int]] = {None: dict(place)}
    for label in study.payloads:
        placed[label] = dict(place)
        for k, kind in load.items():
            if k not in reached:
                continue
            if kind == "M" and gains_unknown and study.model == "A" and label in study.payload_mass:
                known[f"M{label}"] = study.payload_mass[label]
                placed[label][k] = -len(known)
            else:
                placed[label][k] = len(parameters)
                parameters.append(f"{kind}{label}")
    gain_columns, extras = _gains(study, need, parameters) if gains_unknown else ({}, [])
    extras += _coupled_drives(study, need, parameters) + _link_inertia(study, need, parameters)
    extras += _rotors(study, need, parameters)
    sources: dict[str | None, tuple[np.ndarray, np.ndarray]] = {}
    for carried, table in placed.items():
        used = np.array([e for e, (row, k) in enumerate(nonzeros) if k in table and row in rows], int)
        sources[carried] = (used, np.array([table[k] for k in nonzeros[used, 1]], int))
    return Columns(
        model,
        need,
        need.names,
        rows,
        tuple(parameters),
        tuple(unit_of(name, model.prismatic) for name in parameters),
        known,
        dict(model.rules),
        gain_columns,
        tuple(extras),
        sources,
    )


def _payload_kind(name: str, label: str | None) -> str | None:
    """XX of XXL when the payload is labelled L, None for the robot's own parameters."""
    if label is None:
        return None
    parsed = ParameterName.of(name, (label,))
    return parsed.kind if parsed and parsed.payload else None


def _check_labels(study: Study, own: Sequence[str]) -> None:
    """A payload's ten names must be nobody else's: X1 would make MX1, which is a first moment of link 1."""
    taken = {name.removesuffix("R"): "the robot's own" for name in own}
    for label in study.payloads:
        names = {f"{kind}{label}".removesuffix("R") for kind in INERTIAL}
        for name in sorted(names & set(taken)):
            raise StudyError(
                str(study.file),
                "recordings",
                f"payload label {label} makes a parameter {name}, which is {taken[name]}; "
                "choose another label, such as L",
            )
        taken |= dict.fromkeys(names, f"that of the payload {label}")


def left_out(study: Study, parameters: tuple[str, ...], rules: dict[str, str]) -> set[str]:
    """Parameters whose columns go. On a slide along gravity an offset stands for the rotor's inertia too
    (Offm3R = Offm3 - 9.81*Iam3), and stays while the rotor does."""
    out: set[str] = set()
    for term in study.without:
        kind, _, joint = term.partition(":")
        parsed = {name: ParameterName.of(name) for name in parameters}
        names = {
            name
            for name, its in parsed.items()
            if its and its.kind in TERMS[kind] and (not joint or its.label == joint)
        }
        if not names and joint:
            raise StudyError(
                str(study.file),
                "without",
                f"{term}: model {study.model} has no such parameter; check the joint number",
            )
        out |= names
    return {
        name
        for name in out
        if not (rotor := re.search(r"Iam([0-9]+)", rules.get(name, "")))
        or {"rotor_inertia", f"rotor_inertia:{rotor[1]}"} & set(study.without)
    }


def _gains(study: Study, need: Need, parameters: list[str]) -> tuple[dict[int, int], list[Extra]]:
    """One unknown gain per motor channel: column -i_j, so that Y = W chi - g_j i_j with Y free of the
    motor."""
    places: dict[int, int] = {}
    extras = []
    for channel, its in enumerate(need.channels):
        if its.side == "sensor":
            continue
        places[channel] = len(parameters)
        extras.append(Extra(channel, len(parameters), _motor_signal(need.motor.index(its.joint))))
        parameters.append(f"g{need.joints[its.joint]}")
    return places, extras


def _motor_signal(k: int) -> Values:
    def values(block: FilteredBlock) -> np.ndarray:
        assert block.motor is not None
        return -block.motor[:, k]

    return values


def _coupled_drives(study: Study, need: Need, parameters: list[str]) -> list[Extra]:
    """`coupled_drives: [[5, 6]]`: the second joint's motor turns with q5 + q6 and so loads both joints.

    Its rotor adds Iac ddq6 to joint 5 and Iac ddq5 to joint 6, its friction likewise Fvc and
    Fcc sign(dq5 + dq6) on both (its own share stays in Iam6 and Fvm6). Staubli's TX wrists are built so.
    """
    extras: list[Extra] = []
    if study.coupled_drives and study.model == "B":
        raise StudyError(
            str(study.file),
            "coupled_drives",
            "acts on motor torques, which model B does not have; choose model A, C or D",
        )
    channel_of = {c.joint: k for k, c in enumerate(need.channels) if c.side != "sensor"}
    for first, second in study.coupled_drives:
        if first not in need.joints or second not in need.joints or first == second:
            raise StudyError(
                str(study.file), "coupled_drives", f"[{first}, {second}] are not two joints of this robot"
            )
        a, b = need.joints.index(first), need.joints.index(second)
        pairs = [(here, other) for here, other in ((a, b), (b, a)) if here in channel_of]
        for kind in ("Iac", "Fvc", "Fcc") if pairs else ():
            column = len(parameters)
            parameters.append(f"{kind}{second}")
            extras += [Extra(channel_of[here], column, _coupled(kind, here, other)) for here, other in pairs]
    return extras


def _link_inertia(study: Study, need: Need, parameters: list[str]) -> list[Extra]:
    """`link_inertia: true`: Ial_j ddq_j in sensor channel j, what of the gear's output turns beyond the
    sensor.

    The rigid model of a link has a moment about its own axis that other joints' motion shares (ZZ_j); gear
    and bearing rings, and the sensor's own lag, follow the joint's acceleration alone. All baselines of the
    recorded robots have this term.
    """
    if not study.link_inertia:
        return []
    if study.model not in "BC":
        raise StudyError(
            str(study.file),
            "link_inertia",
            f"model {study.model} has no sensor channel of its own; choose model B or C",
        )
    extras = []
    for k, channel in enumerate(need.channels):
        if channel.side == "sensor":
            extras.append(Extra(k, len(parameters), _acceleration(channel.joint)))
            parameters.append(f"Ial{need.joints[channel.joint]}")
    return extras


def _rotors(study: Study, need: Need, parameters: Sequence[str]) -> list[Extra]:
    """`positions: joint`: a rotor keeps the acceleration of its motor, Iam_j ddq_mj; what its column has more
    than the joint's. A rotor regrouped into a body's moment goes with that body."""
    if study.positions != "joint":
        return []
    kinds = {(its.kind, its.label): k for k, n in enumerate(parameters) if (its := ParameterName.of(n))}
    places = [(c, its.joint, ("Iam", str(need.joints[its.joint]))) for c, its in enumerate(need.channels)
              if its.side != "sensor"]  # fmt: skip
    return [Extra(c, kinds[name], _beyond(joint)) for c, joint, name in places if name in kinds]


def _beyond(k: int) -> Values:
    def values(block: FilteredBlock) -> np.ndarray:
        if block.motor_ddq is None:
            return np.zeros(len(block.t))
        return block.motor_ddq[:, k] - block.ddq[:, k]

    return values


def _acceleration(k: int) -> Values:
    def values(block: FilteredBlock) -> np.ndarray:
        return block.ddq[:, k]

    return values


def _coupled(kind: str, here: int, other: int) -> Values:
    def values(block: FilteredBlock) -> np.ndarray:
        if kind == "Iac":
            return block.ddq[:, other]
        if kind == "Fvc":
            return block.dq[:, other]
        speed = block.dq[:, here] + block.dq[:, other]
        return smooth_sign(speed, np.full(1, block.vs[[here, other]].max()))

    return values
