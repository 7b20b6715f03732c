"""SymPy expressions with shared intermediate symbols -> CasADi functions.

C is generated from two inner functions, of which cos q and sin q are inputs, so that they are +, - and x:

    columns(c, s, q, dq, ddq, sign, extra) -> entries       the entries of W that differ from each other
    torque(c, s, q, dq, ddq, sign, chi) -> tau              one per channel

and two outer ones, in q, are for optimal control: regressor(q, dq, ddq[, extra]) -> W and
torque(q, dq, ddq, chi) -> tau.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import sympy as sp

from modelgen.emit.description import Derived
from modelgen.programs.graph import Program

STATE = ("c", "s", "q", "dq", "ddq", "sign")

_CALLS = {
    sp.exp: ca.exp,
    sp.sin: ca.sin,
    sp.cos: ca.cos,
    sp.tanh: ca.tanh,
    sp.Abs: ca.fabs,
    sp.sign: ca.sign,
}


def to_casadi(expression: sp.Expr, known: Mapping[str, Any]) -> Any:
    """A SymPy expression in CasADi; symbols are looked up in `known` by name."""
    if expression.is_Symbol:
        return known[expression.name]
    if expression.is_number:
        return float(expression)
    if expression.is_Add:
        total = to_casadi(expression.args[0], known)
        for term in expression.args[1:]:
            if term.is_Mul and term.args[0] == -1 and len(term.args) == 2:
                total = total - to_casadi(term.args[1], known)
            else:
                total = total + to_casadi(term, known)
        return total
    arguments = [to_casadi(a, known) for a in expression.args]
    if expression.is_Mul:
        product = arguments[0]
        for value in arguments[1:]:
            product = product * value
        return product
    if expression.is_Pow:
        base, exponent = arguments
        if expression.exp == sp.Rational(1, 2):
            return ca.sqrt(base)
        if expression.exp.is_Integer and 0 < int(expression.exp) <= 8:
            power = base
            for _ in range(int(expression.exp) - 1):
                power = power * base
            return power
        return 1 / base if expression.exp == -1 else base**exponent
    if expression.func in _CALLS:
        return _CALLS[expression.func](*arguments)
    raise NotImplementedError(f"{expression.func} in {expression}")


def program_outputs(program: Program, inputs: Mapping[str, Any], terms: Sequence[sp.Expr] = ()) -> Any:
    """The outputs of a program, then `terms`, on CasADi symbols: a column vector."""
    nodes, names = program.values(inputs), program.shared()
    known = {**inputs, **{name: nodes[index] for index, name in names.items()}}
    values = []
    for index, negative in program.outputs:
        if negative and index not in names:  # SymPy takes a minus inside
            values.append(to_casadi(-program.expression(index, names), known))
        else:
            values.append(-nodes[index] if negative else nodes[index])
    values += [to_casadi(e, known) for e in terms]
    return ca.vertcat(*values) if values else ca.SX(0, 1)


def inner_functions(derived: Derived) -> dict[str, ca.Function]:
    """{"columns", "torque"}; see the module's docstring."""
    inputs, arguments = _state(derived)
    description = derived.description
    extra = ca.SX.sym("extra", len(description["extra_inputs"]))
    chi = ca.SX.sym("chi", len(description["parameters"]))
    with_extra = inputs | {name: extra[i] for i, name in enumerate(description["extra_inputs"])}
    with_chi = with_extra | {f"chi{b}": chi[b] for b in range(chi.numel())}
    W = program_outputs(derived.columns, with_extra, derived.terms)
    tau = torque_outputs(derived, with_chi)
    names = list(STATE)
    return {
        "columns": ca.Function("columns", [*arguments, extra], [W], [*names, "extra"], ["W"]),
        "torque": ca.Function("torque", [*arguments, extra, chi], [tau], [*names, "extra", "chi"], ["tau"]),
    }


def torque_outputs(derived: Derived, inputs: Mapping[str, Any]) -> Any:
    """Torques of the robot's own model, and what the effects' columns add."""
    tau = program_outputs(derived.torque, inputs)
    first = len(derived.columns.outputs)
    added: dict[int, Any] = {}
    for channel, parameter, source in derived.description["nonzeros"]:
        if isinstance(source, int) and source >= first:
            value = inputs[f"chi{parameter}"] * to_casadi(derived.terms[source - first], inputs)
            added[channel] = added.get(channel, 0) + value
    return ca.vertcat(*(tau[i] + added.get(i, 0) for i in range(tau.numel())))


def _state(derived: Derived) -> tuple[dict[str, Any], list[Any]]:
    labels = [joint["label"] for joint in derived.description["joints"]]
    inputs: dict[str, Any] = {}
    arguments = []
    for name in STATE:
        vector = ca.SX.sym(name, len(labels))
        arguments.append(vector)
        inputs |= {name + k: vector[i] for i, k in enumerate(labels)}
    return inputs, arguments


def outer_functions(derived: Derived) -> dict[str, ca.Function]:
    """{"regressor", "torque"} of q (n,), dq, ddq, with sign(dq) inside."""
    inner = inner_functions(derived)
    description = derived.description
    n, b = len(description["joints"]), len(description["parameters"])
    q, dq, ddq = (ca.SX.sym(name, n) for name in ("q", "dq", "ddq"))
    extra, chi = ca.SX.sym("extra", len(description["extra_inputs"])), ca.SX.sym("chi", b)
    state = [ca.cos(q), ca.sin(q), q, dq, ddq, ca.sign(dq)]
    entries = inner["columns"](*state, extra)
    W = ca.SX(len(description["channels"]), b)
    signals = {"dq": dq, "ddq": ddq, "sign": ca.sign(dq)}
    for channel, parameter, source in description["nonzeros"]:
        W[channel, parameter] = entry(source, entries, signals)
    more, more_names = ([extra], ["extra"]) if extra.numel() else ([], [])
    names = ["q", "dq", "ddq"]
    return {
        "regressor": ca.Function("regressor", [q, dq, ddq, *more], [W], [*names, *more_names], ["W"]),
        "torque": ca.Function(
            "torque",
            [q, dq, ddq, chi, *more],
            [inner["torque"](*state, extra, chi)],
            [*names, "chi", *more_names],
            ["tau"],
        ),
    }


def entry(source: int | str, entries: Any, signals: Mapping[str, Any]) -> Any:
    """What stands at a non-zero of W: an entry, a joint's signal, or 1."""
    if isinstance(source, int):
        return entries[source]
    if source == "one":
        return 1
    name = source.rstrip("0123456789")
    return signals[name][int(source[len(name) :])]
