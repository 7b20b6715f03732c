"""States of an exported fit in C: memories of found effects, and of dry friction that takes a travel to turn.

They stand in one struct that the caller keeps, one for each robot; nothing is static. Both go on by one
sample a call, from the step of q: effects by their own update, dry friction by Dahl's law

    z' = s + (z - s) exp(-|step| / travel),   s = sign(step),   sign(dq) ~ z |tanh(dq / rate)|, z at no rate

as ident/signals/dry_friction.py has it, but for turns between two samples, which C takes at the first of
them; z begins slid in, with the sign of the first rate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ident.signals.dry_friction import TurnOver


def literal(text: str, suffix: str) -> str:
    text = text + "0" if text.endswith(".") else text
    if "." not in text and "e" not in text:
        text += ".0"
    return f"({text}{suffix})" if text.startswith("-") else f"{text}{suffix}"


@dataclass(frozen=True, slots=True)
class States:
    """joints, initial: of each state of the effects; turns: of each joint's dry friction (() where plain)."""

    name: str
    real: str
    n: int
    joints: tuple[int, ...]
    initial: tuple[float, ...]
    turns: tuple[TurnOver, ...]

    @property
    def slides(self) -> tuple[int, ...]:
        """Joints (from 0) whose dry friction has a travel."""
        return tuple(k for k, turn in enumerate(self.turns) if turn.travel > 0)

    @property
    def argument(self) -> str:
        """What functions with states take first, "" where there are none."""
        return f"struct {self.name}_state *state, " if self.joints or self.slides else ""

    def number(self, value: float) -> str:
        return literal(repr(float(value)), self._suffix.upper())

    @property
    def _suffix(self) -> str:
        return "f" if self.real == "float" else ""

    def struct(self) -> str:
        if not self.argument:
            return ""
        own = [("z", "q", "begun", len(self.joints)), ("slip", "slip_q", "sliding", len(self.slides))]
        fields = "".join(
            f"  {self.real} {z}[{count}];\n  {self.real} {q}[{count}];\n  int {flag};\n"
            for z, q, flag, count in own
            if count
        )
        return (
            "\n/* States of effects (z) and dry friction (slip); the caller keeps one for each robot. */\n"
            f"struct {self.name}_state {{\n{fields}}};\n"
        )

    def start(self) -> str:
        """Body of the function before the first sample."""
        zero = self.number(0.0)
        lines = [f"  state->z[{k}] = {self.number(z)};\n  state->q[{k}] = {zero};"
                 for k, z in enumerate(self.initial)]  # fmt: skip
        lines += ["  state->begun = 0;"] if self.joints else []
        lines += [f"  state->slip[{k}] = {zero};\n  state->slip_q[{k}] = {zero};"
                  for k in range(len(self.slides))]  # fmt: skip
        return "\n".join([*lines, *(["  state->sliding = 0;"] if self.slides else [])])

    def advance(self, statements: Sequence[str]) -> str:
        """The effects' states by one sample: what their update makes of the step of q."""
        r, count = self.real, len(self.joints)
        lines = [f"  {r} step[{count}];", f"  {r} tau[{count}];"]
        lines += [f"  {line}" for line in statements if line.startswith(f"{r} ")]
        lines += ["  if (state->begun != 0) {"]
        lines += [f"    step[{k}] = q[{j}] - state->q[{k}];" for k, j in enumerate(self.joints)]
        lines += [f"    {line}" for line in statements if not line.startswith(f"{r} ")]
        lines += [f"    state->z[{k}] = tau[{k}];" for k in range(count)]
        lines += ["  }", *(f"  state->q[{k}] = q[{j}];" for k, j in enumerate(self.joints))]
        head = f"static void {self.name}_advance(struct {self.name}_state *state, const {r} q[{self.n}])"
        return "\n".join([head, "{", *lines, "  state->begun = 1;", "}", ""])

    def slide(self) -> str:
        """The states of dry friction by one sample."""
        r, f = self.real, self._suffix
        lines = [f"  {r} step;", f"  {r} s;"]
        for i, k in enumerate(self.slides):
            decay = f"exp{f}(-fabs{f}(step) / {self.number(self.turns[k].travel)})"
            lines += [
                "  if (state->sliding != 0) {",
                f"    step = q[{k}] - state->slip_q[{i}];",
                f"    s = {self.name}_sign(step);",
                f"    state->slip[{i}] = s + ((state->slip[{i}] - s) * {decay});",
                "  } else {",
                f"    state->slip[{i}] = {self.name}_sign(dq[{k}]);",
                "  }",
                f"  state->slip_q[{i}] = q[{k}];",
            ]
        given = f"struct {self.name}_state *state, const {r} q[{self.n}], const {r} dq[{self.n}]"
        head = f"static void {self.name}_slide({given})"
        return "\n".join([head, "{", *lines, "  state->sliding = 1;", "}", ""])

    def sign(self, k: int) -> str:
        """The sign of joint k's rate, as smooth as the fit had it."""
        rate = self.turns[k].rate if self.turns else 0.0
        direct = f"{self.name}_sign(dq[{k}])"
        if rate > 0:
            direct = f"tanh{self._suffix}(dq[{k}] / {self.number(rate)})"
        if k not in self.slides:
            return direct
        slip = f"state->slip[{self.slides.index(k)}]"
        return f"{slip} * fabs{self._suffix}({direct})" if rate > 0 else slip
