"""What a simulated robot weighs and how its joints rub: from a file, or plausible and random.

A parameter file is YAML, `parameters: {name: value}` and, if wanted, `payload: {M: ..., MX: ...}`. A name
is a standard parameter (MZ3, Iam2) or a base parameter (MY2R), which stands for the standard parameter whose
column it keeps, with those regrouped into it taken as zero.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from ident.errors import IdentError
from modelgen.effects.loads import gravity_torque
from modelgen.errors import ModelgenError
from modelgen.geometry import strict_yaml
from modelgen.geometry.robot import Robot
from modelgen.geometry.urdf_xml import LARGEST_TEXT

INERTIA = ("XX", "XY", "XZ", "YY", "YZ", "ZZ")
BODY = (*INERTIA, "MX", "MY", "MZ", "M")


class ParameterError(IdentError):
    """A parameter file that cannot be used."""


@dataclass(frozen=True, slots=True)
class TwinParameters:
    """Standard parameters by name (absent ones are zero) and the ten of a payload under bare names."""

    standard: Mapping[str, float]
    payload: Mapping[str, float] | None = None
    source: str = ""


def twin_parameters(robot: Robot, file: Path | None, seed: int) -> TwinParameters:
    """From `file`; else those that come with a built-in robot; else random ones of that seed."""
    if file is not None:
        try:
            text = strict_yaml.read(file, LARGEST_TEXT)
        except (OSError, ModelgenError):
            raise ParameterError(
                f"{file}: cannot be read; give the path of a parameter file (YAML)"
            ) from None
        return read_parameters(text, robot, str(file))
    built_in = files("ident.twin").joinpath("parameters", f"{robot.name}.yaml")
    if built_in.is_file():
        return read_parameters(built_in.read_bytes(), robot, f"{robot.name}.yaml")
    return random_parameters(robot, np.random.default_rng([seed, 77]))


def read_parameters(text: bytes | str, robot: Robot, file: str) -> TwinParameters:
    """Parse a parameter file. Raises ParameterError naming the file, the key and the remedy."""
    try:
        data = strict_yaml.load(text.encode() if isinstance(text, str) else text)
    except ModelgenError as error:
        raise ParameterError(f"{file}: {error}") from None
    if not isinstance(data, dict):
        raise ParameterError(f"{file}: holds no parameters; write lines such as Iam1: 3.19")
    table = data.get("parameters", {k: v for k, v in data.items() if k != "payload"})
    payload = data.get("payload")
    standard: dict[str, float] = {}
    for name, value in table.items():
        known = standard_name(str(name), robot)
        if known is None:
            raise ParameterError(
                f"{file}: {name} is no parameter of {robot.name}; names such as Iam1, Fvm1, Fcm1, XX1, "
                "MY1, M1, Fcl1, or a base name such as MY2R, are understood"
            )
        if known in standard:
            raise ParameterError(f"{file}: {name} and another line both set {known}; keep one of them")
        standard[known] = _number(file, str(name), value)
    if payload is not None:
        unknown = sorted(set(payload) - set(BODY))
        if unknown:
            raise ParameterError(f"{file}: payload: {unknown[0]} is not one of {', '.join(BODY)}")
        payload = {name: _number(file, f"payload {name}", value) for name, value in payload.items()}
    return TwinParameters(standard, payload, file)


def _number(file: str, name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
        raise ParameterError(f"{file}: {name}: {value!r} is not a number; give a value in SI units")
    return float(value)


def standard_name(name: str, robot: Robot) -> str | None:
    """MY2R -> MY2; None if the robot has no such parameter."""
    match = re.fullmatch(r"(Iam|Fvm|Fcm|Offm|Fvl|Fcl|Offl|[XYZ]{2}|M[XYZ]?)(\d+)R?", name)
    if match is None:
        return None
    kind, number = match.groups()
    if kind in (*BODY,):
        return f"{kind}{number}" if 1 <= int(number) <= len(robot.links) else None
    return f"{kind}{number}" if number in robot.joint_labels else None


def body(m: float, centre: np.ndarray, inertia: np.ndarray) -> dict[str, float]:
    """The ten parameters of mass m [kg] at `centre` (3,) [m] with `inertia` (3, 3) about it [kg m^2]."""
    I = inertia + m * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    first = m * centre
    return {
        "XX": I[0, 0],
        "XY": I[0, 1],
        "XZ": I[0, 2],
        "YY": I[1, 1],
        "YZ": I[1, 2],
        "ZZ": I[2, 2],
        "MX": first[0],
        "MY": first[1],
        "MZ": first[2],
        "M": m,
    }


def payload_body(m: float, known: Mapping[str, float] | None) -> dict[str, float]:
    """A payload of mass m: the robot's own one scaled to m, else a ball 0.12 m in front of the flange."""
    if known:
        return {name: value * m / known["M"] for name, value in known.items()}
    radius = (3 * m / (4 * np.pi * 3000.0)) ** (1 / 3)
    return body(m, np.array([0.02, -0.015, 0.12]), 0.4 * m * radius**2 * np.eye(3))


