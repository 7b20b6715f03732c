"""A torque that does not keep its zero: a drive that warms up, is reset, or zeroed anew in each recording;
or one in which its joint's friction, or what its bodies weigh, is another one at the end.

Its zero may then go on straight lines between knots, so far apart that all joints go to and fro between two:
what a spring, a cable or a load adds comes back with positions, and no such line follows it. Half of the
stretches are fitted, the others, which lie between them, say whether it is so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ident.examination.check import Check, instead, listed
from ident.examination.fits.halves import by_halves
from ident.examination.fits.hypothesis import SAME, Asked
from ident.examination.fits.own_factors import WORDS, own_factors
from ident.examination.fits.quick import CLUSTERS, Assignment, Fit, Quick, alone
from ident.examination.fits.samples import Sample, at_rest
from ident.examination.fits.stretches import Explained, all_rows
from ident.examination.fits.unexplained import by_each_recording
from ident.examination.rivals.rivals import Rival, rivals, unit_of
from ident.examination.tables.signals import MOVED
from ident.examination.torques.believed import FALLEN
from modelgen.geometry.names import ParameterName

MOST = 8  # lines in a recording
FRICTION, WEIGHT = "friction", "weight"
RUBS = ("Fcm", "Fvm", "Fcl", "Fvl")
CHANGED = {
    FRICTION: (
        "another friction",
        "a gear that warms up, a brake that drags for a time, or something else that comes or goes there",
    ),
    WEIGHT: (
        "other weights",
        "a load that is taken up or set down, another zero of the torque from some time on, a position that "
        "drifts, a base that tilts, or something else that comes or goes there",
    ),
}
LEFT = 0.05  # of a torque, below which nobody asks why (of a clean arm's random walk, 1 % of it, it was told)


@dataclass(frozen=True, slots=True)
class Wandering:
    """Recordings with such zeros of a torque behind the model's columns, `lines` of each."""

    quick: Quick
    lines: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, whole: Quick, c: int, lines: tuple[np.ndarray, ...]) -> Wandering:
        samples = []
        for s, its in zip(whole.samples, _side_by_side(lines)):
            more = np.zeros((*s.W.shape[:2], its.shape[1]))
            more[c] = its
            samples.append(s.beside(more))
        return cls(whole.of(samples), lines)

    def apart(self, chi: np.ndarray) -> float:
        """N m by which the zeros of all recordings are apart at most."""
        return float(np.ptp(chi[len(chi) - sum(x.shape[1] for x in self.lines) :]))

    def size(self, chi: np.ndarray) -> float:
        """N m by which the zero wanders within a recording at most."""
        ends = np.cumsum([0, *(x.shape[1] for x in self.lines)])
        zeros = np.split(chi[len(chi) - ends[-1] :], ends[1:-1])
        return max(float(np.ptp(x)) for x in zeros if len(x))


def _lines(s: Sample) -> np.ndarray:
    """(N, knots) of a recording, none where no joint comes back."""
    lines = _returns(s)
    knots = np.linspace(s.t[0], s.t[-1], lines + 1)
    each = [np.interp(s.t, knots, hat) for hat in np.eye(lines + 1)]
    return np.stack(each, axis=1)[:, : lines and lines + 1]


def _returns(s: Sample) -> int:
    """How often all joints that move go from one end of their range to the other and back."""
    reach = np.ptp(s.q, axis=0)
    travel = (np.abs(s.dq[:-1]) * np.diff(s.t)[:, None]).sum(axis=0)
    return int(np.min((travel / (2 * np.maximum(reach, MOVED)))[reach > MOVED], initial=MOST))


def _zeros(s: Sample) -> np.ndarray:
    """(N, 1): one zero of a recording."""
    return np.ones((len(s.t), 1))


def _frictions(whole: Quick, c: int) -> tuple[np.ndarray, ...]:
    """(N, p) of each recording: its joint's friction in a torque, times the share of it that is over; none
    where no joint comes back."""
    names = [ParameterName.of(name) for name in whole.columns.parameters]
    label = str(whole.columns.need.joints[int(whole.columns.joint_of[c])])
    its = [k for k, x in enumerate(names) if x and x.kind in RUBS and str(x.label) == label]
    its = [k for k in its if any(s.W[c][:, k].any() for s in whole.samples)]
    return tuple(_over(s, s.W[c][:, its]) for s in whole.samples)


