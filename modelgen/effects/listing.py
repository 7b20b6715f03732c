"""The catalogue as a table: name, term, parameters with units, who described it; plain text or JSON
values."""

from typing import Any

import sympy as sp

from modelgen.effects.effect import Effect
from modelgen.effects.registry import catalogue


def as_json() -> list[dict[str, Any]]:
    """One object an effect; units are those of a joint that turns (N and m for N m and rad on one that
    slides)."""
    return [
        {
            "effect": e.name,
            "summary": e.summary,
            "term": formula(e),
            "parameters": [{"name": q.name, "unit": q.unit} for q in e.quantities],
            "kind": e.kind,
            "joints": e.joints,
            "signature": e.signature,
            "remedy": e.remedy,
            "source": e.source,
        }
        for e in sorted(catalogue().values(), key=lambda e: e.name)
    ]


def formula(e: Effect) -> str:
    """The terms, each times its linear parameter; of a motion effect, what the link's position changes by."""
    if e.equation:
        return e.equation
    parts = [name if term == 1 else f"{name}*({sp.sstr(term)})" for name, term in e.terms.items()]
    return f"{_LEFT[e.kind]}{' + '.join(parts)}"


_LEFT = {"column": "tau += ", "motion": "q_link = q + ", "measurement": "recorded += ", "load": "tau += "}


def as_text() -> str:
    """The same for reading."""
    lines = []
    for entry in as_json():
        told = ", ".join(f"{p['name']} [{p['unit']}]" for p in entry["parameters"]) or "none"
        lines += [
            f"{entry['effect']}: {entry['summary']}",
            f"  term        {entry['term']}",
            f"  parameters  {told}",
            f"  remedy      {entry['remedy']}",
            f"  source      {entry['source']}",
            "",
        ]
    return "\n".join(lines)
