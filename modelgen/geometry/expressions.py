"""Values of a robot file: arithmetic over numbers, `pi` and named constants, never evaluated as code."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping

import sympy as sp

from modelgen.errors import ExpressionError, shortened

LONGEST_TEXT = 200
LARGEST_EXPONENT = 8
LARGEST_NUMBER = 1e12
SMALLEST_NUMBER = 1e-12

_BINARY = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
}


def parse(value: object, symbols: Mapping[str, sp.Expr]) -> sp.Expr:
    """Return `value` (a number, or text such as "q2 - pi/2") as an exact SymPy expression.

    Decimals become the rationals they print as (0.39 is 39/100). Names are looked up in `symbols`;
    `pi` is always known. Raises ExpressionError, whose sentence starts with the value.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ExpressionError(
            value, "is not a number or an expression; write for example 0.39 or 'q2 - pi/2'"
        )
    if isinstance(value, str):
        if len(value) > LONGEST_TEXT:
            raise ExpressionError(
                value, f"is longer than {LONGEST_TEXT} characters; write a shorter expression"
            )
        try:
            tree = ast.parse(value.strip(), mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError):
            raise ExpressionError(
                value, "is not an arithmetic expression; use numbers, pi, names and + - * / **"
            ) from None
        return _convert(tree, value, symbols)
    return _number(value, value)


def _convert(node: ast.AST, text: str, symbols: Mapping[str, sp.Expr]) -> sp.Expr:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return _number(number, text)
        case ast.Name(id="pi"):
            return sp.pi
        case ast.Name(id=name):
            if name not in symbols:
                known = shortened(", ".join(["pi", *symbols]))
                raise ExpressionError(
                    text,
                    f"uses the unknown symbol {shortened(name)}; declare it under constants "
                    f"(known here: {known})",
                )
            return symbols[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_convert(operand, text, symbols)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _convert(operand, text, symbols)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            exponent = _convert(right, text, symbols)
            if not (exponent.is_Integer and abs(exponent) <= LARGEST_EXPONENT):
                raise ExpressionError(
                    text,
                    f"has a power that is not an integer up to {LARGEST_EXPONENT}; write the product out",
                )
            base = _convert(left, text, symbols)
            if abs(exponent) > 1 and base.has(sp.Pow):
                raise ExpressionError(text, "has a power of a power; write the product out")
            power = _bounded(base ** abs(exponent), text)
            return power if exponent >= 0 else _divided(sp.Integer(1), power, text)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            a, b = _convert(left, text, symbols), _convert(right, text, symbols)
            return (
                _divided(a, b, text) if isinstance(op, ast.Div) else _bounded(_BINARY[type(op)](a, b), text)
            )
        case _:
            raise ExpressionError(
                text, "is not plain arithmetic; use only numbers, pi, declared names and + - * / **"
            )


def _divided(a: sp.Expr, b: sp.Expr, text: str) -> sp.Expr:
    if b.is_zero:
        raise ExpressionError(text, "divides by zero; correct the divisor")
    return _bounded(a / b, text)


def _bounded(value: sp.Expr, text: str) -> sp.Expr:
    """An intermediate result that is a number must be one that a robot can have."""
    if value.is_Rational:
        _check_size(value, text)
    return value


def _check_size(number: int | float | sp.Rational, text: object) -> None:
    if number and not SMALLEST_NUMBER <= abs(number) <= LARGEST_NUMBER:
        raise ExpressionError(
            text, f"holds a number outside {SMALLEST_NUMBER:g} to {LARGEST_NUMBER:g}; check its unit"
        )


def _number(number: int | float, text: object) -> sp.Expr:
    if isinstance(number, float) and not math.isfinite(number):
        raise ExpressionError(text, "is not a finite number; write the length in m or the angle in rad")
    _check_size(number, text)
    return sp.Rational(repr(number))
