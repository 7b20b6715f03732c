"""The two texts of a fit as C: header and source around the statements of `c_source.py`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ident.export.c_effects import CEffects
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


def literal(text: str, suffix: str) -> str:
    text = text + "0" if text.endswith(".") else text
    if "." not in text and "e" not in text:
        text += ".0"
    return f"({text}{suffix})" if text.startswith("-") else f"{text}{suffix}"


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

    def _signatures(self) -> dict[str, tuple[str, str]]:
        r, n, m = self.real, self.n, self.m
        q, dq, ddq = (f"const {r} {x}[{n}]" for x in ("q", "dq", "ddq"))
        tau = f"{r} tau[{m}]"
        whole, effects = f"{q}, {dq}, {ddq}, {tau}", self.effects
        state = f"struct {self.name}_state *state, " if effects.joints else ""
        time = f"{r} t, " if effects.timed else ""
        told = "Found effects" + (", whose states go on by one sample." if state else ".")
        signatures = {
            "rigid": (
                f"{q}, {dq}, {ddq}, {tau}",
                "Bodies and rotors: inertia, Coriolis, centrifugal, gravity.",
            ),
            "gravity": (f"{q}, {tau}", "Weight of the bodies alone."),
            "friction": (
                f"{dq}, {tau}",
                "Viscous and dry friction and offset; sign(0) is 0: give desired rates.",
            ),
            "compensation": (f"{q}, {dq}, {tau}", "gravity + friction."),
        }
        if effects.joints:
            signatures["start"] = (f"struct {self.name}_state *state", "Before the first sample.")
        if effects.terms:
            signatures["effects"] = (f"{state}{time}{whole}", told)
            signatures["torque"] = (f"{state}{time}{whole}", "All of it: rigid + friction + effects.")
        else:
            signatures["torque"] = (whole, "All of it: rigid + friction.")
        return signatures

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
   tau: {", ".join(self.fit.columns.channels)}.
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
{self._struct()}
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
        functions = [self._function(key, emitted[key]) for key in ("rigid", "gravity", "friction")]
        if self.effects.joints:
            functions += [self._start(), self._advance(emitted["advance"])]
        if self.effects.terms:
            functions.append(self._function("effects", emitted["effects"]))
        if any(f"{self.name}_sign(" in function for function in functions):
            zero, one = ("0.0F", "1.0F") if self.real == "float" else ("0.0", "1.0")
            parts.append(
                f"static {self.real} {self.name}_sign({self.real} x)\n{{\n  return (x > {zero}) ? {one} : "
                f"((x < {zero}) ? -{one} : {zero});\n}}\n"
            )
        parts += functions
        parts.append(self._sum("compensation", ("gravity", "q"), ("friction", "dq")))
        given = [("rigid", "q, dq, ddq"), ("friction", "dq")]
        if self.effects.terms:
            first = ("state, " if self.effects.joints else "") + ("t, " if self.effects.timed else "")
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
            given.remove("q")
        whole = "\n".join([*set_up, text])
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

    def _struct(self) -> str:
        if not self.effects.joints:
            return ""
        count = len(self.effects.joints)
        return (
            "\n/* States of the found effects; the caller keeps one for each robot. */\n"
            f"struct {self.name}_state {{\n  {self.real} z[{count}];\n  {self.real} q[{count}];\n"
            "  int begun;\n};\n"
        )

    def _start(self) -> str:
        suffix = "F" if self.real == "float" else ""
        zero = f"0.0{suffix}"
        lines = [
            f"  state->z[{k}] = {literal(repr(float(z)), suffix)};\n  state->q[{k}] = {zero};"
            for k, z in enumerate(self.effects.initial)
        ]
        body = "\n".join([*lines, "  state->begun = 0;"])
        arguments, comment = self._signatures()["start"]
        return f"/* {comment} */\nvoid {self.name}_start({arguments})\n{{\n{body}\n}}\n"

    def _advance(self, statements: list[str]) -> str:
        """States by one sample: what their update makes of the step of q."""
        r, count = self.real, len(self.effects.joints)
        declared = [f"  {line}" for line in statements if line.startswith(f"{r} ")]
        rest = [f"    {line}" for line in statements if not line.startswith(f"{r} ")]
        steps = [f"    step[{k}] = q[{j}] - state->q[{k}];" for k, j in enumerate(self.effects.joints)]
        keep = [f"  state->q[{k}] = q[{j}];" for k, j in enumerate(self.effects.joints)]
        back = [f"    state->z[{k}] = tau[{k}];" for k in range(count)]
        return "\n".join(
            [
                f"static void {self.name}_advance(struct {self.name}_state *state, const {r} q[{self.n}])",
                "{",
                f"  {r} step[{count}];",
                f"  {r} tau[{count}];",
                *declared,
                "  if (state->begun != 0) {",
                *steps,
                *rest,
                *back,
                "  }",
                *keep,
                "  state->begun = 1;",
                "}",
                "",
            ]
        )

    def _set_up(self, name: str, k: int, call: str, argument: str) -> str:
        width = self.fit.study.turn_over[k] if name == "sign" and self.fit.study.turn_over else 0.0
        if width > 0:  # the fit's own smooth sign
            tanh, suffix = ("tanhf", "F") if self.real == "float" else ("tanh", "")
            return f"sign[{k}] = {tanh}(dq[{k}] / {literal(repr(float(width)), suffix)});"
        return f"{name}[{k}] = {call}({argument}[{k}]);"

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
