"""The paper's Appendix 1 line by line: which lines agree, which do not, and that the evidence is evidence."""

import pytest
import sympy as sp

from modelgen.base_parameters.rules import derive_all
from modelgen.geometry.robot_file import load_robot
from modelgen.paper.comparison import compare, document, unlisted
from modelgen.paper.rules import COUNTS, PRINTED_RULES, ROBOT

LWR = load_robot(ROBOT)
RULES = derive_all(LWR, "L")


@pytest.fixture(scope="module")
def comparisons():
    return compare(LWR, RULES)


def test_the_lines_that_differ_are_the_known_slips(comparisons):
    wrong = {(c.model, c.line.name) for c in comparisons if c.differences}
    friction = {("A", f"Fcm{j}R") for j in range(1, 8)}
    lengths = {(m, name) for m in "ABC" for name in ("XX4R", "ZZ4R", "MY4R")}
    assert wrong == friction | lengths


def test_each_difference_is_rl3_for_rl5_or_fvl_for_fcl(comparisons):
    rl3, rl5 = sp.symbols("rl3 rl5", real=True)
    for c in comparisons:
        for name, printed, derived in c.differences:
            if name.startswith("F"):
                assert (printed, derived) == ((1, 0) if name.startswith("Fvl") else (0, 1))
            else:
                assert sp.expand(printed.subs(rl3, rl5) - derived) == 0


def test_the_evidence_decides(comparisons):
    for c in comparisons:
        if c.differences:
            assert c.evidence.actual == c.evidence.derived != c.evidence.printed


def test_what_the_table_does_not_list():
    assert unlisted(RULES) == {"A": tuple(f"Offm{j}R" for j in range(1, 8)), "B": (), "C": (), "D": ()}


def test_every_line_is_a_rule_of_kept_parameter_and_others():
    for line in PRINTED_RULES:
        combination = line.combination()
        assert combination[line.name.removesuffix("R")] == 1 and len(combination) > 1


def test_the_document_is_deterministic_and_says_what_was_found():
    text = document(LWR)
    assert text == document(load_robot(ROBOT))
    for words in (
        "49 of 65 printed lines agree",
        "rl5**2*(M5 + M6 + M7)",
        "77 base",
        "A 79, B 74, C 102, D 28",
    ):
        assert words in text
    assert {m: len(r.base) for m, r in RULES.items()} == COUNTS
