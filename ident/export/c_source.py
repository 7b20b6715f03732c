"""A fit as C99: one header, one source, libm only; the identified numbers are in it as named constants.

    rigid         bodies and rotors: inertia, Coriolis, centrifugal, gravity
    gravity       of the bodies, at rest
    friction      viscous, dry and offset, of motor and link
    compensation  gravity + friction
    effects       found effects, with states that the caller keeps (c_effects.py, c_states.py)
    torque        rigid + friction + effects

The statements are CasADi's, of the same programs that the fit evaluated, with cancelled parameters folded
away. No allocation, no recursion, no static state: all arrays belong to the caller. Every function has one
way in and out and no unbounded loop. `--float32` computes in float, with libm's float functions.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ident.export.c_effects import CEffects, behind_the_gear, torques, written
from ident.export.c_states import literal
from ident.export.c_text import Numbers, Writer
from ident.export.combination import ExportError
from ident.export.saved import SavedFit
from modelgen.dynamics.newton_euler import INERTIAL
from modelgen.emit.c_code import body
from modelgen.emit.casadi_functions import program_outputs
from modelgen.emit.description import Derived, derive
from modelgen.geometry.robot import Robot

STATE = ("c", "s", "q", "dq", "ddq", "sign")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}\Z")


@dataclass(frozen=True, slots=True)
class CCode:
    """Texts of the two files and the name of the functions."""

    name: str
    header: str
    source: str
    left_out: Mapping[str, str]  # effects of the fit that are not in it, and why


def c_code(fit: SavedFit, robot: Robot, name: str | None = None, float32: bool = False) -> CCode:
    """Header and source of a fit; its payloads are left out: it is the bare robot. Raises ExportError."""
    chosen = name or re.sub(r"\W", "_", f"{robot.name}_{fit.study.model.lower()}")
    if not NAME.match(chosen):
        raise ExportError(f"--name {chosen}: give a C name of at most 31 letters, digits and _, such as arm")
    derived = derive(robot, fit.study.model)
    numbers = _numbers(fit, derived)
    real = "float" if float32 else "double"
    effects = written(fit.terms)
    functions = _functions(fit, derived, numbers, effects)
    emitted = {key: _statements(function, chosen, numbers, real) for key, function in functions.items()}
    writer = Writer(fit, derived, numbers, effects, chosen, real)
    return CCode(chosen, writer.header(), writer.source(emitted), effects.left_out)


def _numbers(fit: SavedFit, derived: Derived) -> Numbers:
    columns = fit.columns
    own = set(derived.description["parameters"])
    payload = {f"{kind}{label}{r}" for label in fit.study.payloads for kind in INERTIAL for r in ("", "R")}
    payload |= {
        name for term in fit.terms if term.label in written(fit.terms).left_out for name in term.names
    }
    kept = [k for k, name in enumerate(columns.parameters)
            if fit.chi[k] != 0 and (name in own or name not in payload)]  # fmt: skip
    std = np.sqrt(np.maximum(np.diag(fit.covariance), 0))
    names = tuple(columns.parameters[k] for k in kept)
    return Numbers(names, fit.chi[kept], std[kept], tuple(columns.units[k] for k in kept),
                    tuple(columns.regroups.get(n, n) for n in names))  # fmt: skip


def _functions(
    fit: SavedFit, derived: Derived, numbers: Numbers, effects: CEffects
) -> dict[str, ca.Function]:
    """{"rigid", "gravity", "friction", "effects", "advance"} of (c, s, q, dq, ddq, sign, chi, t, z, step),
    chi being the emitted numbers."""
    description = derived.description
    labels = [joint["label"] for joint in description["joints"]]
    vectors = {name: ca.SX.sym(name, len(labels)) for name in STATE}
    chi = ca.SX.sym("chi", len(numbers.names))
    place = {name: k for k, name in enumerate(numbers.names)}
    inertial = [name for name in description["parameters"] if not name.startswith(("Fv", "Fc", "Off"))]
    rows = [int(row) for row in fit.columns.rows]

    def torque(used: set[str], at_rest: bool, rows: Sequence[int] = rows) -> Any:
        inputs: dict[str, Any] = {}
        for name, vector in vectors.items():
            still = at_rest and name in ("dq", "ddq", "sign")
            inputs |= {name + k: ca.SX(0) if still else vector[i] for i, k in enumerate(labels)}
        for b, name in enumerate(description["parameters"]):
            inputs[f"chi{b}"] = chi[place[name]] if name in place and name in used else ca.SX(0)
        tau = program_outputs(derived.torque, inputs)
        return ca.vertcat(*(tau[row] for row in rows))

    every = set(description["parameters"])
    more_rigid, more_friction = _own_columns(fit, vectors, chi, place)
    outputs = {
        "rigid": torque(set(inertial), False) + more_rigid,
        "gravity": torque(set(inertial), True),
        "friction": torque(every - set(inertial), False) + more_friction,
    }
    n = len(labels)
    wanted = any("tau_link" in term.effect.needs for term in effects.terms)
    last = len(description["channels"]) - n if fit.study.model == "C" else 0
    link = torque(behind_the_gear(tuple(every)), False, range(last, last + n)) if wanted else None
    more = {name: ca.SX.sym(name, size) for name, size in
            (("t", 1), ("z", len(effects.joints)), ("step", len(effects.joints)))}  # fmt: skip
    values = {name: chi[k] for name, k in place.items()}
    tau, states = torques(effects, fit.columns.need.channels, labels, {**vectors, **more}, link, values)
    arguments = [*vectors.values(), chi, *more.values()]
    outputs |= {"effects": tau, "advance": states}
    return {
        key: ca.Function(key, arguments, [ca.SX(tau)], [*STATE, "chi", *more], ["tau"])
        for key, tau in outputs.items()
    }


def _own_columns(fit: SavedFit, v: Mapping[str, Any], chi: Any, place: Mapping[str, int]) -> tuple[Any, Any]:
    """Torques of the columns that a study adds to the model: coupled drives, inertia beyond the sensor."""
    columns, need = fit.columns, fit.columns.need
    rigid, friction = ca.SX.zeros(len(columns.channels)), ca.SX.zeros(len(columns.channels))
    known: set[str] = set()
    motor = {c.joint: k for k, c in enumerate(need.channels) if c.side != "sensor"}
    for pair in fit.study.coupled_drives:
        a, b = (need.joints.index(joint) for joint in pair)
        for here, other in ((a, b), (b, a)):
            terms = {"Iac": v["ddq"][other], "Fvc": v["dq"][other], "Fcc": ca.sign(v["dq"][a] + v["dq"][b])}
            for kind, term in terms.items():
                name = f"{kind}{pair[1]}"
                known.add(name)
                if name in place and here in motor:
                    target = rigid if kind == "Iac" else friction
                    target[motor[here]] += chi[place[name]] * term
    for k, channel in enumerate(need.channels):
        name = f"Ial{need.joints[channel.joint]}"
        if fit.study.link_inertia and channel.side == "sensor":
            known.add(name)
            if name in place:
                rigid[k] += chi[place[name]] * v["ddq"][channel.joint]
    known |= {columns.parameters[k] for k in columns.gain_columns.values()}
    known |= {name for name in columns.parameters if name.startswith("Iam")}  # at the joint's acceleration
    strange = [columns.parameters[extra.column] for extra in columns.extras
               if columns.parameters[extra.column] not in known and fit.chi[extra.column] != 0]  # fmt: skip
    if strange:
        raise ExportError(
            f"{', '.join(dict.fromkeys(strange))}: this effect of the study cannot be written as C yet; "
            "fit without it, or use the Python interface"
        )
    return rigid, friction


def _statements(function: ca.Function, name: str, numbers: Numbers, real: str) -> list[str]:
    """CasADi's statements as plain C in one number type, parameters by name."""
    lines = []
    suffix = "F" if real == "float" else ""
    for line in body(function):
        line = re.sub(r"^REAL ", f"{real} ", line)
        line = re.sub(
            r"CONSTANT\(chi\[(\d+)\]\)",
            lambda m: f"{name}_value[{name.upper()}_{numbers.c_names[int(m[1])]}]",
            line,
        )
        line = re.sub(r"CONSTANT\((-?[\d.]+(?:e[+-]\d+)?)\)", lambda m: literal(m[1], suffix), line)
        line = re.sub(r"STORE\((\w+), (\d+), (\w+)\);", r"\1[\2] = \3;", line)
        line = re.sub(r"(?<![\w.])t\[0\]", "t", line)
        line = re.sub(r"(?<![\w.])z\[", "state->z[", line)
        line = re.sub(r"CALL_sign\(", f"{name}_sign(", line)
        line = re.sub(r"CALL_abs\(", f"fabs{suffix.lower()}(", line)
        line = re.sub(r"CALL_(\w+)\(", lambda m: f"{m[1]}{suffix.lower()}(", line)
        lines.append(line)
    return lines
