"""The paper's regrouped parameters against the derived ones, line by line, each difference with its evidence.

Kept columns are independent, so the coefficients of a rule are unique: where a printed coefficient differs
from the derived one, some state tells which is right. The states used are so plain that the column of a
standard parameter, what the printed line makes of it and what the derived rule makes of it are short
expressions in rl3 and rl5 that can be redone by hand.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import sympy as sp

from modelgen.base_parameters.rules import BaseParameter, Rules, derive_all, derive_rules
from modelgen.base_parameters.rules_text import as_text, regroups
from modelgen.dynamics.models import standard_regressor
from modelgen.geometry.kinematics import State, symbolic_geometry
from modelgen.geometry.robot import Robot
from modelgen.paper.rules import COUNTS, PRINTED_ANTECEDENTS, PRINTED_RULES, PrintedRule

QUARTER_TURNS = {"0": (1, 0), "pi/2": (0, 1), "pi": (-1, 0), "-pi/2": (0, -1)}


@dataclass(frozen=True, slots=True)
class Evidence:
    """One entry of W_st at one state, and what the printed and the derived line say it is."""

    parameter: str
    channel: str
    state: str
    actual: sp.Expr
    printed: sp.Expr
    derived: sp.Expr


@dataclass(frozen=True, slots=True)
class Comparison:
    """One printed line in one model: the terms (parameter, printed, derived coefficient) that differ."""

    line: PrintedRule
    model: str
    derived: str
    differences: tuple[tuple[str, sp.Expr, sp.Expr], ...]
    evidence: Evidence | None


def compare(robot: Robot, rules: Mapping[str, Rules]) -> tuple[Comparison, ...]:
    """Every printed line in every model it is printed for."""
    result = []
    for line in PRINTED_RULES:
        printed = line.combination()
        for model in line.models:
            base = next((b for b in rules[model].base if b.name == line.name), None)
            derived = dict(base.combination) if base else {}
            differences = tuple(
                (name, printed.get(name, sp.Integer(0)), derived.get(name, sp.Integer(0)))
                for name in dict.fromkeys((*printed, *derived))
                if sp.expand(printed.get(name, 0) - derived.get(name, 0)) != 0
            )
            evidence = None
            if base and differences:
                name, as_printed, _ = differences[-1]
                evidence = find_evidence(robot, rules[model], name, base.keeps.name, as_printed)
            result.append(Comparison(line, model, regroups(base) if base else "", differences, evidence))
    return tuple(result)


def unlisted(rules: Mapping[str, Rules]) -> dict[str, tuple[str, ...]]:
    """Regrouped parameters that the derivation finds and the table does not list, by model."""
    listed = {(model, line.name) for line in PRINTED_RULES for model in line.models}
    return {
        m: tuple(b.name for b in r.base if b.name.endswith("R") and (m, b.name) not in listed)
        for m, r in rules.items()
    }


def find_evidence(robot: Robot, rules: Rules, name: str, kept: str, printed: sp.Expr) -> Evidence:
    """The first entry of column `name` that the coefficient `printed` on column `kept` gets wrong."""
    geometry = symbolic_geometry(robot)
    derived = rules.columns[name]
    wanted = [p for p in rules.standard if p.name in {name, kept, *derived}]
    for angles, dq, ddq in _plain_states(robot.n):
        c, s = zip(*(QUARTER_TURNS[a] for a in angles), strict=True)
        state = State(c, s, [0] * robot.n, dq, ddq)
        W = standard_regressor(robot, geometry, rules.model, state, [int(x > 0) for x in dq], wanted)
        for row, channel in enumerate(rules.channels):
            by_rule = sp.expand(sum(k * W[n][row] for n, k in derived.items()))
            by_line = sp.expand(by_rule + (printed - derived.get(kept, 0)) * W[kept][row])
            actual = sp.expand(W[name][row])
            if by_line != actual:
                return Evidence(name, channel, _state_text(angles, dq, ddq), actual, by_line, by_rule)
    raise AssertionError(f"no state tells {name} apart")


def _plain_states(n: int) -> Iterator[tuple[list[str], list[int], list[int]]]:
    """States with at most one angle, one rate and one acceleration that are not zero."""
    some = range(n + 1)  # n stands for none
    for i, k, m in sorted(itertools.product(some, some, some), key=lambda t: sum(x < n for x in t)):
        angles, dq, ddq = ["0"] * n, [0] * n, [0] * n
        if i < n:
            angles[i] = "pi/2"
        if k < n:
            dq[k] = 2
        if m < n:
            ddq[m] = 1
        yield angles, dq, ddq


def _state_text(angles: list[str], dq: list[int], ddq: list[int]) -> str:
    parts = [f"q{k} = {a}" for k, a in enumerate(angles, 1) if a != "0"]
    parts += [f"dq{k} = {x}" for k, x in enumerate(dq, 1) if x]
    parts += [f"ddq{k} = {x}" for k, x in enumerate(ddq, 1) if x]
    return ", ".join([*parts, "the rest 0"])


def document(robot: Robot) -> str:
    """The comparison as Markdown, to lie beside the generated rules."""
    payload = next(iter(robot.payloads))
    rules = derive_all(robot, payload)
    comparisons = compare(robot, rules)
    agree = [c for c in comparisons if not c.differences]
    lines = [
        "# The paper's Appendix 1 against the derivation",
        "",
        "Written by regenerate-model; do not edit. Printed is what Jubien, Gautier and Janot (2014) have in",
        'their "Table III", derived what `modelgen` finds exactly from Table I. Kept columns are',
        "independent, so coefficients are unique, and one entry of the regressor decides each difference.",
        "",
        f"{len(agree)} of {len(comparisons)} printed lines agree, signs included (counted once per model).",
        "",
        *_disagreements(comparisons),
        *_unlisted(robot, rules),
        *_other_slips(robot, rules, payload),
        "## Lines that agree",
        "",
        "| line | models |",
        "|---|---|",
    ]
    models: dict[tuple[str, str], str] = {}
    for c in agree:
        key = (c.line.name, c.line.regroups)
        models[key] = models.get(key, "") + c.model
    lines += [f"| `{name} = {text}` | {', '.join(where)} |" for (name, text), where in models.items()]
    return "\n".join(lines) + "\n"


def _disagreements(comparisons: tuple[Comparison, ...]) -> list[str]:
    """One entry per printed line; the friction lines, printed once for all j, by their first joint."""
    lines = ["## Lines that differ", ""]
    same: dict[str, list[Comparison]] = {}
    for c in comparisons:
        if c.differences:
            line = f"{c.line.name} = {c.line.regroups}"
            same.setdefault(re.sub("[1-7]", "j", line) if line.startswith("F") else line, []).append(c)
    for printed, found in same.items():
        first = found[0]
        derived = f"{first.line.name} = {first.derived}"
        models = ", ".join(dict.fromkeys(c.model for c in found))
        lines += [f"### `{printed.split()[0]}`, model{'s' if ',' in models else ''} {models}", ""]
        lines += [f"- printed: `{printed}`", f"- derived: `{derived}`"]
        if e := first.evidence:
            lines += [
                f"- evidence: at {e.state}, the column of `{e.parameter}` in the row of `{e.channel}` is"
                f" `{as_text(e.actual)}`; the printed line makes it `{as_text(e.printed)}`, the derived one"
                f" `{as_text(e.derived)}`."
            ]
        lines += [""]
    return lines


def _unlisted(robot: Robot, rules: Mapping[str, Rules]) -> list[str]:
    lines = ["## Regroupings that the table does not list", ""]
    for model, names in unlisted(rules).items():
        if names:
            bases = [next(b for b in rules[model].base if b.name == name) for name in names]
            lines.append(f"- model {model}: " + ", ".join(f"`{b.name} = {regroups(b)}`" for b in bases))
    lines += [
        "",
        "In model A `Offm` and `Offl` have the same column, the constant 1 in row j, and `Fcm` and `Fcl`",
        "both have sign(dq_j). Were `Offl` or `Fcl` left apart, model A would count 7 more columns than its",
        f"rank for each; the paper's own b = {COUNTS['A']} needs both regroupings.",
        "",
    ]
    return lines


def _other_slips(robot: Robot, rules: Mapping[str, Rules], payload: str) -> list[str]:
    count = {model: len(r.base) for model, r in rules.items()}
    on_2 = replace(robot, payloads={payload: PRINTED_ANTECEDENTS[8]})
    shown = sum(b.keeps.payload for b in derive_rules(on_2, "A", payload).base)
    star = replace(
        robot,
        links=tuple(replace(x, antecedent=PRINTED_ANTECEDENTS[j]) for j, x in enumerate(robot.links, 1)),
        payloads=on_2.payloads,
    )
    as_printed = {model: len(r.base) for model, r in derive_all(star, payload).items()}
    n = robot.n
    rotors = [b.name for b in rules["A"].base if len(b.combination) > 1 and _has_rotor(b)]
    text = ", ".join(f"{model} {number}" for model, number in count.items())
    literally = ", ".join(f"{model} {number}" for model, number in as_printed.items())
    verdict = "agree with" if count == COUNTS else "contradict"
    statements = [
        f"Section 4.1, base parameters with payload: derived {text}; these {verdict} the paper.",
        f"Section 5, two drive inertias regroup in model A: right, in {' and '.join(rotors)}. In model C none"
        " does, because the sensor rows hold the links without the rotors.",
        "Section 4.4, ZZ2R of model A against ZZ2R + Iam2 of model C: the derived rules make them equal"
        " (4.46 against 1.28 + 3.05 in Table II, 2.9 %).",
        "Table I prints a(j) = 0 for rows 1 to 7. Read literally, seven arms on one base, the counts would be"
        f" {literally}; the serial chain a(j) = j - 1 gives the paper's.",
        "Table I prints the antecedent 2 for the payload, section 3.2 fixes it to link n. Held by link 2 it"
        f" would show {shown} of its ten parameters, and model A would have {count['A'] - 10 + shown} base"
        f" parameters; held by link 7 it shows all ten, as b = {COUNTS['A']} needs.",
        "Section 4.3 repeats the friction slip: model A's Fcm is said to be Fcm + Fvl; it is Fcm + Fcl.",
        f"Section 2, Ns = 17 n is the count of A and C ({len(rules['A'].standard) - 10} without payload,"
        f" n = {n}); B has 13 n = {len(rules['B'].standard) - 10}, D has 4 n = {len(rules['D'].standard)}."
        " The n x Ns matrix has 2 n rows in model C (eq. 5).",
        "Section 2 counts friction into H(q, dq), and eqs. (1) and (2) add it again; H is taken without it.",
        "The text calls the regrouping table IV; it is printed as table III.",
    ]
    title = "## Counts, and other statements that the derivation can judge"
    return [title, "", *(f"- {statement}" for statement in statements), ""]


def _has_rotor(base: BaseParameter) -> bool:
    return any(name.startswith("Iam") for name in base.combination)
