"""Appendix 1 of the paper ("Table III") and its Table I as data, exactly as printed, slips included.

Jubien, Gautier and Janot (2014), "Dynamic identification of the Kuka LWR robot using motor torques and joint
torque sensors data". `paper_comparison` confronts it with the derivation.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from modelgen.dynamics.newton_euler import INERTIAL
from modelgen.geometry.expressions import parse

ROBOT = "kuka_lwr4p"
LENGTHS = ("rl3", "rl5")
COUNTS = {"A": 79, "B": 74, "C": 102, "D": 28}  # section 4.1, with the payload
PRINTED_ANTECEDENTS = {**dict.fromkeys(range(1, 8), 0), 8: 2}  # Table I; row 8 is the payload

_MASSES_3 = "(M3 + M4 + M5 + M6 + M7)"
_MASSES_5 = "(M5 + M6 + M7)"


@dataclass(frozen=True, slots=True)
class PrintedRule:
    """One line of the table: in the models named, `name` stands for `regroups`."""

    models: str
    name: str
    regroups: str

    def combination(self) -> dict[str, sp.Expr]:
        """Coefficients of the standard parameters in the line."""
        kinds = (*INERTIAL, "Iam", "Fvm", "Fcm", "Fvl", "Fcl")
        parameters = {f"{kind}{j}": sp.Symbol(f"{kind}{j}", real=True) for kind in kinds for j in range(1, 8)}
        lengths = {name: sp.Symbol(name, real=True) for name in LENGTHS}
        expression = sp.expand(parse(self.regroups, parameters | lengths))
        found = {name: expression.coeff(symbol) for name, symbol in parameters.items()}
        return {name: coefficient for name, coefficient in found.items() if coefficient != 0}


PRINTED_RULES = (
    PrintedRule("A", "ZZ1R", "ZZ1 + Iam1 + YY2"),
    PrintedRule("BC", "ZZ1R", "ZZ1 + YY2"),
    PrintedRule("A", "ZZ2R", f"ZZ2 + Iam2 + YY3 + 2*rl3*MZ3 + rl3**2*{_MASSES_3}"),
    PrintedRule("BC", "ZZ2R", f"ZZ2 + YY3 + 2*rl3*MZ3 + rl3**2*{_MASSES_3}"),
    *(PrintedRule("A", f"Fvm{j}R", f"Fvm{j} + Fvl{j}") for j in range(1, 8)),
    *(PrintedRule("A", f"Fcm{j}R", f"Fcm{j} + Fvl{j}") for j in range(1, 8)),
    PrintedRule("ABC", "XX2R", f"XX2 - YY2 + YY3 + 2*rl3*MZ3 + rl3**2*{_MASSES_3}"),
    PrintedRule("ABC", "MY2R", f"MY2 + MZ3 + rl3*{_MASSES_3}"),
    PrintedRule("ABC", "XX3R", "XX3 - YY3 + YY4"),
    PrintedRule("ABC", "ZZ3R", "ZZ3 + YY4"),
    PrintedRule("ABC", "MY3R", "MY3 + MZ4"),
    PrintedRule("ABC", "XX4R", f"XX4 - YY4 + YY5 + 2*rl3*MZ5 + rl3**2*{_MASSES_5}"),
    PrintedRule("ABC", "ZZ4R", f"ZZ4 + YY5 + 2*rl3*MZ5 + rl3**2*{_MASSES_5}"),
    PrintedRule("ABC", "MY4R", f"MY4 - MZ5 - rl3*{_MASSES_5}"),
    PrintedRule("ABC", "XX5R", "XX5 - YY5 + YY6"),
    PrintedRule("ABC", "ZZ5R", "ZZ5 + YY6"),
    PrintedRule("ABC", "MY5R", "MY5 - MZ6"),
    PrintedRule("ABC", "XX6R", "XX6 - YY6 + YY7"),
    PrintedRule("ABC", "ZZ6R", "ZZ6 + YY7"),
    PrintedRule("ABC", "MY6R", "MY6 + MZ7"),
    PrintedRule("ABC", "XX7R", "XX7 - YY7"),
)
