"""Straight-line programs with shared intermediates: the arithmetic that robot dynamics is written in.

A :class:`Scalar` behaves like a number (+, -, *). Behind it stands a node of a :class:`Graph`; the same
operation on the same operands is the same node, signs travel outside the nodes, zeros and ones vanish.
So a recursion that is written once, in full, costs only what its outputs need: :meth:`Graph.program` keeps
the reachable nodes, and :attr:`Program.operations` counts them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

import sympy as sp

Number = int | float | Fraction


class Node(NamedTuple):
    """One operation: kind "input" (name), "number" (value), "+", "-", "*" (two node indices) or "call".

    @private (inside the graph only; also, pdoc cannot read the annotations of a NamedTuple)
    """

    kind: str
    a: Any
    b: Any = None


class Scalar:
    """A signed reference to a node; immutable."""

    __slots__ = ("graph", "index", "negative")

    def __init__(self, graph: Graph, index: int, negative: bool) -> None:
        self.graph, self.index, self.negative = graph, index, negative

    def __add__(self, other: Scalar | Number) -> Scalar:
        return self.graph.add(self, self.graph.scalar(other))

    def __radd__(self, other: Number) -> Scalar:
        return self.graph.add(self.graph.scalar(other), self)

    def __sub__(self, other: Scalar | Number) -> Scalar:
        return self.graph.add(self, -self.graph.scalar(other))

    def __rsub__(self, other: Number) -> Scalar:
        return self.graph.add(self.graph.scalar(other), -self)

    def __mul__(self, other: Scalar | Number) -> Scalar:
        return self.graph.multiply(self, self.graph.scalar(other))

    __rmul__ = __mul__

    def __neg__(self) -> Scalar:
        return (
            self if self.index == self.graph.zero_index else Scalar(self.graph, self.index, not self.negative)
        )

    @property
    def is_zero(self) -> bool:
        """True for the number 0, known when the program is written."""
        return self.index == self.graph.zero_index

    @property
    def number(self) -> Number | None:
        """The value, when it is known when the program is written."""
        node = self.graph.nodes[self.index]
        if node.kind != "number":
            return None
        return -node.a if self.negative else node.a

    @property
    def key(self) -> tuple[int, bool]:
        """Equal keys are equal expressions."""
        return self.index, self.negative


class Graph:
    """Nodes, each stored once. Numbers are kept positive; the sign is the reference's."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._index: dict[Node, int] = {}
        self.zero_index = self._intern(Node("number", 0))
        self.one_index = self._intern(Node("number", 1))
        self.zero, self.one = Scalar(self, self.zero_index, False), Scalar(self, self.one_index, False)

    def _intern(self, node: Node) -> int:
        found = self._index.get(node)
        if found is None:
            found = self._index[node] = len(self.nodes)
            self.nodes.append(node)
        return found

    def input(self, name: str) -> Scalar:
        """The input of that name."""
        return Scalar(self, self._intern(Node("input", name)), False)

    def scalar(self, value: Scalar | Number) -> Scalar:
        """`value` as a scalar of this graph; sums of whole and broken numbers stay exact (Fraction)."""
        if isinstance(value, Scalar):
            return value
        if isinstance(value, Fraction) and value.denominator == 1:
            value = value.numerator
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        return Scalar(self, self._intern(Node("number", abs(value))), value < 0) if value else self.zero

    def call(self, name: str, argument: Scalar) -> Scalar:
        """A function of one argument, by its C name ("exp", "sin", ...)."""
        return Scalar(self, self._intern(Node("call", name, (argument.index, argument.negative))), False)

    def add(self, x: Scalar, y: Scalar) -> Scalar:
        if x.index == self.zero_index:
            return y
        if y.index == self.zero_index:
            return x
        a, b = x.number, y.number
        if a is not None and b is not None:
            return self.scalar(a + b)
        if x.index == y.index:
            return self.zero if x.negative != y.negative else self.multiply(self.scalar(2), x)
        if x.index > y.index:
            x, y = y, x
        kind = "+" if x.negative == y.negative else "-"
        return Scalar(self, self._intern(Node(kind, x.index, y.index)), x.negative)

    def multiply(self, x: Scalar, y: Scalar) -> Scalar:
        negative = x.negative != y.negative
        if self.zero_index in (x.index, y.index):
            return self.zero
        if x.index == self.one_index:
            return Scalar(self, y.index, negative)
        if y.index == self.one_index:
            return Scalar(self, x.index, negative)
        a, b = x.number, y.number
        if a is not None and b is not None:
            return self.scalar(a * b)
        low, high = (x.index, y.index) if x.index < y.index else (y.index, x.index)
        if self.nodes[high].kind == "number":
            low, high = high, low
        if self.nodes[low].kind == "number" and self.nodes[high].kind == "*":
            inner = self.nodes[high]
            if self.nodes[inner.a].kind == "number":
                factor = self.scalar(self.nodes[low].a * self.nodes[inner.a].a)
                product = self.multiply(factor, Scalar(self, inner.b, False))
                return -product if negative else product
        return Scalar(self, self._intern(Node("*", low, high)), negative)

    def operations(self, outputs: Iterable[Scalar]) -> Operations:
        """What :meth:`program` of these outputs would cost, without writing it."""
        waiting = [output.index for output in outputs]
        seen: set[int] = set()
        add = mul = 0
        while waiting:
            index = waiting.pop()
            if index in seen:
                continue
            seen.add(index)
            kind, a, b = self.nodes[index]
            if kind == "*":
                mul += 1
                waiting += (a, b)
            elif kind == "+" or kind == "-":
                add += 1
                waiting += (a, b)
            elif kind == "call":
                waiting.append(b[0])
        return Operations(add, mul)

    def program(self, outputs: Sequence[Scalar]) -> Program:
        """What `outputs` need and nothing else, in an order in which operands come first."""
        order: list[int] = []
        done: set[int] = set()
        for output in outputs:
            stack = [(output.index, False)]
            while stack:
                index, ready = stack.pop()
                if index in done:
                    continue
                if ready:
                    done.add(index)
                    order.append(index)
                    continue
                stack.append((index, True))
                stack.extend((operand, False) for operand in reversed(_operands(self.nodes[index])))
        place = {index: k for k, index in enumerate(order)}
        nodes = tuple(_renumbered(self.nodes[index], place) for index in order)
        return Program(nodes, tuple((place[o.index], o.negative) for o in outputs))


