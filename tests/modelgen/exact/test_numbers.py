"""Exact numbers: closed forms while they are short, decisions by value, and the linear algebra on them."""

import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from sympy.polys.domains import QQ

from modelgen.exact.linear_algebra import Span
from modelgen.exact.numbers import MP, Exact, Real, digits

C, S = sp.cos(sp.Rational(3, 10)), sp.sin(sp.Rational(3, 10))
RL3, RL5 = sp.Symbol("rl3", real=True), sp.Symbol("rl5", real=True)


def field(*expressions, **constants):
    return Exact(expressions, {name: sp.nsimplify(value) for name, value in constants.items()})


def test_structural_integers_rationals_and_named_numbers():
    exact = field(RL3, rl3="2/5")
    assert [type(exact.number(sp.Integer(k))) for k in (0, 1, -1)] == [int] * 3
    assert exact.number(sp.Rational(39, 100)) == QQ(39, 100)
    rl3 = exact.number(RL3)
    assert isinstance(rl3, Real) and exact.expression(rl3 * rl3 + 1) == RL3**2 + 1
    assert digits(rl3) == MP.mpf(2) / 5
    assert not exact.irrational and field(C, S).irrational


def test_zero_is_decided_by_value():
    exact = field(C, S, RL3, RL5, sp.sqrt(3), rl3="0.4", rl5="0.4")
    c, s, rl3, rl5, root = (exact.number(x) for x in (C, S, RL3, RL5, sp.sqrt(3)))
    assert c * c + s * s == 1  # a known relation
    assert root * root == 3
    assert rl3 - rl5 == 0  # equal by the file's numbers, though named apart
    assert rl3 - rl5 * (1 + QQ(1, 10**30)) != 0


def test_an_angle_that_is_the_sum_of_two_others_is_recognised():
    angles = [sp.Rational(123, 1000), sp.Rational(456, 1000), sp.Rational(579, 1000)]
    cosines, sines = [sp.cos(a) for a in angles], [sp.sin(a) for a in angles]
    exact = field(*cosines, *sines)
    (c1, c2, c3), (s1, s2, _) = [exact.number(x) for x in cosines], [exact.number(x) for x in sines]
    assert c1 * c2 - s1 * s2 - c3 == 0


def test_a_long_form_is_dropped_and_its_digits_stay():
    exact = field(C, S, RL3, RL5, rl3="0.4", rl5="0.39")
    number = exact.number(C) + exact.number(S) * exact.number(RL3) + exact.number(RL5)
    power = number
    for _ in range(6):
        power = power * number
    assert power.form is None
    expected = (sp.cos(0.3) + sp.sin(0.3) * 0.4 + 0.39) ** 7
    assert abs(float(exact.expression(power)) - float(expected)) < 1e-12


def test_reading_numbers_leaves_others_precision_alone():
    import mpmath

    before = mpmath.mp.dps
    field(C).number(C)
    assert mpmath.mp.dps == before


small = st.integers(-3, 3)


@given(st.lists(st.lists(small, min_size=4, max_size=4), max_size=6))
def test_span_is_sympy_s_rank_and_null_space(vectors):
    span = Span(4, [[QQ(x) for x in v] for v in vectors])
    assert len(span.rows) == (sp.Matrix(vectors).rank() if vectors else 0)
    assert span.full == (len(span.rows) == 4)
    null = span.annihilator()
    assert len(null) == 4 - len(span.rows)
    for free, x in null.items():
        assert [x[k] for k in null] == [int(k == free) for k in null]
        assert all(sum(a * b for a, b in zip(v, x, strict=True)) == 0 for v in vectors)


@given(st.lists(st.lists(small, min_size=4, max_size=4), max_size=6))
def test_pivots_are_the_leftmost_possible(vectors):
    span = Span(4, [[QQ(x) for x in v] for v in vectors])
    assert tuple(sorted(span.rows)) == sp.Matrix(len(vectors), 4, [x for v in vectors for x in v]).rref()[1]


def test_a_named_length_of_zero_and_the_difference_of_equal_ones_are_zero():
    exact = field(RL3, RL5, RL3 - RL5, C, rl3="0", rl5="0")
    assert [exact.number(x) for x in (RL3, RL3 - RL5, RL3 * C)] == [0, 0, 0]
    exact = field(RL3, RL5, RL3 - RL5, rl3="0.4", rl5="0.4")
    assert exact.number(RL3 - RL5) == 0 and isinstance(exact.number(RL3), Real)
