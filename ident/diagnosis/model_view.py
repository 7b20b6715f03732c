"""The rigid model on the fine signals: its columns channel by channel, and the torques that effects read.

A run without a declared payload has zeros in the payload's columns. Parameters that a study's `without`
leaves out are removed from the model and become candidates.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ident.diagnosis.rows import Fine
from modelgen.effects.frames import frames
from modelgen.geometry.robot import Robot

DRIVE = ("Iam", "Fvm", "Fcm", "Offm", "Fvl", "Fcl", "Offl")
COUPLED = ("Iac", "Fvc", "Fcc")
LEFT_OUT = {
    "coulomb_friction": ("Fcm", "Fcl"),
    "viscous_friction": ("Fvm", "Fvl"),
    "offset": ("Offm", "Offl"),
    "rotor_inertia": ("Iam",),
}
INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
_NAME = re.compile(r"(Iam|Fvm|Fcm|Offm|Fvl|Fcl|Offl|XX|XY|XZ|YY|YZ|ZZ|MX|MY|MZ|M)(\d+)(R\w*)?$")


def split_name(parameter: str) -> tuple[str, int]:
    """("ZZ", 2) of "ZZ2R"; ("", 0) for a payload's parameter."""
    match = _NAME.match(parameter)
    return (match[1], int(match[2])) if match else ("", 0)


@dataclass(frozen=True)
class ModelView:
    """Non-zero model columns on the fine signals. `entries[c]`: (parameter numbers (k,), values (N, k))."""

    model: Any  # the generated model, for torques elsewhere
    n: int
    parameters: tuple[str, ...]
    channels: tuple[str, ...]
    entries: tuple[tuple[np.ndarray, np.ndarray], ...]
    robot: Robot
    kept: np.ndarray  # parameter numbers of the generated model that the view keeps first
    payload_map: np.ndarray  # (base parameters of the model, 10): what a body on the last link adds
    payload_row: int
    joint_of: tuple[int, ...]  # joint number (0-based) of each channel
    notes: tuple[str, ...] = field(default=())
    rotor: tuple[float, ...] = ()  # per joint: drive inertia inside a regrouped link inertia (rotor_split)

    def drive_inertia(self, joint: int) -> float:
        """Inertia of the joint's drive that the link parameters hold; it moves with the motor."""
        return self.rotor[joint] if self.rotor else 0.0

    def torque(self, chi: np.ndarray) -> np.ndarray:
        """(channels, N) model torque on the fine signals."""
        return np.stack([values @ chi[index] for index, values in self.entries])

    def link_torque(self, chi: np.ndarray, joint: int) -> np.ndarray:
        """(N,) rigid body part of the joint's first channel, regrouped drive inertia included."""
        index, values = self.entries[self.joint_of.index(joint)]
        names = [self.parameters[k] for k in index]
        drive = [split_name(name)[0] in DRIVE or name[:3] in COUPLED for name in names]
        return values @ np.where(drive, 0.0, chi[index])

    def link_friction(self, chi: np.ndarray, joint: int) -> np.ndarray:
        """(N,) friction and offset behind the gear of a joint: the gear passes them on as well."""
        c = max(c for c, j in enumerate(self.joint_of) if j == joint)
        index, values = self.entries[c]
        behind = np.array([split_name(self.parameters[k])[0] in ("Fvl", "Fcl", "Offl") for k in index])
        return values @ np.where(behind, chi[index], 0.0)

    def number(self, kinds: Sequence[str], joint: int) -> int | None:
        """Position of the first parameter of one of these kinds at a joint (0-based), None when there is
        none."""
        for k, name in enumerate(self.parameters):
            kind, row = split_name(name)
            if kind in kinds and row == joint + 1:
                return k
        return None

    def shifted_torque(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, chi: np.ndarray) -> np.ndarray:
        """(channels, N) rigid body torque at another motion (payload columns left out)."""
        full = np.zeros(len(self.model.parameters))
        full[self.kept] = chi[: len(self.kept)]
        rigid = np.array([split_name(p)[0] in DRIVE for p in self.model.parameters])
        full[rigid] = 0.0
        return np.ascontiguousarray(self.model.torque(q, dq, ddq, full).T)


