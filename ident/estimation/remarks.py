"""What a fit says about itself in words: what the motion leaves open, numbers that no robot has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ident.equations.observation import RecordingSystem
from ident.equations.terms import Term
from ident.estimation.least_squares import Estimate, not_negative
from ident.recordings.study import Study


def impossible(estimate: Estimate, std: np.ndarray, terms: Sequence[Term] = ()) -> dict[str, str]:
    """{parameter: why}: values that physics forbids by more than their standard deviation (b,)."""
    out = {}
    for k in np.flatnonzero(estimate.active):
        name, value = estimate.parameters[k], float(estimate.chi[k])
        if not_negative(name) and value < -std[k]:
            out[name] = (
                "friction, rotor inertia and mass are not negative; a wrong sign, a bad recording or a term "
                "that the model lacks makes them so"
            )
    place = {name: k for k, name in enumerate(estimate.parameters)}
    for term in terms:
        at = [place[name] for name in term.names]
        if not estimate.active[at].any():
            continue
        best = {n: x - np.sign(x) * std[k] for n, x, k in zip((*term.unknown, *term.free), term.at, at)}
        sure = all(abs(x) > std[k] for x, k in zip(term.at, at) if estimate.active[k])
        values = {**dict(zip(term.linear, term.size)), **term.theta}
        reason = term.effect.physical(values)
        if reason and sure and term.effect.physical({**values, **best}):
            out.update(dict.fromkeys(term.names, f"{term.label}: {reason}"))
    return out


def excitation_warnings(full: Estimate, systems: Sequence[RecordingSystem]) -> list[str]:
    """Which parameters the motion leaves open, in words."""
    out = [
        f"{dependence.sentence()}; the identify recordings cannot tell them apart"
        if dependence.seen_in
        else f"{dependence.sentence()} by the identify recordings"
        for dependence in full.dependent
    ]
    if full.weak:
        out.append(
            f"the motion hardly excites {', '.join(full.weak)} "
            f"(condition number {full.condition_number:.3g}); "
            "add motions that move those joints faster and at other postures"
        )
    if len(systems) > 1:
        out += _blind_runs(full, systems)
    return out


def _blind_runs(full: Estimate, systems: Sequence[RecordingSystem]) -> list[str]:
    """Recordings whose motion leaves a parameter out that another one excites."""
    b = len(full.chi)
    lengths = np.zeros((len(systems), b))
    carried = np.zeros((len(systems), b), bool)
    for k, system in enumerate(systems):
        for factor, sigma in zip(system.factors, full.sigma):
            lengths[k, factor.columns] += np.sum((factor.R[:, :-1] / sigma) ** 2, axis=0) / max(
                factor.rows, 1
            )
            carried[k, factor.columns] = True
    best = lengths.max(axis=0)
    out = []
    for k, system in enumerate(systems):
        blind = [full.parameters[i] for i in np.flatnonzero(carried[k] & (lengths[k] < 1e-4 * best))]
        if blind:
            out.append(
                f"{system.label} does not excite {', '.join(blind[:8])}{' ...' if len(blind) > 8 else ''}"
            )
    return out


def implausible(estimate: Estimate) -> list[str]:
    """Masses of tonnes and friction of kilonewton metres: torque is in N mm, or in drive units."""
    heavy = [
        name
        for name, value in zip(estimate.parameters, estimate.chi)
        if abs(value) > 5e4 or (name[0] == "M" and name[1:2] not in "XYZ" and abs(value) > 2e3)
    ]
    if not heavy:
        return []
    return [
        f"parameters such as {heavy[0]} come out larger than robots are; "
        "torque looks recorded in N mm or in drive "
        "units, if so give scale: 0.001 or drive_gains in the study"
    ]


def payload_notes(study: Study, estimate: Estimate, covariance: np.ndarray) -> list[str]:
    out = []
    for label, mass in study.payload_mass.items():
        name = f"M{label}"
        if name in estimate.parameters and estimate.active[estimate.parameters.index(name)]:
            k = estimate.parameters.index(name)
            out.append(
                f"{name} identified as {estimate.chi[k]:.4g} kg (std {np.sqrt(covariance[k, k]):.2g}), "
                f"weighed {mass:g} kg, difference {100 * (estimate.chi[k] / mass - 1):+.2g} %"
            )
        elif not (study.model == "A" and study.drive_gains == "identify"):  # where it is the scale itself
            out.append(f"payload_mass: {label} weighs {mass:g} kg, which these runs do not show")
    return out