def _operands(node: Node) -> tuple[int, ...]:
    match node.kind:
        case "+" | "-" | "*":
            return (node.a, node.b)
        case "call":
            return (node.b[0],)
        case _:
            return ()


def _renumbered(node: Node, place: Mapping[int, int]) -> Node:
    match node.kind:
        case "+" | "-" | "*":
            return Node(node.kind, place[node.a], place[node.b])
        case "call":
            return Node("call", node.a, (place[node.b[0]], node.b[1]))
        case _:
            return node


@dataclass(frozen=True, slots=True)
class Operations:
    """Additions (with subtractions) and multiplications of a program."""

    add: int
    mul: int

    @property
    def total(self) -> int:
        return self.add + self.mul


@dataclass(frozen=True, slots=True)
class Program:
    """A straight-line program. `outputs`: (node, negative?) each."""

    nodes: tuple[Node, ...]
    outputs: tuple[tuple[int, bool], ...]

    @property
    def operations(self) -> Operations:
        kinds = [node.kind for node in self.nodes]
        return Operations(add=kinds.count("+") + kinds.count("-"), mul=kinds.count("*"))

    @property
    def inputs(self) -> frozenset[str]:
        """Names of the inputs that are used."""
        return frozenset(str(node.a) for node in self.nodes if node.kind == "input")

    def evaluate(self, inputs: Mapping[str, object], number: Callable[[Number], object] = float) -> list:
        """Run the program on whatever `inputs` holds: floats, arrays, CasADi symbols, exact rationals."""
        values = self.values(inputs, number)
        return [-values[index] if negative else values[index] for index, negative in self.outputs]

    def values(self, inputs: Mapping[str, object], number: Callable[[Number], object] = float) -> list:
        """As `evaluate`, of every node."""
        values: list = []
        for node in self.nodes:
            match node.kind:
                case "input":
                    values.append(inputs[str(node.a)])
                case "number":
                    values.append(number(node.a))
                case "+":
                    values.append(values[node.a] + values[node.b])
                case "-":
                    values.append(values[node.a] - values[node.b])
                case "*":
                    values.append(values[node.a] * values[node.b])
                case kind:
                    raise NotImplementedError(f"node {kind}")
        return values

    def shared(self) -> dict[int, str]:
        """Names of the intermediates that are used more than once, by node: x0, x1, ..."""
        uses = [0] * len(self.nodes)
        for node in self.nodes:
            for operand in _operands(node):
                uses[operand] += 1
        for index, _ in self.outputs:
            uses[index] += 1
        often = (i for i, node in enumerate(self.nodes) if node.kind in "+-*" and uses[i] > 1)
        return {index: f"x{k}" for k, index in enumerate(often)}

    def expression(self, index: int, names: Mapping[int, str]) -> sp.Expr:
        """A node in SymPy, with the symbols of `names` in place of shared intermediates."""
        if index in names:
            return sp.Symbol(names[index], real=True)
        node = self.nodes[index]
        return _sympy(node, {operand: self.expression(operand, names) for operand in _operands(node)})

    def intermediates(self) -> tuple[tuple[tuple[sp.Symbol, sp.Expr], ...], tuple[sp.Expr, ...]]:
        """The program in SymPy: named intermediates (single uses stay in place) and the outputs."""
        names = self.shared()
        expressions: list[sp.Expr] = []
        named: list[tuple[sp.Symbol, sp.Expr]] = []
        for index, node in enumerate(self.nodes):
            expression = _sympy(node, expressions)
            if index in names:
                symbol = sp.Symbol(names[index], real=True)
                named.append((symbol, expression))
                expression = symbol
            expressions.append(expression)
        return tuple(named), tuple(
            -expressions[i] if negative else expressions[i] for i, negative in self.outputs
        )


def _sympy(node: Node, known: Sequence[sp.Expr] | Mapping[int, sp.Expr]) -> sp.Expr:
    match node.kind:
        case "input":
            return sp.Symbol(str(node.a), real=True)
        case "number":
            value = node.a
            return (
                sp.Rational(value.numerator, value.denominator)
                if isinstance(value, Fraction)
                else sp.sympify(value)
            )
        case "+":
            return sp.Add(known[node.a], known[node.b], evaluate=False)
        case "-":
            return sp.Add(known[node.a], sp.Mul(-1, known[node.b], evaluate=False), evaluate=False)
        case "*":
            return sp.Mul(known[node.a], known[node.b], evaluate=False)
        case _:
            raise NotImplementedError(f"node {node.kind}")


def dot(u: Iterable[Scalar], v: Iterable[Scalar]) -> Scalar:
    """u . v"""
    total: Scalar | None = None
    for a, b in zip(u, v):
        total = a * b if total is None else total + a * b
    assert total is not None
    return total
