"""Straight-line programs: the same numbers as plain arithmetic, no operation that is not needed."""

import math
from fractions import Fraction

from hypothesis import given, settings
from hypothesis import strategies as st

from modelgen.programs.graph import Graph, dot
from modelgen.programs.signs import oriented

LEAVES = ("x", "y", "z", 0, 1, -1, 2, Fraction(1, 3))
tree = st.recursive(
    st.sampled_from(LEAVES),
    lambda child: st.one_of(
        st.tuples(st.sampled_from("+-*"), child, child), st.tuples(st.just("neg"), child)
    ),
    max_leaves=25,
)
values = st.fractions(-5, 5, max_denominator=7)


def build(expression, leaf):
    match expression:
        case ("neg", a):
            return -build(a, leaf)
        case ("+", a, b):
            return build(a, leaf) + build(b, leaf)
        case ("-", a, b):
            return build(a, leaf) - build(b, leaf)
        case ("*", a, b):
            return build(a, leaf) * build(b, leaf)
    return leaf(expression)


@settings(deadline=None, max_examples=60)
@given(st.lists(tree, min_size=1, max_size=4), values, values, values)
def test_a_program_is_plain_arithmetic(expressions, x, y, z):
    known = {"x": x, "y": y, "z": z}
    graph = Graph()
    outputs = [
        build(e, lambda a: graph.input(a) if isinstance(a, str) else graph.scalar(a)) for e in expressions
    ]
    program = graph.program(outputs)
    expected = [build(e, lambda a: known[a] if isinstance(a, str) else Fraction(a)) for e in expressions]
    assert program.evaluate(known, number=Fraction) == expected
    turned = oriented(program)
    assert turned.evaluate(known, number=Fraction) == expected and turned.operations == program.operations
    assert sum(negative for _, negative in turned.outputs) <= sum(negative for _, negative in program.outputs)
    named, results = program.intermediates()
    for symbol, expression in named:
        known[symbol.name] = exactly(expression, known)
    assert [exactly(result, known) for result in results] == expected


def exactly(expression, known):
    """A SymPy expression of sums and products in Fractions."""
    if expression.is_Symbol:
        return known[expression.name]
    if expression.is_Rational:
        return Fraction(int(expression.p), int(expression.q))
    arguments = [exactly(a, known) for a in expression.args]
    return sum(arguments) if expression.is_Add else math.prod(arguments)


def count(graph, *outputs):
    operations = graph.program(outputs).operations
    return operations.add, operations.mul


def test_equal_work_is_done_once_and_trivial_work_not_at_all():
    graph = Graph()
    x, y, z = (graph.input(name) for name in "xyz")
    assert count(graph, x * y + z, z + y * x, -(y * -x) + z) == (1, 1)
    assert count(graph, x * 0 + y * 1 - z * 0, -y) == (0, 0)
    assert count(graph, x - y, y - x) == (1, 0)
    assert count(graph, 2 * (3 * x)) == (0, 1)
    assert (x - x).is_zero and (x * 0).is_zero
    assert count(graph, dot((x, y, z), (graph.zero, graph.one, -graph.one))) == (1, 0)


def test_what_no_output_needs_is_dropped():
    graph = Graph()
    x, y = graph.input("x"), graph.input("y")
    _ = x * x * x * y
    program = graph.program([x + y])
    assert program.operations.total == 1 and program.inputs == {"x", "y"}
