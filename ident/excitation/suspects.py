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

from ident.equations.terms import Term
from ident.excitation.known import ROWS_HZ, Known, sized, term_of
from ident.excitation.limits import Bounds, ExcitationError
from ident.excitation.same import proof
from ident.excitation.separate import Imitation, Projector, imitation

Array = np.ndarray
HIDDEN = 1e-9  # share of an effect's own square below which the model holds it already


@dataclass(frozen=True)
class Pair:
    """What a motion says of two suspects: a against b, b against a; the identity that makes them one."""

    labels: tuple[str, str]
    both: tuple[Imitation, Imitation]
    exact: str | None

    @property
    def same(self) -> tuple[bool, bool]:
        """b imitates a, a imitates b."""
        return self.both[0].same, self.both[1].same

    @property
    def seconds(self) -> float:
        """For a decision that is right in 99 of 100."""
        return max((its.seconds for its in self.both if not its.same), default=float("inf"))


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
        own = project.torque(term)
        if float(np.sum(project.off(own) ** 2)) <= HIDDEN * float(np.sum(own**2)):
            raise ExcitationError(
                f"{term.label} cannot be told from the model's own parameters in any motion; leave it out."
            )
    first, *rivals = terms
    return first, *(
        term if sized(known, text) else _alike(project, first, term) for term, text in zip(rivals, texts[1:])
    )


def _alike(project: Projector, first: Term, rival: Term) -> Term:
    """The rival in the shape that looks most like the first one, and as visible; of one that contains the
    first, in a shape of its own."""
    its = imitation(project, first, rival)
    near = rival if its.same or not any(its.other.size) else its.other
    beside = float(np.sum(project.off(project.torque(near)) ** 2))
    factor = np.sqrt(its.visible * project.instants / ROWS_HZ / beside) if beside > 0 else 1.0
    return replace(near, size=tuple(float(factor) * size for size in near.size))


def told(project: Projector, terms: Sequence[Term]) -> Separated:
    """What a motion says of the suspects."""
    pairs = []
    for a, b in combinations(terms, 2):
        both = imitation(project, a, b), imitation(project, b, a)
        exact = proof(a, both[0].other) if both[0].same else None
        pairs.append(Pair((a.label, b.label), both, exact))
    period = float(project.motion.t[-1] - project.motion.t[0])
    labels = tuple(term.label for term in terms)
    return Separated(labels, tuple(pairs), " ".join(_sentence(pair, period) for pair in pairs))


def _sentence(pair: Pair, period: float) -> str:
    a, b = pair.labels
    much = f"{pair.seconds:.3g} s of this motion decide"
    much = much if pair.seconds > period else "one period of this motion decides"
    if all(pair.same):
        shown = f"; exactly: {pair.exact}" if pair.exact else " in this motion and at the sizes given"
        return f"{a} and {b} span the same torques: no motion tells them apart{shown}."
    if any(pair.same):
        special, general = (a, b) if pair.same[0] else (b, a)
        return (
            f"{general} contains {special}: what {special} does, {general} does too; only the other way "
            f"round: {much}."
        )
    return f"{a} or {b}: {much}, right in 99 of 100 cases."