def _weights(whole: Quick, c: int) -> tuple[np.ndarray, ...]:
    """The same of what its bodies weigh."""
    each = [at_rest(whole.columns, s.payload, s.q)[c] for s in whole.samples]
    its = np.any([x.any(axis=0) for x in each], axis=0)
    return tuple(_over(s, x[:, its]) for s, x in zip(whole.samples, each))


def _over(s: Sample, columns: np.ndarray) -> np.ndarray:
    over = (s.t - s.t[0]) / max(float(np.ptp(s.t)), 1e-300)
    return np.asarray(over[:, None] * columns[:, : columns.shape[1] if _returns(s) else 0])


def wandering(asked: Asked) -> Iterator[Check]:
    """Of each torque whose zero, so moved, leaves clearly less of what did not fit it. (Of a UR10e whose
    first current jumps half way 25 % were left for 8, and nothing was said. Of eleven robots as they are it
    takes off a tenth at most; of six seconds of a KR 300, whose joints do not come back, half.) Fits of each
    recording have to leave more: else these are apart. (Of an AIRBOT with 5 kg in one of them two were told.)
    A zero of each recording is asked first. (Of an AIRBOT whose torques had lost their averages, recording by
    recording, the third was said to drift within them, by a twentieth of what these are apart.) Clipped
    torques say nothing of others here. (Of an AIRBOT whose third one is, the second was to feel other weights
    at the end of each recording.)
    """
    clipped = [c for c in asked.seen if asked.name(c) in asked.clipped]
    whole, how = all_rows(asked.quick), asked.how
    whole = whole.of([s.without(clipped) for s in whole.samples]) if clipped else whole
    before, lines = whole.fit(how).error, tuple(map(_lines, whole.samples))
    zeros = tuple(map(_zeros, whole.samples)) if len(whole.samples) > 2 else ()
    each = by_each_recording(whole, how)
    changed: dict[str, list[tuple[int, Wandering]]] = {kind: [] for kind in CHANGED}
    for c in (c for c in asked.seen if before[c] > LEFT):
        apart = _moving(whole, how, c, zeros, before[c], SAME * each[c])
        ways = {"": _moving(whole, how, c, lines, before[c], each[c])} if apart is None else {}
        for kind, over in ((FRICTION, _frictions), (WEIGHT, _weights)) if apart is None else ():
            ways[kind] = _moving(whole, how, c, over(whole, c), before[c], each[c], both=True)
        found = {kind: its for kind, its in ways.items() if its is not None}
        if apart is None and not found:
            continue
        kind = min(found, key=lambda kind: found[kind].quick.fit(how).error[c], default="")
        if kind:
            changed[kind].append((c, found[kind]))
            continue
        its = apart or found[kind]
        fit, name = its.quick.fit(how), asked.name(c)
        near = _as_well(asked, whole, [(c, fit)])
        if apart and any(r.zero for r in near):
            continue  # of one recording alone, as it is told elsewhere
        if _lacking(near, [(c, fit)]):
            continue
        fallen = (
            f"its error falls from {100 * before[c]:.0f} to {100 * fit.error[c]:.0f} %{_where(near, [c])}"
        )
        if apart:
            yield Check(
                "torque_zero",
                (name,),
                f"{name} has another zero in each recording: with those, up to {its.apart(fit.chi):.2g} "
                f"{unit_of(whole, c)} apart, {fallen}: a sensor or a drive that was zeroed anew, averages "
                "that were taken off, or in some of them a load, a contact or another zero of a joint",
                "look at its plots, and give recordings a columns: of their own with its offset",
            )
            continue
        yield Check(
            "torque_zero",
            (name,),
            f"{name} does not keep its zero: where that may drift within a recording, by up to "
            f"{its.size(fit.chi):.2g} {unit_of(whole, c)}, {fallen}: "
            "a sensor or a drive that warms up or is reset, or for a time a load, a contact or another zero",
            "look at its plot, or use a part of the recording with from: and to:",
        )
    for kind, its_own in changed.items():
        if its_own:
            yield from _changes(asked, whole, kind, before, [(c, its.quick.fit(how)) for c, its in its_own])


