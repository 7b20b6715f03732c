"""The found effects of a fit on CasADi symbols, for its C: torques of their terms, updates of their states.

An effect that is a column of its joint's own signals is written from its one definition, whatever its name;
its states (the memory of presliding friction) belong to the caller. What is no such column (an elastic gear,
a recorder's delay) or acts in one recording only is left out and told, with the reason.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca

from modelgen.effects.effect import Effect
from modelgen.emit.casadi_functions import to_casadi
from modelgen.geometry.names import Channel, ParameterName

if TYPE_CHECKING:
    from ident.equations.terms import Term


@dataclass(frozen=True, slots=True)
class CEffects:
    """`terms` that are written, labels of others with the reason; joint (from 0) of each state, its first
    value."""

    terms: tuple[Term, ...]
    left_out: Mapping[str, str]
    joints: tuple[int, ...]
    initial: tuple[float, ...]
    timed: bool  # some term reads the time


def written(terms: Sequence[Term]) -> CEffects:
    """Which of a fit's effects can be C."""
    reasons = {term.label: _reason(term) for term in terms}
    fine = tuple(term for term in terms if not reasons[term.label])
    states = [term for term in fine for _ in term.effect.updates]
    return CEffects(
        fine,
        {label: reason for label, reason in reasons.items() if reason},
        tuple(term.place.joint or 0 for term in states),
        tuple(term.effect.state.initial if term.effect.state else 0.0 for term in states),
        any("t" in term.effect.needs for term in fine),
    )


def _reason(term: Term) -> str:
    """Why a term is not in the C, "" where it is."""
    effect, place = term.effect, term.place
    if place.recording is not None or place.comes_and_goes:
        return "it acts in one recording"
    if effect.kind == "measurement":
        return "it is of what is recorded, not of the torque that acts"
    if effect.kind == "motion":
        return "it needs the motion before and after a sample, filtered as in the fit"
    if effect.changes_model or place.joint is None:
        return "it changes what all joints feel; write what it found into the study (gravity:) and fit again"
    kind = type(effect)
    plain = kind.columns is Effect.columns and kind.signals is Effect.signals
    plain &= kind.states is Effect.states or bool(effect.updates)
    return "" if plain and effect.kind == "column" else "it is not a term of its joint's own signals"


def behind_the_gear(parameters: Sequence[str]) -> set[str]:
    """Parameters of the torque that the gears pass on."""
    from ident.equations.fitted import BEFORE_THE_GEAR

    parsed = {name: ParameterName.of(name) for name in parameters}
    return {name for name, its in parsed.items() if its is None or its.kind not in BEFORE_THE_GEAR}


def torques(
    effects: CEffects,
    channels: Sequence[Channel],
    labels: Sequence[str],
    v: Mapping[str, Any],
    link: Any,
    values: Mapping[str, Any],
) -> tuple[Any, Any]:
    """(tau (C,), new states) on CasADi symbols: v has q, dq, ddq, sign, t, z, step; link (n,) tau_link;
    labels of the joints; values {parameter of the fit: number or symbol}."""
    tau, states, state = ca.SX.zeros(len(channels)), [], 0
    for term in effects.terms:
        j, s, effect = term.place.joint, term.place.source, term.effect
        known = {
            "t": v["t"][0],
            "q": v["q"][j],
            "dq": v["dq"][j],
            "ddq": v["ddq"][j],
            "sign_dq": v["sign"][j],
        }
        known |= {"tau_link": link[j]} if "tau_link" in effect.needs else {}
        if "friction" in effect.needs:
            assert j is not None
            behind = term.place.side == "link"
            own = {its.kind: values[name] for name in values if (its := ParameterName.of(name))
                   and its.label == labels[j] and not its.payload}  # fmt: skip
            viscous, dry, offset = (own.get(kind + "ml"[behind], 0.0) for kind in ("Fv", "Fc", "Off"))
            known |= {"friction": viscous * v["dq"][j] + dry * v["sign"][j], "offset": offset}
            if behind:
                known["tau_link"] -= known["friction"] + offset
        if s is not None:
            known |= {"q_source": v["q"][s], "dq_source": v["dq"][s], "ddq_source": v["ddq"][s]}
            known["sign_sum"] = ca.sign(v["dq"][j] + v["dq"][s])
        known |= {
            name: values.get(f"{term.label}.{name}", term.theta[name]) for name in effect.nonlinear_names
        }
        for name, update in effect.updates.items():
            known |= {name: v["z"][state], "step": v["step"][state]}
            states.append(to_casadi(update, known))
            state += 1
        for number, name in enumerate(term.linear):
            size = values.get(f"{term.label}.{name}", term.size[number])
            column = size * to_casadi(effect.terms[name], known)
            for row, sign in term.place.rows(channels).items():
                tau[row] += sign * column
    return tau, ca.vertcat(*states)
