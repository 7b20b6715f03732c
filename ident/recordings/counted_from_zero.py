"""Columns of a log whose joints are counted from 0, as programs count, and not from 1."""

from __future__ import annotations

from collections.abc import Collection, Iterable

KINDS = ("q", "dq", "tau_m", "tau_l", "i")


def from_zero(columns: Collection[str], joints: Iterable[object]) -> str:
    """What the study has to say in `columns:` for joints 1 to n where there are columns of q0 to q(n - 1);
    nothing elsewhere."""
    numbers = [str(joint) for joint in joints]
    n = len(numbers)
    if numbers != [str(j) for j in range(1, n + 1)] or not all(f"q{j}" in columns for j in range(n)):
        return ""
    kinds = [kind for kind in KINDS if all(f"{kind}{j}" in columns for j in range(n))]
    return f"{{{', '.join(f'{kind}{j + 1}: {kind}{j}' for kind in kinds for j in range(n))}}}"