def _changes(
    asked: Asked, whole: Quick, kind: str, before: np.ndarray, its: Sequence[tuple[int, Fit]]
) -> Iterator[Check]:
    """Torques of which so much less is left by a friction or weights that change."""
    channels = [c for c, _ in its]
    names, words = asked.names(channels), CHANGED[kind]
    near = _as_well(asked, whole, its)
    if _lacking(near, its):
        return
    then, now = (
        listed(f"{100 * x:.0f} %" for x in e) for e in (before[channels], [f.error[c] for c, f in its])
    )
    error = "their errors fall" if its[1:] else "its error falls"
    yield Check(
        "changes_meanwhile",
        names,
        f"{listed(names)} {'ask' if its[1:] else 'asks'} for {words[0]} at the end of a recording than at "
        f"its start: where that may change evenly meanwhile, {error} from {then} to {now}"
        f"{_where(near, channels)}: {words[1]}",
        "look at what is left over time, or use a part of the recording with from: and to:",
        open=bool(near),
    )


def _as_well(asked: Asked, whole: Quick, its: Sequence[tuple[int, Fit]]) -> list[Rival]:
    """Those that explain each of these torques about as well as its fit does, each torque times a number of
    its own among them. (Of an AIRBOT whose log held currents the fifth was said to change on the way.)"""
    own = Rival(WORDS, Explained.by(whole, own_factors(whole, asked.how, asked.seen)), beside=True)
    every = (own, *rivals(asked, whole, asked.how))
    return [r for r in every if all(r.explained.fit.error[c] < SAME * fit.error[c] for c, fit in its)]


def _lacking(near: Sequence[Rival], its: Sequence[tuple[int, Fit]]) -> bool:
    """Whether an effect that the model lacks leaves clearly less of these torques: none of them changes. (Of
    an arm with a hose over two joints other weights were told at the end, for 13 % of what were 31; with the
    hose 0.6 are left.)"""
    return any(
        r.lacks and all(r.explained.fit.error[c] < FALLEN * fit.error[c] for c, fit in its) for r in near
    )


def _where(near: Sequence[Rival], channels: Sequence[int]) -> str:
    left = {r.words: float(r.explained.fit.error[channels].sum()) for r in near}
    told = sorted(left, key=lambda words: left[words])
    return f", as where {told[0]}{instead(told[1:])}" if told else ""


def _moving(
    whole: Quick,
    how: Assignment,
    c: int,
    lines: tuple[np.ndarray, ...],
    before: float,
    least: float,
    both: bool = False,
) -> Wandering | None:
    """Recordings with these zeros of torque c, where all along they leave clearly less of it than before, and
    less than `least`; in the mean of the two halves, or in both."""
    if not any(x.shape[1] for x in lines):
        return None
    enough = min(FALLEN * before, least)
    if not _by_itself(whole, how, c, lines) < enough:  # as most: all torques cost many times as much
        return None
    its = Wandering.of(whole, c, lines)
    if not its.quick.fit(how).error[c] < enough:
        return None
    held = [gain for _, gain in by_halves(whole, how, its.quick, how, CLUSTERS, c)]
    told = min(held) if both else np.mean(held)
    known = min(held) > 0 and told >= -np.log(FALLEN)  # half of the rows knows a robot worse
    return its if known else None


def _by_itself(whole: Quick, how: Assignment, c: int, lines: tuple[np.ndarray, ...]) -> float:
    """Relative error of torque c with these zeros, fitted by itself: no fit of all torques leaves less."""
    its = zip(whole.samples, _side_by_side(lines))
    X = np.concatenate([np.hstack([s.W[c], zeros]) for s, zeros in its])
    y = np.concatenate([how.factor[c] * s.Y[:, how.order[c]] for s in whole.samples])
    root = np.sqrt(np.concatenate([s.weight[:, c] for s in whole.samples]))
    X, y = X * root[:, None], y * root
    return float(alone(X.T @ X, (X.T @ y)[:, None], np.array([y @ y]))[0])


def _side_by_side(lines: Sequence[np.ndarray]) -> Iterator[np.ndarray]:
    """(N, p) of every recording, 0 in the columns (p,) of the others."""
    ends = np.cumsum([0, *(x.shape[1] for x in lines)])
    for its, at in zip(lines, ends):
        out = np.zeros((len(its), ends[-1]))
        out[:, at : at + its.shape[1]] = its
        yield out
