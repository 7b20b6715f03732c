"""What a fit says about itself in words: what the motion leaves open, numbers that no robot has."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ident.equations.observation import RecordingSystem
from ident.equations.prepared import Prepared
from ident.equations.terms import Term
from ident.estimation.least_squares import Estimate, not_negative
from ident.examination.check import Check, column_line, listed
from ident.recordings.study import Study
from modelgen.geometry.names import ParameterName

if TYPE_CHECKING:
    from modelgen.effects.place import Model


UNITS = {"kg": 1.0, "g": 1e-3, "pounds": 0.45359237}  # that a mass is told in
FAR = 3.0  # standard deviations of parameters that have to agree: of one cable half are beyond by noise


def impossible(
    estimate: Estimate, covariance: np.ndarray, terms: Sequence[Term] = (), model: Model | None = None
) -> dict[str, str]:
    """{parameter: why}: values that physics forbids by more than their standard deviation, of a covariance
    (b, b); several that have to agree by FAR."""
    out, std = {}, np.sqrt(np.diag(covariance))
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
        values = term.values
        reason = term.effect.physical(values)
        if reason and sure and term.effect.physical({**values, **best}):
            out.update(dict.fromkeys(term.names, f"{term.label}: {reason}"))
        far = 0.0 if model is None else term.beyond(covariance[np.ix_(at, at)], model.robot)
        if far > FAR:
            reason = f"{term.effect.agreement}, and these values are {far:.1f} standard deviations from it"
            out.update(dict.fromkeys(term.names, f"{term.label}: {reason}"))
    return out


def excitation(
    full: Estimate,
    systems: Sequence[RecordingSystem],
    resting: Collection[str],
    of_one_run: Collection[str] = (),
    told: Sequence[Check] = (),
) -> list[Check]:
    """Which parameters the motion leaves open; resting: labels of the joints that never move; of_one_run:
    parameters of effects that act in one recording alone, which others do not show; told: what checks found.
    How far a recording with positions to be read otherwise excites anything says nothing of the others. (Of
    a TX40 with its fourth position in degrees in one run the other run was told to excite too little.)"""
    cure = (
        f"record joint {listed(sorted(resting))} moving"
        if resting
        else "add motions that move these joints faster and at other postures"
    )
    unseen = [d.parameter for d in full.dependent if not d.seen_in]
    out = []
    if unseen:
        are = "is" if len(unseen) == 1 else "are"
        out.append(
            _open(unseen, f"{_named(unseen)} {are} not excited at all by the identify recordings", cure)
        )
    together = [d for d in full.dependent if d.seen_in]
    if together:
        message = "; ".join(d.sentence() for d in together[:MOST_TOLD])
        if more := [d.parameter for d in together[MOST_TOLD:]]:
            message += f"; and so {'is' if len(more) == 1 else 'are'} {_named(more)}"
        names = [name for d in together for name in (d.parameter, *(its for its, _ in d.seen_in[:4]))]
        out.append(_open(names, f"{message}: the identify recordings cannot tell them apart", CANNOT))
    if full.weak:
        message = (
            f"the motion hardly excites {_named(full.weak)} (condition number {full.condition_number:.3g})"
        )
        out.append(_open(full.weak, message, cure))
    doubted = {c.recording for c in told if "columns:" in c.remedy and any(x[0] == "q" for x in c.signals)}
    systems = [system for system in systems if system.label not in doubted]
    return [*out, *_blind_runs(full, systems, of_one_run)] if len(systems) > 1 else out


MOST_TOLD = 3
TORQUES = ("Of", "Fc")  # how kinds begin of which the torque shows the unit
CANNOT = "what is fitted predicts as well; ident excite designs a motion that sees more"


def resting(prepared: Prepared) -> frozenset[str]:
    """Labels of the joints that move in no recording that is fitted."""
    still = [set(s.still.tolist()) for s in prepared.streams if s.role == "identify"]
    joints = prepared.columns.need.joints
    return frozenset(str(joints[k]) for k in set.intersection(*still)) if still else frozenset()


def _named(names: Sequence[str]) -> str:
    """8 of them, and how many there are."""
    return f"{listed(names)} ({len(names)} parameters)" if len(names) > 8 else ", ".join(names)


def _open(names: Sequence[str], message: str, remedy: str, recording: str = "") -> Check:
    """The positions of the joints whose parameters these are."""
    read = [ParameterName.of(name) for name in names]
    signals = dict.fromkeys(f"q{its.label}" for its in read if its is not None and not its.payload)
    return Check("poor_excitation", tuple(signals), message, remedy, recording=recording)


def _blind_runs(
    full: Estimate, systems: Sequence[RecordingSystem], of_one_run: Collection[str]
) -> list[Check]:
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
        blind = [name for name in blind if name not in of_one_run]
        if blind:
            message = f"does not excite {_named(blind)}, which others do"
            out.append(_open(blind, message, "the others are what shows them", system.label))
    return out


def implausible(
    estimate: Estimate,
    std: np.ndarray,
    signals: Sequence[str],
    resting: Collection[str],
    told: Sequence[Check] = (),
    sliding: Sequence[str] = (),
) -> list[Check]:
    """Masses of tonnes and friction of kilonewton metres, which a unit makes, unless what is `told` of
    signals does: bodies are as large where one torque of six is in N mm, or positions are in turns.

    std (b,) with all parameters in the model; signals: the study's names of the motor's or sensor's torques;
    resting: labels of the joints that never move, whose links come out at any size; sliding: of those that
    slide in the robot file, where a joint that turns has masses of any size. Offsets and dry friction
    have the torques' own unit, and beyond them are what others take off again. (Of a KR 300 with an axis
    turned in its table an offset was 74 kN m, and all torques of 5 kN m were to be N mm.)"""
    if any("columns:" in check.remedy for check in told):
        return []
    heavy = [
        name
        for name, value, its in zip(estimate.parameters, estimate.chi, std)
        if not ((known := ParameterName.of(name)) and (known.label in resting or known.kind[:2] in TORQUES))
        and abs(value) > 2 * its  # what the motion does not show comes out at any size
        and (abs(value) > 5e4 or (name[0] == "M" and name[1:2] not in "XYZ" and abs(value) > 2e3))
    ]
    if not heavy:
        return []
    milli = column_line({}, {name: {"scale": 0.001} for name in signals})
    slides = f"correct the robot file if joint {listed(sliding)} does not slide; " if sliding else ""
    return [
        Check(
            "torque_scale",
            tuple(signals),
            f"parameters such as {heavy[0]} come out larger than robots are: torques, or one of them, are in "
            "N mm or in the drive's own units, or positions or time in another unit, or the robot file has a "
            "joint of another kind, or is another robot's",
            f"{slides}write {milli} if all torques are in N mm, drive_gains: if they are in units of drives",
        )
    ]


def payloads_in_doubt(study: Study, full: Estimate, std: np.ndarray) -> list[Check]:
    """Payloads whose mass is negative, or not the weighed one, by FAR standard deviations; std (b,) with all
    parameters in the model. The scale of all torques is in no other place to be seen. (Of a UR10e's load in
    grams, 7500 kg beside 2.89 kg of the torques, nothing was said but in a note; told of the run without it,
    it weighed -2.9 kg, and every other run was to carry one.)"""
    out = []
    for label in study.payloads:
        name = f"M{label}"
        k = full.parameters.index(name) if name in full.parameters else None
        if k is None or not full.active[k]:
            continue
        value, its, told = float(full.chi[k]), float(std[k]), study.payload_mass.get(label)
        shown = f"{value:.4g} kg (std {its:.2g})"
        carrying = listed(entry.label for entry in study.recordings if entry.payload == label)
        if value < -FAR * its:
            said = (
                f"the payload {label} comes out as {shown}: the robot carries less in {carrying} than in the "
                "others, as where payload: stands at recordings without it, or torques have the other sign"
            )
            out.append(Check("payload_mass", (), said, f"check which recordings are made with {label}"))
        elif told is not None and abs(value - told) > FAR * its:
            causes = ["a payload that hangs on other recordings than is told"]
            if value > 0:
                unit = min(UNITS, key=lambda name: abs(np.log(told * UNITS[name] / value)))
                causes = ([f"a mass in {unit}"] if unit != "kg" else []) + causes
                causes.append(f"torques (drive gains) that are {value / told:.3g} times what they are")
            said = (
                f"the payload {label} weighs {told:g} kg as told, and {shown} as the torques show it: "
                + ", or ".join(causes)
            )
            remedy = "check payload_mass, payload and the torques' scale"
            out.append(Check("payload_mass", (), said, remedy))
    return out


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
