"""Regrouping rules as text, JSON, Markdown and LaTeX."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

import sympy as sp
from sympy.printing.latex import LatexPrinter
from sympy.printing.str import StrPrinter

from modelgen.base_parameters.rules import BaseParameter, Rules


class _Printer(StrPrinter):
    """Rationals that end are written as decimals: 0.1521, not 1521/10000."""

    def _print_Mul(self, expr: sp.Mul) -> str:
        factor, rest = expr.as_coeff_Mul()
        if factor.is_Integer or "/" in decimal(factor):
            return super()._print_Mul(expr)
        return f"{decimal(factor)}*" + (f"({self._print(rest)})" if rest.is_Add else self._print(rest))

    def _print_Rational(self, expr: sp.Rational) -> str:
        return decimal(expr)

    def _print_Float(self, expr: sp.Float) -> str:
        return repr(float(expr))


class _LatexPrinter(LatexPrinter):
    def _print_Rational(self, expr: sp.Rational) -> str:
        text = decimal(expr)
        return text if "/" not in text else super()._print_Rational(expr)

    def _print_Float(self, expr: sp.Float) -> str:
        return repr(float(expr))


def decimal(number: sp.Rational) -> str:
    """A rational as a decimal if it has one of at most 15 digits, else as a fraction."""
    p, q = int(number.p), int(number.q)
    digits = 0
    while digits <= 15 and (p * 10**digits) % q:
        digits += 1
    if digits > 15 or q == 1:
        return str(p) if q == 1 else f"{p}/{q}"
    sign, units = "-" if p < 0 else "", str(abs(p) * 10**digits // q).rjust(digits + 1, "0")
    return f"{sign}{units[:-digits]}.{units[-digits:]}"


def regroups(base: BaseParameter) -> str:
    """The combination as text: "ZZ2 + Iam2 + YY3 + 2*rl3*MZ3 + rl3**2*(M3 + M4 + M5 + M6 + M7)"."""
    return combination(base.combination, as_text, "*")


def as_text(coefficient: sp.Expr) -> str:
    """A coefficient in Python's arithmetic."""
    return _Printer({"order": "lex"}).doprint(coefficient)


def combination(
    terms: Mapping[str, sp.Expr],
    write: Callable[[sp.Expr], str],
    times: str,
    name: Callable[[str], str] = str,
) -> str:
    """Sum of coefficient x parameter; parameters that share a coefficient are put in one bracket."""
    shared: dict[tuple[sp.Expr, str], list[str]] = {}
    for parameter, coefficient in terms.items():
        alone = (
            parameter if abs(coefficient) == 1 else ""
        )  # a bracket only saves writing where there is a factor
        shared.setdefault((coefficient, alone), []).append(name(parameter))
    text = ""
    for (coefficient, _), names in shared.items():
        negative = coefficient.could_extract_minus_sign()
        size = -coefficient if negative else coefficient
        text += (" - " if text else "-") if negative else (" + " if text else "")
        if size != 1:
            text += (f"({write(size)})" if size.is_Add else write(size)) + times
        text += names[0] if len(names) == 1 else f"({' + '.join(names)})"
    return text or "0"


def as_json(rules: Rules) -> dict[str, Any]:
    """The rules in the form of contract 8, without the operation counts."""
    return {
        "model": rules.model.name,
        "base_parameters": len(rules.base),
        "parameters": [{"name": b.name, "regroups": regroups(b)} for b in rules.base],
        "unidentifiable": list(rules.unidentifiable),
    }


def latex_name(name: str) -> str:
    """Subscripts: ZZ2R -> ZZ_{2R}, Iam3 -> Iam_{3}."""
    found = re.fullmatch(r"(XX|XY|XZ|YY|YZ|ZZ|MX|MY|MZ|M|Iam|Fvm|Fcm|Offm|Fvl|Fcl|Offl)(\w+)", name)
    return f"{found[1]}_{{{found[2]}}}" if found else name


def _latex(base: BaseParameter) -> str:
    return combination(base.combination, _LatexPrinter({"order": "lex"}).doprint, r"\,", latex_name)


def as_markdown(rules: Rules) -> str:
    """A table of the rules, regrouped parameters only, and what is kept or vanishes in two sentences."""
    lines = [f"## Model {rules.model.name}: {len(rules.base)} base parameters", ""]
    regrouped = [b for b in rules.base if len(b.combination) > 1]
    if regrouped:
        lines += ["| base parameter | regroups |", "|---|---|"]
        lines += [f"| `{b.name}` | `{regroups(b)}` |" for b in regrouped] + [""]
    alone = [b.name for b in rules.base if len(b.combination) == 1]
    lines += [f"Alone: {', '.join(alone) or 'none'}.", ""]
    lines += [f"In no torque: {', '.join(rules.unidentifiable) or 'none'}.", ""]
    return "\n".join(lines)


def as_latex(rules: Rules) -> str:
    """The regrouped parameters as an align* environment."""
    rows = [f"{latex_name(b.name)} &= {_latex(b)}" for b in rules.base if len(b.combination) > 1]
    body = " \\\\\n".join(rows) or "&"
    head = f"% Model {rules.model.name}: {len(rules.base)} base parameters"
    return f"{head}\n\\begin{{align*}}\n{body}\n\\end{{align*}}\n"