def random_parameters(robot: Robot, rng: np.random.Generator) -> TwinParameters:
    """Physically consistent: every link a solid of positive density, every drive with positive friction.

    Masses fall towards the tip and grow with the reach (14 kg at 1.2 m); friction and rotor
    inertia follow the torque that the joint holds against gravity (its neighbour's, where gravity does none).
    """
    lengths = [
        abs(float(robot.value(link.d))) + abs(float(robot.value(link.r))) + 0.3 * (link.sigma == 1)
        for link in robot.links
    ]
    arm = max(sum(lengths), 0.2)
    share = 0.72 ** np.arange(len(robot.links)) * rng.uniform(0.8, 1.25, len(robot.links))
    masses = 14.0 * (arm / 1.2) ** 2.5 * share / share.sum()
    standard: dict[str, float] = {}
    for row, m in enumerate(masses, 1):
        towards = _next_origin(robot, row)
        size = 0.05 * arm + 0.3 * np.abs(towards)
        centre = towards * rng.uniform(0.25, 0.6) + rng.normal(size=3) * 0.015 * arm
        sides = size * rng.uniform(0.8, 1.2, 3)
        box = np.diag(
            [sides[1] ** 2 + sides[2] ** 2, sides[0] ** 2 + sides[2] ** 2, sides[0] ** 2 + sides[1] ** 2]
        )
        turn = np.linalg.qr(np.eye(3) + 0.15 * rng.normal(size=(3, 3)))[0]
        for name, value in body(m, centre, turn @ box @ turn.T * m / 3).items():
            standard[f"{name}{row}"] = float(value)
    q = rng.uniform(-2.5, 2.5, (200, robot.n))
    g = np.array([float(robot.value(x)) for x in robot.gravity])
    held = np.sqrt(np.mean(gravity_torque(robot, q, standard, g) ** 2, axis=0))
    held = np.maximum(held, 0.1 * held.max() if held.max() > 0 else 5.0)
    held[0] = max(held[0], 0.6 * held.max())
    for k, (number, level) in enumerate(zip(robot.joint_labels, held)):
        fast = 1.0 if robot.link(robot.moving[k]).sigma == 0 else 3.0
        drive = {
            "Iam": level * rng.uniform(0.015, 0.04) * fast,
            "Fvm": level * rng.uniform(0.08, 0.18) * fast,
            "Fcm": level * rng.uniform(0.07, 0.15),
            "Offm": level * rng.uniform(-0.02, 0.02),
            "Fvl": level * rng.uniform(0.002, 0.006),
            "Fcl": level * rng.uniform(0.004, 0.01),
            "Offl": level * rng.uniform(-0.02, 0.02),
        }
        standard |= {f"{name}{number}": float(value) for name, value in drive.items()}
    return TwinParameters(standard, None, "random")


def _next_origin(robot: Robot, row: int) -> np.ndarray:
    """(3,) origin of the first row that stands on `row`, in its frame at zero position."""
    for link in robot.links:
        if link.antecedent == row:
            d, r, b = (float(robot.value(x)) for x in (link.d, link.r, link.b))
            alpha, gamma = float(robot.value(link.alpha)), float(robot.value(link.gamma))
            along = np.array([d, -r * np.sin(alpha), r * np.cos(alpha) + b])
            c, s = np.cos(gamma), np.sin(gamma)
            return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ along
    return np.array([0.0, 0.0, 0.05])
