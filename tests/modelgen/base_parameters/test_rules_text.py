"""Rules as text, JSON, Markdown and LaTeX."""

import pytest
import sympy as sp
from hypothesis import given, settings
from random_robots import robots

from modelgen.base_parameters.rules import derive_rules
from modelgen.base_parameters.rules_text import (
    as_json,
    as_latex,
    as_markdown,
    as_text,
    combination,
    decimal,
    regroups,
)
from modelgen.geometry.robot_file import load_robot

LWR = load_robot("kuka_lwr4p")
TEXTS = {b.name: regroups(b) for b in derive_rules(LWR, "A", "L").base}


def test_the_contract_s_example():
    assert TEXTS["ZZ2R"] == "ZZ2 + Iam2 + YY3 + 2*rl3*MZ3 + rl3**2*(M3 + M4 + M5 + M6 + M7)"


def test_signs_and_brackets():
    assert TEXTS["XX3R"] == "XX3 - YY3 + YY4"
    assert TEXTS["MY4R"] == "MY4 - MZ5 - rl5*(M5 + M6 + M7)"
    assert TEXTS["ML"] == "ML"
    x, y = sp.symbols("x y")
    assert combination({"A": -x, "B": -x, "C": x + y}, as_text, "*") == "-x*(A + B) + (x + y)*C"


@pytest.mark.parametrize(
    ("number", "text"),
    [
        ("1521/10000", "0.1521"),
        ("-1/8", "-0.125"),
        ("1/3", "1/3"),
        ("5", "5"),
        ("-7/2", "-3.5"),
        ("1/1000", "0.001"),
    ],
)
def test_decimals(number, text):
    assert decimal(sp.Rational(number)) == text


@settings(max_examples=25, deadline=None, derandomize=True)
@given(robots(6))
def test_a_text_says_what_the_coefficients_are(robot):
    """Read back by SymPy, each text has the rule's coefficients."""
    for base in derive_rules(robot, "A", "L").base:
        names = {name: sp.Symbol(name) for name in base.combination}
        read = sp.expand(sp.sympify(regroups(base), locals=names))
        for name, coefficient in base.combination.items():
            written = read.coeff(names[name])
            value = float(robot.value(coefficient))
            assert abs(float(robot.value(written)) - value) <= 1e-12 * max(1, abs(value))


def test_json_is_the_contract_s():
    document = as_json(derive_rules(LWR, "A", "L"))
    assert document["model"] == "A" and document["base_parameters"] == 79 == len(document["parameters"])
    assert document["parameters"][0] == {"name": "ZZ1R", "regroups": "ZZ1 + Iam1 + YY2"}
    assert "M1" in document["unidentifiable"]


def test_markdown_and_latex():
    rules = derive_rules(LWR, "D")
    assert as_markdown(rules).startswith("## Model D: 28 base parameters") and "Iam1" in as_markdown(rules)
    text = as_latex(derive_rules(LWR, "B"))
    assert r"ZZ_{2R} &= ZZ_{2} + YY_{3} + 2 rl_{3}\,MZ_{3} + rl_{3}^{2}\,(M_{3} + M_{4}" in text
    assert text.count(r"\begin{align*}") == 1 == text.count(r"\end{align*}")
