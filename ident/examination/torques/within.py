"""A torque that changes its sign in the middle of a recording, or all of them at once.

Every recording is fitted alone, on every other one of its stretches, with what follows an instant turned:
right-hand sides alone change, so each hypothesis costs one small solution. The best one is told where
the stretches between, which chose nothing, are then explained by so much better that chance seldom does it: a
split likelihood ratio (Wasserman, Ramdas, Balakrishnan, PNAS 117(29), 2020) in which each stretch counts as
one sample, shared by all torques of all recordings. What is left by a load, friction or a weak model is
turned by nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.fits.bodies import beyond_own
from ident.examination.fits.hypothesis import CLEARLY, EXPLAINED, Asked
from ident.examination.fits.quick import CLUSTERS, Assignment, Fit, Normal, Quick, gain_of, gains_of, solve
from ident.examination.fits.samples import Sample
from ident.examination.fits.stretches import RARE, Explained, steadily

DOUBTED = 0.15  # error of a torque that is looked into
PARTS, FINE = 16, 6  # instants of a recording that are tried, and about the best of them
LEAST = 60  # samples on either side
RATE = 0.01  # of a false alarm in a study


@dataclass(frozen=True, slots=True)
class Change:
    """From sample `at` on the torques of these channels have the other sign."""

    channels: tuple[int, ...]
    at: int

    def undone(self, sample: Sample) -> Sample:
        Y, late, its = sample.Y.copy(), sample.late.copy(), list(self.channels)
        Y[self.at :, its] *= -1.0
        late[:, self.at :, its] *= -1.0
        return replace(sample, Y=Y, late=late)


def changed_within(asked: Asked) -> Iterator[tuple[Check, Quick]]:
    """Checks, each with the recordings as they are without what it says; of torques alone of which one set of
    bodies then explains more of all recordings, and as much as bodies of their own. (Of three seconds of a
    Franka with two torques exchanged and a position turned one was told to change its sign.)"""
    quick, how = asked.quick, asked.how
    tried = max(len(how.order) * len(quick.samples), 1)
    found: list[tuple[tuple[int, ...], Check, Quick]] = []
    for which in range(len(quick.samples)):
        told, undone = [], quick
        for _ in how.order:
            sample = undone.samples[which]
            change = _change(sample, how, float(np.log(tried / RATE)))
            if change is None or _all_along(undone, sample, change, how):
                break
            its = [change.undone(s) if k == which else s for k, s in enumerate(undone.samples)]
            undone = undone.of(its)
            told.append((change.channels, _told(asked, sample, change), undone))
        if told and beyond_own(*_left(undone, undone.samples[which : which + 1], how)).any():
            continue
        found, quick = [*found, *told], undone
    if found:
        before, _ = _left(asked.quick, asked.quick.samples, how)
        error, own = _left(quick, quick.samples, how)
        apart = beyond_own(error, own) | (error > before)
        yield from ((check, without) for its, check, without in found if not apart[list(its)].all())


def _told(asked: Asked, sample: Sample, change: Change) -> Check:
    names, t = asked.names(change.channels), sample.t[change.at]
    subject = (
        f"all torques ({listed(names)}) change their signs" if names[1:] else f"{names[0]} changes its sign"
    )
    return Check(
        "torque_sign",
        names,
        f"{subject} at about {t:.3g} s",
        f"give the recording twice, `to: {t:.3g}` and `from: {t:.3g}`, one of them with `columns:` "
        f"of its own, {', '.join(f'{name}: {{sign: -1}}' for name in names)}; or leave one of the two out",
        recording=sample.label,
    )


def _left(quick: Quick, samples: Sequence[Sample], how: Assignment) -> tuple[np.ndarray, np.ndarray]:
    """(C,) what one set of bodies leaves of the torques of these recordings, and what bodies of each do. (Of
    a rokae with a position in degrees, or all on the motor's side, two torques were told to change their
    signs, of a Franka on a wall one.)"""
    whole = quick.of([replace(s, role="identify") for s in samples])
    return whole.fit(how).error, whole.alone(how)


def _change(sample: Sample, how: Assignment, limit: float) -> Change | None:
    """The change of one torque of a recording, or of all at one instant, that its stretches agree with. (Of
    an LWR4+ all of whose torques were turned from 15.4 s on the fifth one changed its sign at 11.3 s.)"""
    stretch = np.arange(len(sample.t)) * CLUSTERS // max(len(sample.t), 1)
    halves = [replace(sample, weight=sample.weight * (stretch % 2 == k)[:, None]) for k in (0, 1)]
    before = _fit(halves, how)
    assert before.validate is not None
    best: tuple[float, Change] | None = None
    its_own = [c for c in range(len(before.error)) if how.order[c] == c and np.isfinite(before.error[c])]
    doubted = [c for c in its_own if before.error[c] > DOUBTED]
    together = [tuple(its_own)] if doubted and its_own[1:] else []
    for channels in [*((c,) for c in doubted), *together]:
        rows = np.linspace(0, len(sample.t), PARTS + 1)[1:-1].astype(int)
        told = _best(halves[0], before, how, [Change(channels, k) for k in _inside(rows, sample)])
        if told is None:
            continue
        for step in (len(sample.t) / PARTS / FINE, len(sample.t) / PARTS / FINE**2):
            near = told[1].at + (step * np.arange(-FINE, FINE + 1)).astype(int)
            changes = [replace(told[1], at=k) for k in _inside(near, sample)]
            told = _best(halves[0], before, how, changes) or told
        best = told if best is None or told[0] > best[0] else best
    if best is None or best[0] < CLEARLY:
        return None
    after = _fit([best[1].undone(half) for half in halves], how)
    assert after.validate is not None
    held = gain_of(before.validate, after.validate) * (CLUSTERS // 2)
    # themselves: what these share with others may take up what those lack; of all, those that ask for it
    c = [c for c in best[1].channels if before.error[c] > DOUBTED]
    explained = max(np.median(after.error[c]), np.median(after.validate[c])) <= EXPLAINED
    each = (before.error, after.error), (before.validate, after.validate)
    fallen = (gains_of(x[c], y[c]).mean() for x, y in each)
    return best[1] if held > limit and explained and min(fallen) > CLEARLY else None


def _all_along(quick: Quick, sample: Sample, change: Change, how: Assignment) -> bool:
    """Whether a torque that is turned all along explains the recording as well, stretch by stretch. (A run of
    a Barrett with its second torque turned was told to have the first one turned after half a second.)"""

    def explained(its: Change) -> Explained:
        return Explained.by(quick.of([replace(its.undone(sample), role="identify")]), how)

    told = explained(change)
    turned = [explained(Change((c,), 0)) for c in np.flatnonzero(quick.identify.rows > 10).tolist()]
    return not all(steadily(other, told, RARE) for other in turned)


def _inside(rows: np.ndarray, sample: Sample) -> list[int]:
    return [int(k) for k in rows if LEAST <= k <= len(sample.t) - LEAST]


def _fit(halves: Sequence[Sample], how: Assignment) -> Fit:
    fitted, judged = (Normal.of(half) for half in halves)
    return solve(fitted, judged, how)


def _best(
    half: Sample, before: Fit, how: Assignment, changes: Sequence[Change]
) -> tuple[float, Change] | None:
    """The change that gains most on the fitted stretches."""
    sums = Normal.of(half)
    if not changes:
        return None
    c = list(changes[0].channels)
    weighted = half.W[c] * (half.weight[:, c] * half.Y[:, c]).T[:, :, None]
    v = np.concatenate([np.zeros_like(weighted[:, :1]), np.cumsum(weighted, axis=1)], axis=1)
    out = []
    for change in changes:
        turned = sums.v.copy()
        turned[c, c] -= 2 * (v[:, -1] - v[:, change.at])
        out.append((solve(replace(sums, v=turned), None, how).gain_over(before), change))
    return max(out, key=lambda its: its[0])
