"""What the recordings of a diagnosis say of two suspects: `separate.so_far` in diagnosis.json."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ident.diagnosis.telling.deciding import NOTHING, SoFar

Before = Callable[[str, str], SoFar]  # of the labels of two suspects


def nothing(a: str, b: str) -> SoFar:
    return NOTHING


def written(a: str, b: str, its: SoFar) -> dict[str, Any]:
    """Plain values."""
    rates = [[float(f"{rate:.6g}") for rate in way] for way in its.rates]
    both = {"per_second": rates, "alone": list(its.alone)}
    return {"suspects": [a, b], "ahead": its.ahead, "seconds": its.seconds, **both}


def so_far(entries: Sequence[Mapping[str, Any]], a: str, b: str) -> SoFar:
    """What is said of two labels, in either order. ValueError, KeyError, TypeError: no such document."""
    for its in entries:
        if {a, b} == set(its["suspects"]):
            first, second = (tuple(map(float, way)) for way in its["per_second"])
            alone = tuple(map(float, its["alone"]))
            seconds = float(its["seconds"])
            found = SoFar(float(its["ahead"]), (first, second), (alone[0], alone[1]), seconds)
            return found if its["suspects"][0] == a else found.other_way
    return NOTHING
