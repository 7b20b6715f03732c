"""What no hypothesis explains: torques that have nothing to do with the model, or runs with other runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.fits.bodies import beyond_own
from ident.examination.fits.hypothesis import BAD, EXPLAINED, NOTHING, Asked
from ident.examination.fits.quick import FLOOR, Assignment, Normal, Quick, added, solve
from ident.examination.fits.samples import Sample
from ident.examination.fits.stretches import all_rows

HALF = 0.5  # of what any other recording leaves when it is left out: that one is the odd one
ODD, TIMES = 0.12, 3.0  # error of a channel that is odd: at least, and against what it is elsewhere
NOT_AS_TOLD = (
    "a signal (its sign, unit, place, zero or time), the robot file or something that acts on it (a load, a "
    "contact) is not as it is told, or the model lacks something (a spring, another friction); no check "
    "tells which"
)
UNSHOWN = "the motion that is fitted does not show what the other asks for"
CHECK = "check the columns of all joints and the robot file"
PARTLY, PARTLY_TIMES = 0.5, 6.0  # error of a channel, and against the others', from which it is said


def _unrelated(names: tuple[str, ...], message: str, remedy: str) -> Check:
    return Check("unrelated_torque", names, message, remedy)


def unexplained(asked: Asked) -> Iterator[Check]:
    """Channels, or all of them, of which the model explains nothing in any recording. (Of an AIRBOT that was
    touched, or tilted, in one run noise or another signal was told of the first torque, which carries little:
    the other runs explained it as ever.)"""
    quick, fit = asked.quick, asked.fit
    seen = np.flatnonzero(np.isfinite(fit.error))
    if not len(seen):
        return
    error = fit.error[seen]
    alone = asked.alone  # what is explained by itself, others contradict
    of_each = np.array([solve(normal, None, asked.how).error for normal in quick.each])
    nowhere = ~np.any(of_each < NOTHING, axis=0)  # what one recording explains is another signal elsewhere
    empty = [int(c) for c in seen if fit.error[c] > NOTHING and alone[c] > PARTLY and nowhere[c]]
    everything = asked.names(range(len(quick.columns.channels)))
    if (error > EXPLAINED).sum() > len(seen) / 2 and len(seen) > 1:
        if apart_by_one_fit(quick, asked.how)[seen].sum() > len(seen) / 2:
            yield _apart(asked)
            return
        yield Check(
            "wrong_robot",
            everything,
            f"the model explains little of these torques (errors of {100 * error.min():.0f} to "
            f"{100 * error.max():.0f} % of each): noise that hides them, another robot's or another run's "
            "signals, torques less a model's (external ones), a position that is another signal, a wrong "
            "robot file, or a contact far larger than what moves the arm",
            "check the robot, what the torques are, and that positions and torques belong to one run",
        )
        return
    if empty:  # one torque alone blames no robot
        names = asked.names(empty)
        yield _unrelated(
            names,
            f"the model explains nothing of {listed(names)}: noise, another signal, a sign that "
            "changes on the way, or a joint that carries next to no torque",
            f"check the columns, or leave them out with {asked.left_out(empty)}",
        )
    usual = float(np.median(error))
    some = [
        int(c)
        for c in seen
        if c not in empty
        and fit.error[c] > max(PARTLY, PARTLY_TIMES * usual)
        and alone[c] > PARTLY
        and (fit.validate is None or not fit.validate[c] < PARTLY)
    ]
    if some and len(seen) > 2:
        names = asked.names(some)
        yield _unrelated(
            names,
            f"the model explains only a part of {listed(names)} (errors of "
            f"{listed(f'{100 * fit.error[c]:.0f} %' for c in some)}, the other torques about "
            f"{100 * usual:.0f} %): noise, another signal for a while, a magnitude without its sign, or "
            "something large that the model lacks",
            f"look at its plot, or leave it out with {asked.left_out(some)}",
        )


def badly_explained(asked: Asked) -> Iterator[Check]:
    """Several torques of which more is left than of a clean arm's, of which one at most hardly goes with
    its motion. (Of an AIRBOT's, with a position smoothed over its wraps, 57 % were left and nothing was said;
    with the table of a UR10e 46 to 69 % of three. What is left of clipped ones is bent, and told.)"""
    error = asked.fit.error
    badly = [c for c in asked.seen if error[c] > BAD and asked.name(c) not in asked.clipped]
    if len(badly) > 1:
        names, left = asked.names(badly), listed(f"{100 * error[c]:.0f} %" for c in badly)
        what = f"the model explains {listed(names)} badly (errors of {left})"
        yield _unrelated(names, f"{what}: noise that hides them, {NOT_AS_TOLD}", CHECK)


def apart_by_one_fit(quick: Quick, how: Assignment) -> np.ndarray:
    """(C,) bool: torques of which one fit of all recordings leaves more of them all than fits of each."""
    return beyond_own(all_rows(quick).fit(how).error, by_each_recording(quick, how))


def by_each_recording(quick: Quick, how: Assignment) -> np.ndarray:
    """(C,) errors of all recordings by fits of each."""
    each = [(x, x.right(how)[0], solve(x, None, how).error) for x in quick.each]
    size = np.sum([its for _, its, _ in each], axis=0)
    return np.sqrt(np.nansum([its * error**2 for _, its, error in each], axis=0) / np.maximum(size, 1e-300))


def odd_beside(error: np.ndarray, own: np.ndarray) -> np.ndarray:
    """(C,) bool: torques of which one robot for all leaves far more, error (C,), than one for each, own."""
    return np.asarray(error > np.fmax(ODD, TIMES * own))


def contradicted(asked: Asked) -> np.ndarray:
    """(C,) bool: torques that the others contradict."""
    return odd_beside(asked.fit.error, asked.alone)


def contradicting(asked: Asked) -> Iterator[Check]:
    """Torques that all recordings explain each by itself and not together, by none of the faults that are
    asked. (By itself nothing is foretold: of a Franka's second torque with a dead band, explained to 1 %
    alone and to 13 % with the others, nothing was said; nor of one with its first position turned on a base
    that is off, whose fitted run alone takes it, and foretells the other at 200 %; nor of an LWR4+'s second
    that overflows, of which 92 % were left, by itself 38.)"""
    clipped = [c for c in asked.seen if asked.name(c) in asked.clipped]  # what is left of them is bent, too
    quick = asked.quick.of([s.without(clipped) for s in asked.quick.samples]) if clipped else asked.quick
    whole = all_rows(quick)
    own, error = whole.alone(asked.how), whole.fit(asked.how).error
    wrong = odd_beside(error, own) | ((error > NOTHING) & (own <= PARTLY))  # of others nothing is explained
    odd = [c for c in asked.seen if wrong[c]]
    if not odd:
        return
    names = asked.names(odd)
    have, its = ("have", "they are") if len(odd) > 1 else ("has", "it is")
    before, after = (listed(f"{100 * x:.0f} %" for x in each[odd]) for each in (own, error))
    yield _unrelated(
        names,
        f"{listed(names)} {have} something that the other torques contradict: by itself {its} explained to "
        f"{before}, with one robot for all to {after}: {NOT_AS_TOLD}",
        CHECK,
    )


def unpredicted(asked: Asked) -> list[Check]:
    """Said where torques that judge are predicted worse than by nothing: of most of them, where no one fit
    explains all recordings, that something is odd, of any, where one does, that the fitted motion does not
    show it or something is not as it is told. Which recording is, only a third one tells. (Of a KR 300 on a
    wall the first torque was foretold at 700 %, which gravity moved in the other recording alone, and nothing
    was said; where its second was another run's, or two rows of a rokae's table were exchanged, that the
    motion did not show it. Of eight seconds of a clean AIRBOT a signal was not as it is told.)"""
    fit, judged = asked.fit, asked.fit.validate
    if judged is None or not np.isfinite(judged).any():
        return []
    if apart_by_one_fit(asked.quick, asked.how).any():
        error, held = (float(np.nanmedian(x)) for x in (fit.error, judged))
        if not held > max(1.0, TIMES * error):
            return []
        said = _unforetold("validate", error, held)
        return [_contradiction(asked, asked.names(range(len(asked.how.order))), said)]
    together = all_rows(asked.quick).fit(asked.how).error
    worse = [c for c in asked.seen if judged[c] > max(1.0, TIMES * fit.error[c]) and together[c] < PARTLY]
    if not worse:
        return []
    most = worse[int(np.argmax(judged[worse]))]
    names, so = asked.names(worse), f"one fit explains both (to {100 * together[most]:.0f} %)"
    said = _unforetold(f"{listed(names)} of validate", fit.error[most], judged[most])
    part = ", a part of it" if (together[worse] > BAD).any() else ""
    said += f", and {so}{part}: {UNSHOWN}, or {NOT_AS_TOLD}"
    if part:
        return [_unrelated(names, said, CHECK)]
    remedy = "fit more of the recordings, or record a motion that moves all joints more; check the robot file"
    return [Check("poor_excitation", (), said, remedy)]


def _unforetold(what: str, error: float, held: float) -> str:
    explained = f"what identify explains ({100 * error:.0f} % error)"
    size = f"{100 * held:.0f}" if held < 10 else "more than 1000"  # which no number says better
    return f"{explained} does not predict {what} at all ({size} %)"


def _apart(asked: Asked) -> Check:
    """Torques that fits of each recording explain. (Of an AIRBOT with 5 kg in one of two fitted runs another
    robot's signals or a wrong robot file were told: 31 to 71 % were left of them, of each run 3.)"""
    whole = all_rows(asked.quick)
    each, error = (by_each_recording(whole, asked.how), whole.fit(asked.how).error)
    own, together = (100 * float(np.nanmedian(x)) for x in (each, error))
    said = f"each recording is explained by a fit of its own ({own:.0f} % error), and all by one fit are not "
    return _contradiction(asked, asked.names(range(len(asked.how.order))), f"{said}({together:.0f} %)")


def _contradiction(asked: Asked, names: tuple[str, ...], said: str) -> Check:
    """Of recordings of which no one fit explains all. (Of an LWR4+ with two rows of its table exchanged, or
    with a torque that drifts, another robot was told, a sign or a unit.)"""
    samples = asked.quick.samples
    odd = odd_one(samples, asked.how)
    others = "another robot, load, sign or unit"
    remedy = "check that these recordings are of the same robot in the same state"
    if odd is not None and odd.role == "identify":
        said += (
            f"; without this recording all others agree: {others} here, a contact or a signal that changes"
        )
        return Check("wrong_robot", names, said, f"{remedy}, or leave this one out", recording=odd.label)
    by_role = [[s.label for s in samples if s.role == role] for role in ("identify", "validate")]
    if odd is not None and len(by_role[1]) == 1:
        said += f": {others} there, or motions that have nothing in common"
        return Check("wrong_robot", names, said, remedy, recording=odd.label)
    runs = f"{listed(by_role[0])} and {listed(by_role[1])}"
    said += (
        f": another robot or load in one of {runs}, there or in all a signal or the robot file that is not "
    )
    said += "as it is told, or motions that have nothing in common; these do not tell which"
    return _unrelated(names, said, f"{remedy}, and the robot file")


def odd_one(
    samples: Sequence[Sample], how: Assignment, channels: Sequence[int] | None = None
) -> Sample | None:
    """The recording without which all others are fitted together with half of what is left without any other,
    in the geometric mean of the channels; None where there is none, or where two contradict each other and
    there is no third."""
    known = [(s, Normal.of(s)) for s in samples]
    if len(known) < 3:
        return None
    left = []
    for k in range(len(known)):
        rest = added([normal for i, (_, normal) in enumerate(known) if i != k])
        error = solve(rest, None, how).error
        error = error if channels is None else error[list(channels)]
        seen = error[np.isfinite(error)]
        left.append(float(np.exp(np.mean(np.log(np.fmax(seen, FLOOR))))) if len(seen) else np.inf)
    best = int(np.argmin(left))
    return known[best][0] if left[best] < HALF * min(left[:best] + left[best + 1 :]) else None
