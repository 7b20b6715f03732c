"""Where the minus signs of a program go: differences are turned round until few outputs need a negation.

A difference a - b may be computed as b - a for nothing; a sum of two values that were computed with
opposite signs is a difference, too. So each free node has a choice, and the others follow from it. The
choices are made by votes: every output asks for its sign, and passes the question on to what it is made of.
A negation is an instruction, but no addition or multiplication, so the counted operations stay the same.
"""

from __future__ import annotations

from modelgen.programs.graph import Node, Program

ROUNDS = 12  # the votes settle or cycle long before


def oriented(program: Program) -> Program:
    """The same outputs by the same additions and multiplications, with fewer negations."""
    wanted = [(index, -1 if negative else 1) for index, negative in program.outputs]
    choices = [1] * len(program.nodes)
    best: tuple[int, list[int]] | None = None
    for _ in range(ROUNDS):
        signs, free = _signs(program, choices)
        negations = sum(sign * signs[index] < 0 for index, sign in wanted)
        if best is None or negations < best[0]:
            best = negations, signs
        votes = _votes(program, signs, free, wanted)
        choices = [1 if vote >= 0 else -1 for vote in votes]
    assert best is not None
    return _turned(program, best[1])


def _signs(program: Program, choices: list[int]) -> tuple[list[int], list[bool]]:
    """The sign with which each node is computed, and whether that was a choice."""
    signs, free = [1] * len(program.nodes), [False] * len(program.nodes)
    for v, node in enumerate(program.nodes):
        if node.kind == "*":
            signs[v] = signs[node.a] * signs[node.b]
        elif node.kind in ("+", "-"):
            a, b = signs[node.a], signs[node.b] if node.kind == "+" else -signs[node.b]
            free[v] = a != b
            signs[v] = choices[v] if free[v] else a  # -a - b would need a negation
    return signs, free


def _votes(
    program: Program, signs: list[int], free: list[bool], wanted: list[tuple[int, int]]
) -> list[float]:
    """How much each node is asked to be computed with a plus."""
    votes = [0.0] * len(program.nodes)
    for index, sign in wanted:
        votes[index] += sign
    for v in range(len(program.nodes) - 1, -1, -1):
        node, vote = program.nodes[v], votes[v]
        if node.kind == "*":
            votes[node.a] += vote * signs[node.b]
            votes[node.b] += vote * signs[node.a]
        elif node.kind in ("+", "-") and not free[v]:  # either operand would turn it, if the other did too
            votes[node.a] += vote / 2
            votes[node.b] += vote / 2 if node.kind == "+" else -vote / 2
    return votes


def _turned(program: Program, signs: list[int]) -> Program:
    nodes = []
    for v, node in enumerate(program.nodes):
        if node.kind in ("+", "-"):
            a = signs[v] * signs[node.a]
            b = signs[v] * signs[node.b] * (1 if node.kind == "+" else -1)
            node = Node("+", node.a, node.b) if a == b else Node("-", *(node[1:] if a > 0 else node[:0:-1]))
        nodes.append(node)
    outputs = tuple((index, negative != (signs[index] < 0)) for index, negative in program.outputs)
    return Program(tuple(nodes), outputs)