def build_view(
    model,
    fine: Fine,
    robot: Robot,
    runs: Sequence,
    payload_models: dict,
    without: Sequence[str] = (),
    coupled_drives: Sequence[tuple[int, int]] = (),
) -> ModelView:
    """Evaluate the model's columns. `payload_models[label]` is the generated model with that payload
    appended."""
    names = list(model.parameters)
    keep = [k for k, name in enumerate(names) if not _left_out(name, without)]
    N = len(fine.t)
    base = _nonzero_columns(model, fine, slice(0, N))
    entries = []
    labels = sorted({r.payload for r in runs if r.payload})
    parameters = [names[k] for k in keep]
    position = {k: i for i, k in enumerate(keep)}
    payload_columns: dict[str, list[dict[int, np.ndarray]]] = {}
    for label in labels:
        extended = payload_models[label]
        rows = np.isin(fine.run, [i for i, r in enumerate(runs) if r.payload == label])
        blocks: list[dict[int, np.ndarray]] = [{} for _ in model.channels]
        first = len(names)
        for piece in fine.pieces:
            if not rows[piece.start]:
                continue
            for c, table in enumerate(_nonzero_columns(extended, fine, piece)):
                for k, part in table.items():
                    if k >= first:
                        blocks[c].setdefault(k, np.zeros(N))[piece] = part
        payload_columns[label] = blocks
    joint_of = tuple(int(re.sub(r"\D", "", name)) - 1 for name in model.channels)
    for c in range(len(model.channels)):
        index = [position[k] for k in base[c] if k in position]
        values = [base[c][k] for k in base[c] if k in position]
        offset = len(keep)
        for label in labels:
            first = len(names)
            for k, column in payload_columns[label][c].items():
                index.append(offset + k - first)
                values.append(column)
            offset += len(payload_models[label].parameters) - first
        for pair, (first_joint, second_joint) in enumerate(coupled_drives):
            a, b = first_joint - 1, second_joint - 1
            here = joint_of[c]
            if here in (a, b) and not model.channels[c].startswith("tau_l"):
                other = b if here == a else a
                total = np.tanh((fine.dq[:, a] + fine.dq[:, b]) / max(fine.sign_width[a], fine.sign_width[b]))
                for k, column in enumerate((fine.ddq[:, other], fine.dq[:, other], total)):
                    index.append(offset + 3 * pair + k)
                    values.append(column)
        entries.append((np.array(index, dtype=int), np.ascontiguousarray(np.stack(values, axis=1))))
    for label in labels:
        parameters += list(payload_models[label].parameters[len(names) :])
    for _, second_joint in coupled_drives:
        parameters += [f"{kind}{second_joint}" for kind in ("Iac", "Fvc", "Fcc")]
    arm = frames(robot, np.zeros((1, fine.q.shape[1])))
    row = max(range(len(robot.links)), key=lambda j: len(arm.above(j)))
    bodies = [f"{kind}{row + 1}" for kind in INERTIAL]
    if set(bodies) <= set(model.standard_parameters):
        payload_map = np.stack([model.regroup({name: 1.0}) for name in bodies], axis=1)
    else:  # model D sees no load
        payload_map = np.zeros((len(names), len(INERTIAL)))
    return ModelView(
        model,
        fine.q.shape[1],
        tuple(parameters),
        tuple(model.channels),
        tuple(entries),
        robot,
        np.array(keep, dtype=int),
        payload_map,
        row,
        joint_of,
    )


def _left_out(name: str, without: Sequence[str]) -> bool:
    kind, row = split_name(name)
    for term in without:
        effect, _, joint = term.partition(":")
        if kind in LEFT_OUT[effect] and (not joint or int(joint) == row):
            return True
    return False


def _nonzero_columns(model, fine: Fine, rows: slice) -> list[dict[int, np.ndarray]]:
    """Per channel {parameter: values} of the columns that are not all zero."""
    q, dq, ddq, sign = fine.q[rows], fine.dq[rows], fine.ddq[rows], fine.sign[rows]
    q, dq, ddq, sign = (np.ascontiguousarray(x) for x in (q, dq, ddq, sign))
    out: list[dict[int, np.ndarray]] = [{} for _ in model.channels]
    if hasattr(model, "nonzeros"):
        places = [(int(c), int(k)) for c, k in model.nonzeros]
        for c, k in places:
            out[c][k] = np.empty(len(q))
        for part, values in model.nonzero_blocks(q, dq, ddq, sign=sign):
            for (c, k), column in zip(places, values):
                out[c][k][part] = column
        return out
    W = model.regressor(q, dq, ddq, sign=sign)
    for c in range(W.shape[1]):
        for number in np.flatnonzero(np.abs(W[:, c]).max(axis=0) > 0):
            out[c][int(number)] = W[:, c, number].copy()
    return out
