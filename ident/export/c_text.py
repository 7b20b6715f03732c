"""The two texts of a fit as C: header and source around the statements of `c_source.py`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ident.export.c_effects import CEffects
from ident.export.c_states import States, literal
from ident.export.saved import SavedFit
from modelgen.emit.description import Derived

LONGEST = 160  # characters of a rule in a comment


@dataclass(frozen=True, slots=True)
class Numbers:
    """What is emitted of a fit: parameters that are not zero, in the fit's order."""

    names: tuple[str, ...]  # as the fit has them
    values: np.ndarray
    std: np.ndarray
    units: tuple[str, ...]
    rules: tuple[str, ...]

    @property
    def c_names(self) -> tuple[str, ...]:
        """As C can bear them: stribeck_friction_2_Fs."""
        return tuple(re.sub(r"\W", "_", name) for name in self.names)


def shortened(rule: str) -> str:
    return rule if len(rule) <= LONGEST else f"{rule[:LONGEST]} ..."


class Writer:
    """The two texts around the statements."""

    def __init__(
        self, fit: SavedFit, derived: Derived, numbers: Numbers, effects: CEffects, name: str, real: str
    ) -> None:
        self.fit, self.numbers, self.effects, self.name, self.real = fit, numbers, effects, name, real
        self.joints = derived.description["joints"]
        self.up, self.n, self.m = name.upper(), len(self.joints), len(fit.columns.channels)
        robot = derived.description["robot"]
        self.note = f"{robot}, model {fit.study.model}: identified torque as C. Written by ident export."
        turns = fit.study.turn_overs
        self.states = States(name, real, self.n, effects.joints, effects.initial, turns)

    def _signatures(self) -> dict[str, tuple[str, str]]:
        r, n, m = self.real, self.n, self.m
        q, dq, ddq = (f"const {r} {x}[{n}]" for x in ("q", "dq", "ddq"))
        tau = f"{r} tau[{m}]"
        whole, effects = f"{q}, {dq}, {ddq}, {tau}", self.effects
        state = self.states.argument
        time = f"{r} t, " if effects.timed else ""
        told = "Found effects" + (", whose states go on by one sample" if effects.joints else "")
        told += "; after friction of the same sample." if self.states.slides else "."
        dry = "Viscous and dry friction and offset; sign(0) is 0: give desired rates."
        slid = f"{state}{q}, " if self.states.slides else ""
        if slid:
            dry = "Viscous and dry friction and offset, whose states go on by one sample."
        signatures = {
            "rigid": (
                f"{q}, {dq}, {ddq}, {tau}",
                "Bodies and rotors: inertia, Coriolis, centrifugal, gravity.",
            ),
            "gravity": (f"{q}, {tau}", "Weight of the bodies alone."),
            "friction": (f"{slid}{dq}, {tau}", dry),
            "compensation": (f"{state if slid else ''}{q}, {dq}, {tau}", "gravity + friction."),
        }
        if state:
            signatures["start"] = (f"struct {self.name}_state *state", "Before the first sample.")
        if effects.terms:
            signatures["effects"] = (f"{state}{time}{whole}", told)
            signatures["torque"] = (f"{state}{time}{whole}", "All of it: rigid + friction + effects.")
        else:
            signatures["torque"] = (f"{state}{whole}", "All of it: rigid + friction.")
        return signatures

    def _named(self) -> str:
        """The joints' own names, where they have any, as a comment can hold them."""
        names = [f"q{its['label']} {its['name']}" for its in self.joints if "name" in its]
        return f"\n   Joints: {re.sub(r'[^ -.0-~]', '_', ', '.join(names))}." if names else ""

    def header(self) -> str:
        lengths = [joint["label"] for joint in self.joints if joint["prismatic"]]
        mixed = f"; joints {', '.join(lengths)} slide: m and N instead" if lengths else ""
        enum = "\n".join(
            f"  {self.up}_{name} = {k}, /* {unit}: {shortened(rule)} */"
            for k, (name, unit, rule) in enumerate(
                zip(self.numbers.c_names, self.numbers.units, self.numbers.rules)
            )
        )
        functions = "\n".join(
            f"/* {text} */\nvoid {self.name}_{key}({arguments});"
            for key, (arguments, text) in self._signatures().items()
        )
        return f"""\
/* {self.note}
   SI units, joint side: q rad, dq rad/s, ddq rad/s^2, tau N m{mixed}.
   tau: {", ".join(self.fit.columns.channels)}.{self._named()}
   Needs <math.h> only. Reentrant: nothing is stored between calls, nothing is allocated. */
#ifndef {self.up}_H
#define {self.up}_H

#define {self.up}_JOINTS {self.n}
#define {self.up}_CHANNELS {self.m}

/* Parameters: unit, and the sum of standard parameters that each stands for (Khalil's names). */
enum {self.name}_parameter {{
{enum}
  {self.up}_PARAMETERS = {len(self.numbers.names)}
}};

/* Identified values and their standard deviations, in the units above. */
extern const {self.real} {self.name}_value[{self.up}_PARAMETERS];
extern const {self.real} {self.name}_std[{self.up}_PARAMETERS];
{self.states.struct()}
#ifdef __cplusplus
extern "C" {{
#endif
{functions}
#ifdef __cplusplus
}}
#endif

#endif
"""

    def source(self, emitted: Mapping[str, list[str]]) -> str:
        parts = [
            f'/* {self.note} */\n#include "{self.name}.h"\n#include <math.h>\n',
            self._table("value", self.numbers.values),
            self._table("std", self.numbers.std),
        ]
        functions = [self.states.slide()] if self.states.slides else []
        functions += [self._function(key, emitted[key]) for key in ("rigid", "gravity", "friction")]
        if self.states.argument:
            arguments, comment = self._signatures()["start"]
            head = f"/* {comment} */\nvoid {self.name}_start({arguments})"
            functions.append(f"{head}\n{{\n{self.states.start()}\n}}\n")
        if self.effects.joints:
            functions.append(self.states.advance(emitted["advance"]))
        if self.effects.terms:
            functions.append(self._function("effects", emitted["effects"]))
        if any(f"{self.name}_sign(" in function for function in functions):
            zero, one = ("0.0F", "1.0F") if self.real == "float" else ("0.0", "1.0")
            parts.append(
                f"static {self.real} {self.name}_sign({self.real} x)\n{{\n  return (x > {zero}) ? {one} : "
                f"((x < {zero}) ? -{one} : {zero});\n}}\n"
            )
        parts += functions
        dry = "state, q, dq" if self.states.slides else "dq"
        parts.append(self._sum("compensation", ("gravity", "q"), ("friction", dry)))
        given = [("rigid", "q, dq, ddq"), ("friction", dry)]
        if self.effects.terms:
            first = ("state, " if self.states.argument else "") + ("t, " if self.effects.timed else "")
            given.append(("effects", f"{first}q, dq, ddq"))
        parts.append(self._sum("torque", *given))
        return "\n".join(parts)

    def _table(self, what: str, values: np.ndarray) -> str:
        suffix = "F" if self.real == "float" else ""
        shown = [f"  {literal(repr(float(np.float32(v) if suffix else v)), suffix)}" for v in values]
        rows = [f"{text}{',' if k + 1 < len(shown) else ''} /* {name} */"
                for k, (text, name) in enumerate(zip(shown, self.numbers.c_names))]  # fmt: skip
        return (
            f"const {self.real} {self.name}_{what}[{self.up}_PARAMETERS] = {{\n" + "\n".join(rows) + "\n};\n"
        )

    def _function(self, key: str, statements: list[str]) -> str:
        text = "\n".join(statements)
        suffix = "f" if self.real == "float" else ""
        local, set_up = [], []
        for name, call in (("c", f"cos{suffix}"), ("s", f"sin{suffix}"), ("sign", f"{self.name}_sign")):
            used = sorted({int(k) for k in re.findall(rf"(?<!\w){name}\[(\d+)\]", text)})
            if used:
                local.append(f"  {self.real} {name}[{self.n}];")
                argument = "dq" if name == "sign" else "q"
                set_up += [f"  {self._set_up(name, k, call, argument)}" for k in used]
        arguments, comment = self._signatures()[key]
        given = re.findall(r"const \w+ (\w+)\[", arguments)
        if key == "effects" and self.effects.joints:
            set_up.insert(0, f"  {self.name}_advance(state, q);")
        if key == "friction" and self.states.slides:
            set_up.insert(0, f"  {self.name}_slide(state, q, dq);")
        whole = "\n".join([*set_up, text])
        passed = re.findall(r"\w+", " ".join(re.findall(r"\(state, ([\w, ]+)\);", whole)))
        given = [name for name in given if name not in passed]
        given += ["state"] if "*state" in arguments and "state" not in whole else []
        unused = [f"  (void){name};" for name in given if not re.search(rf"(?<!\w){name}\[", whole)]
        declared = [f"  {line}" for line in statements if line.startswith(f"{self.real} ")]
        rest = [f"  {line}" for line in statements if not line.startswith(f"{self.real} ")]
        return "\n".join(
            [
                f"/* {comment} */",
                f"void {self.name}_{key}({arguments})",
                "{",
                *local,
                *declared,
                *set_up,
                *unused,
                *rest,
                "}",
                "",
            ]
        )

    def _set_up(self, name: str, k: int, call: str, argument: str) -> str:
        value = self.states.sign(k) if name == "sign" else f"{call}({argument}[{k}])"
        return f"{name}[{k}] = {value};"

    def _sum(self, key: str, *parts: tuple[str, str]) -> str:
        arguments, comment = self._signatures()[key]
        (first, a), *others = parts
        added = "".join(
            f"  {self.name}_{other}({b}, more);\n  for (k = 0; k < {self.m}; k++) {{\n"
            "    tau[k] += more[k];\n  }\n"
            for other, b in others
        )
        return (
            f"/* {comment} */\nvoid {self.name}_{key}({arguments})\n{{\n"
            f"  {self.real} more[{self.m}];\n  int k;\n  {self.name}_{first}({a}, tau);\n{added}}}\n"
        )
