"""Suspects that a motion shall tell apart: read as requests, sized as they would look alike, told in words.

The first one is what was found, the others are its rivals; any of them may be the true one. A rival whose
size nobody gives is as visible as the first one in a motion that nobody chose: a larger one would be told
sooner than it can be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ident.diagnosis.telling.deciding import NOTHING, PATIENCE, SoFar
from ident.equations.terms import Term
from ident.excitation.known import ROWS_HZ, Known, sized, term_of
from ident.excitation.limits import Bounds, ExcitationError
from ident.excitation.same import proof, proof_in_limit
from ident.excitation.separate import NEAR, Imitation, Projector, contained, imitation, seconds_of
from ident.excitation.so_far import Before, nothing

Array = np.ndarray
SURE = "right in 99 of 100 cases, when as much again is fitted"
INSTEAD = "wider limits, less noise or a sensor beside the torque would tell sooner"
HIDDEN = 1e-9  # share of an effect's own square below which the model holds it already


@dataclass(frozen=True)
class Pair:
    """What a motion says of two suspects: a against b, b against a; the identities by which b does what a
    does in any motion, and a what b does; `same`: b does what a does, a what b does; `so_far`: what earlier
    recordings say."""

    labels: tuple[str, str]
    both: tuple[Imitation, Imitation]
    exact: tuple[str | None, str | None]
    same: tuple[bool, bool]
    so_far: SoFar = NOTHING

    @property
    def seconds(self) -> float:
        """For a decision that is right in 99 of 100; whole motions, at least one."""
        return seconds_of(self.both, self.same, self.so_far)


@dataclass(frozen=True)
class Separated:
    """Whether a motion tells suspects apart, every two of them, and in words."""

    labels: tuple[str, ...]
    pairs: tuple[Pair, ...]
    sentence: str

    @property
    def seconds(self) -> float:
        """Until all are told apart that a motion can tell apart; infinite where it can none."""
        return max((pair.seconds for pair in self.pairs if not all(pair.same)), default=float("inf"))


def suspects(known: Known, texts: Sequence[str], bounds: Bounds, project: Projector) -> tuple[Term, ...]:
    """The terms of requests, at sizes that look alike. Raises ExcitationError for what no motion shows."""
    terms = [term_of(known, text, bounds, project.motion) for text in texts]
    for term, text in zip(terms, texts):
        if sum(term.effect.name == b.effect.name and term.place == b.place for b in terms) > 1:
            raise ExcitationError(f"--separate {','.join(texts)}: {text} is there twice; name two effects.")
        if term.effect.all_along:
            raise ExcitationError(
                f"--separate {text}: is of one recording, and no motion brings it back; leave it out."
            )
        if term.effect.windowed and not term.place.start:
            window = ("," if "=" in text else ":" * (2 - text.count(":"))) + "from=5"
            raise ExcitationError(
                f"--separate {text}: what is there from the first moment on is part of the robot; say when "
                f"it comes, as {text}{window}."
            )
        with np.errstate(all="ignore"):
            own = project.torque(term)
        if not (np.isfinite(own).all() and own.any()):
            raise ExcitationError(f"--separate {text}: makes no torque at these values; give others.")
        if float(np.sum(project.off(own) ** 2)) <= HIDDEN * float(np.sum(own**2)):
            raise ExcitationError(
                f"{term.label} cannot be told from the model's own parameters in any motion; leave it out."
            )
    first, *rivals = terms
    return first, *(
        term if sized(known, text) else _alike(project, first, term, [r for r in rivals if r is not term])
        for term, text in zip(rivals, texts[1:])
    )


def _alike(project: Projector, first: Term, rival: Term, others: Sequence[Term] = ()) -> Term:
    """The rival in the shape that looks most like the first one, and as visible; of one that contains the
    first, in a shape of its own. So too where that shape is one that another suspect has as well and that
    the rival contains: what it does there is asked of the other one."""
    its = imitation(project, first, rival)
    near = rival if contained(first, its) or not any(its.other.size) else its.other
    if near is not rival and any(_within(project, other, near) for other in others):
        near = rival
    beside = float(np.sum(project.off(project.torque(near)) ** 2))
    factor = np.sqrt(its.visible * project.instants / ROWS_HZ / beside) if beside > 0 else 1.0
    return replace(near, size=tuple(float(factor) * size for size in near.size))


def _within(project: Projector, special: Term, general: Term) -> bool:
    """Whether a term does, in its shape, no more than another one of fewer parameters that it contains."""
    if len(special.linear) + len(special.free) >= len(general.linear) + len(general.free):
        return False
    its = imitation(project, general, special)
    if its.rate > NEAR * its.visible or not any(its.other.size):
        return False
    return contained(its.other, imitation(project, its.other, general))


def told(
    project: Projector,
    terms: Sequence[Term],
    moved: str = "motion",
    settled: Sequence[bool] = (),
    so_far: Before = nothing,
) -> Separated:
    """What a motion, or a recording, says of the suspects; `moved`: what it is called; `settled`: of every
    pair, both ways, that the second contains the first, as it was known before the motion was designed;
    `so_far`: what earlier recordings say of two labels."""
    pairs = []
    for number, (a, b) in enumerate(combinations(terms, 2)):
        both = imitation(project, a, b), imitation(project, b, a)
        known = settled[2 * number : 2 * number + 2] or (False, False)
        same = [already or contained(of, its) for already, of, its in zip(known, (a, b), both)]
        found = [
            (proof(of, its.other) or proof_in_limit(of, its.other)) if alike else None
            for of, its, alike in zip((a, b), both, same)
        ]
        before = so_far(a.label, b.label)
        pairs.append(Pair((a.label, b.label), both, (found[0], found[1]), (same[0], same[1]), before))
    labels = tuple(term.label for term in terms)
    return Separated(labels, tuple(pairs), " ".join(_sentence(pair, moved) for pair in pairs))


def _sentence(pair: Pair, moved: str) -> str:
    a, b = pair.labels
    sure = SURE if pair.so_far == NOTHING else f"{SURE} and what was diagnosed stays in the study"
    seconds = pair.seconds
    if seconds > PATIENCE:
        needed = (
            f"{float(f'{seconds / 3600:.2g}'):g} h" if np.isfinite(seconds) else "more time than there is"
        )
        much = f"{needed} of this {moved} would decide, {sure}; that is too long: {INSTEAD}"
    elif seconds > pair.both[0].period:
        much = f"{seconds:.3g} s of this {moved} decide, {sure}"
    else:
        whole = "one period of this motion" if moved == "motion" else f"this {moved}"
        much = f"{whole} decides, {sure}"
    if all(pair.exact):
        shown = " and ".join(map(str, pair.exact))
        return f"{a} and {b} span the same torques: no motion tells them apart, for {shown}."
    if all(pair.same) and any(pair.exact):
        special, general = (a, b) if pair.exact[0] else (b, a)
        return (
            f"What {special} does, {general} does too, in any motion, for {pair.exact[0] or pair.exact[1]}; "
            f"and at the values given {general} does no more: no {moved} of this length tells them apart."
        )
    if all(pair.same):
        return f"{a} and {b} look the same in this {moved} and at the sizes given; a wider one may tell."
    if any(pair.same):
        special, general = (a, b) if pair.same[0] else (b, a)
        exact = pair.exact[0] if pair.same[0] else pair.exact[1]
        ever = f"in any motion, for {exact}" if exact else f"in this {moved} and at the sizes given"
        return f"What {special} does, {general} does too, {ever}; only the other way round: {much}."
    return f"{a} or {b}: {much}."
