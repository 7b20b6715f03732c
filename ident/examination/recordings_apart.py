"""One recording of several that says something else than the others: a sign, a scale, a place, a time.

Every recording's torques are predicted by a fit of the recordings that are fitted, without it, and without
the one among them that contradicts the others most. How far the prediction may be wrong by itself, where what
is fitted hardly shows what it asks for, a delete-block jackknife of the fit says. A cause is told only where
it explains the recording: taken back, it is predicted as is expected. A load that is carried, a contact, a
warmer gear change torques too; none of them turns, swaps or delays one, nor makes it unlike everything that
the motion asks for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from ident.examination.bodies import AS_OTHERS, ENOUGH, beyond_own, standard
from ident.examination.check import Check, listed
from ident.examination.hypothesis import EXPLAINED, Asked
from ident.examination.places import exchanged
from ident.examination.quick import LAGS, Assignment, Normal, Quick, Sample, added, solve
from ident.examination.rivals import rivals
from ident.examination.stretches import ODD as ODD_ONE
from ident.examination.stretches import Explained, agreed, beyond_chance
from ident.examination.unexplained import ODD, TIMES, odd_one
from modelgen.geometry.kinematics import Geometry

TOGETHER = 1.8  # that of all channels, in the mean
ROWS = 300  # of a recording that is looked into
PARTS = 12  # of the fitted recordings that are left out in turn
HALVED = 0.6  # mean gain of the odd channels
LEAST_LAG, LARGE = 0.05, 2.5
OFFSETS = (*(sign * x for x in (0.05, 0.1, 0.2, 0.35, 0.5, 0.8, np.pi / 2) for sign in (1, -1)), np.pi)  # rad
RARE = 1e-3  # rate at which chance may confirm one of some fifty causes
OWN = "give this recording a columns: of its own in the study"
CLEAR = 0.3  # gain of the others' prediction by which one recording that is fitted is told from them


def shares_left(sample: Sample, chi: np.ndarray) -> np.ndarray:
    """(N, C) squares of what a fit leaves of the torques, in shares of their sums of squares; NaN of a torque
    of which nothing is seen."""
    size = (sample.weight * sample.Y**2).sum(axis=0)
    left = sample.weight * (sample.Y - sample.predicted(chi)) ** 2
    return np.where(size > 0, left / np.where(size > 0, size, 1.0), np.nan)


@dataclass(frozen=True, slots=True)
class Apart:
    """A recording, chi that the others give, errors (C,) here, elsewhere, and as they are expected here,
    channels that are odd; size and travel (C,) of its torques and of their joints against the others'."""

    sample: Sample
    chi: np.ndarray
    error: np.ndarray
    usual: np.ndarray
    expected: np.ndarray
    odd: tuple[int, ...]
    size: np.ndarray
    travel: np.ndarray

    def left(self, sample: Sample) -> np.ndarray:
        """(C,) errors of its torques as they would be."""
        return np.sqrt(shares_left(sample, self.chi).sum(axis=0))

    def explains(self, sample: Sample) -> bool:
        """Whether all channels are then as elsewhere."""
        live = np.isfinite(self.error)
        most = np.fmin(np.fmax(AS_OTHERS * self.expected, ENOUGH), EXPLAINED)
        most = np.fmax(most, np.where(np.isin(np.arange(len(most)), self.odd), 0.0, 1.1 * self.error))
        left, odd = self.left(sample), list(self.odd)
        halved = np.mean(np.log(self.error[odd] / np.fmax(left[odd], 1e-6))) > HALVED
        return bool(halved and (left[live] < most[live]).all())

    def steadily(self, sample: Sample) -> bool:
        """Whether the odd channels are explained better in one stretch as in another, but for chance at RARE:
        a sensor of a rokae whose third joint has another zero was 0.2 s early, by one stretch of twelve."""
        parts = np.array_split(np.arange(len(sample.t)), PARTS)
        left = [shares_left(its, self.chi)[:, list(self.odd)] for its in (self.sample, sample)]
        before, after = (np.array([max(its[k].sum(), 1e-300) for k in parts]) for its in left)
        return beyond_chance(0.5 * np.log(before / after), RARE)

    def beyond(self, sample: Sample) -> bool:
        """Whether the odd channels keep, in the mean, more than what is expected."""
        odd = list(self.odd)
        with np.errstate(invalid="ignore", divide="ignore"):
            return bool(np.nanmean(np.log(self.left(sample)[odd] / self.expected[odd])) > np.log(AS_OTHERS))


@dataclass(frozen=True, slots=True)
class Cause:
    """What would be different in this recording; `sample` is it as it then was."""

    sample: Sample
    check: str
    signals: tuple[str, ...]
    words: str
    remedy: str
    alike: bool = False  # something ordinary (a load) looks alike: it has to leave what is usual in the mean


def recordings_apart(asked: Asked) -> Iterator[Check]:
    """A warning for each recording that stands apart, with its cause where one explains it."""
    quick = asked.quick
    for apart in _apart(quick, asked.how):
        together = _Together.of(asked, apart)
        causes = [*_torques(asked, apart), *_positions(quick, apart)]
        causes = [
            cause
            for cause in causes
            if apart.explains(cause.sample)
            and apart.steadily(cause.sample)
            and not (cause.alike and apart.beyond(cause.sample))
            and together.explains(cause.sample)
        ]
        if causes:
            here = 100 * float(np.nanmax(apart.error[list(apart.odd)]))
            instead = _instead(asked, together, causes)
            left = [float(np.nansum(np.log(apart.left(cause.sample)))) for cause in causes]
            best, least = causes[int(np.argmin(left))], min(left)
            body = _body(quick, apart) if best.alike else None
            load = body is not None and float(np.nansum(np.log(apart.left(body)))) < least
            if instead and not load:
                continue
            load_too = ["a load is carried that the study does not declare"] if load else []
            others = [s.label for s in quick.samples if s.label != apart.sample.label]
            there_too = [f"the other way in {others[0]}"] if best.alike and len(others) == 1 else []
            words = ", or ".join([best.words, *there_too, *load_too, *instead])
            said = f"{words} (as it is, the other recordings predict it with an error of {here:.0f} %, "
            said += f"so taken {100 * float(np.nanmax(apart.left(best.sample)[list(apart.odd)])):.0f} %)"
            check = _check(best.check, apart, best.signals, said, best.remedy)
            yield replace(check, explains=not (load or instead or best.alike))
        elif unlike := [c for c in apart.odd if _unlike(apart, c) and together.contradicted()[c]]:
            most = len(unlike) > 1 and len(unlike) > len(apart.error) / 2
            if not most and np.nanmedian(_by_itself(apart.sample)) > EXPLAINED:
                continue  # its own motion explains most torques no better: it is not this one
            names = asked.names(unlike)
            here, there = (100 * float(np.nanmax(e[unlike])) for e in (apart.error, apart.usual))
            if rivals_of := _or_another(asked, apart, unlike):
                do, say = (("does", "do")[len(names) > 1], ("says", "say")[len(rivals_of) > 1])
                yield _check(
                    "unrelated_torque",
                    apart,
                    names,
                    f"{listed(names)} {do} not go with what {listed(rivals_of)} {say} (error {here:.0f} %, "
                    f"there {there:.0f} %), and these do not tell which recording is the odd one: another "
                    "robot, load, signal or run or a contact in one of them, or in all a signal or the file",
                    "check how they were recorded, and the robot file",
                )
                continue
            yield _check(
                "wrong_robot" if most else "unrelated_torque",
                apart,
                names,
                f"{listed(names)} {'is' if len(names) == 1 else 'are'} nothing like what the other "
                f"recordings say of this motion (error {here:.0f} %, there {there:.0f} %): another signal, "
                "another run's, or another robot's, a sign that changes on the way, or something large that "
                "the model lacks here",
                "check how it was recorded, or leave the recording out",
            )


def _or_another(asked: Asked, apart: Apart, channels: Sequence[int]) -> list[str]:
    """The fitted recordings of which one may be the odd one in the place of a judged one whose own motion
    explains its torques. (Of an arm's study with another arm's run to fit the run that judges was blamed.)"""
    fitted = [s.label for s in asked.quick.fitted]
    if apart.sample.label in fitted:
        return []
    if _unrelated(apart.sample, channels):
        return []
    odd = odd_one(asked.quick.samples, asked.how, channels)
    return [] if odd is not None and odd.label == apart.sample.label else fitted


def _unrelated(sample: Sample, channels: Sequence[int]) -> bool:
    """Whether none of these torques is explained by its own recording's motion."""
    return bool((_by_itself(sample)[list(channels)] > EXPLAINED).all())


def _by_itself(sample: Sample) -> np.ndarray:
    """(C,) errors of a fit of this recording alone."""
    return solve(Normal.of(sample), None, Assignment.plain(sample.Y.shape[1])).error


@dataclass(frozen=True, slots=True)
class _Together:
    """All recordings, thinned, to be fitted as one with that in `place` otherwise; usual errors (C,)."""

    quick: Quick
    place: int
    usual: np.ndarray

    @classmethod
    def of(cls, asked: Asked, apart: Apart) -> _Together:
        its = asked.quick.samples
        samples = [thinned(_assigned(replace(s, role="identify"), asked.how)) for s in its]
        place = [s.label for s in samples].index(apart.sample.label)
        return cls(asked.quick.of(samples), place, apart.usual)

    def by(self, sample: Sample) -> Explained:
        samples = list(self.quick.samples)
        samples[self.place] = replace(sample, role="identify")
        return Explained.by(self.quick.of(samples), self.quick.plain())

    def explains(self, sample: Sample) -> bool:
        """Whether the model then explains every torque of the recording, or as much as of the others. (Of a
        KR 300 with a UR10e's run one torque was 0.0134 times too large, and the others 40 to 150 times.)"""
        left = np.sqrt(shares_left(sample, self.by(sample).fit.chi).sum(axis=0))
        return bool((left <= np.fmax(EXPLAINED, AS_OTHERS * self.usual))[np.isfinite(self.usual)].all())

    def contradicted(self) -> np.ndarray:
        """(C,) bool: whether one fit of all recordings leaves more of the recording's torques than a fit of
        their own, or that leaves most. (Of an LWR4+ with all torques 0.06 s late a slow recording's fifth was
        another signal: the others foretold it badly, and it goes with them.)"""
        its, plain = self.quick.each[self.place], self.quick.plain()
        joint, own = its.errors(self.quick.fit(plain).chi, plain), solve(its, None, plain).error
        return np.asarray(beyond_own(joint, own) | (own > EXPLAINED))


def _instead(asked: Asked, together: _Together, causes: Sequence[Cause]) -> list[str]:
    """The fault that one number describes which stretch by stretch of all recordings explains more than every
    cause, if there is one: a rokae's torque a third too large in another recording was a zero here."""
    made, plain = [together.by(cause.sample) for cause in causes], together.quick.plain()
    before = together.quick.fit(plain)
    others = [
        rival
        for rival in rivals(together.quick, plain, asked.currents)
        if all(agreed(its, rival.explained, ODD_ONE) for its in made)
    ]
    others.sort(key=lambda rival: -rival.explained.fit.gain_over(before))
    return [rival.words for rival in others[:1]]


def _check(check: str, apart: Apart, signals: tuple[str, ...], words: str, remedy: str) -> Check:
    return Check(check, signals, f"in this recording {words}", remedy, recording=apart.sample.label)


def _apart(quick: Quick, how: Assignment) -> Iterator[Apart]:
    """Recordings that the others do not predict, though these predict each other."""
    if len(quick.samples) < 2:
        return
    samples = [_assigned(s, how) for s in quick.samples]
    sums = [Normal.of(s) for s in samples]
    fitted = [k for k, s in enumerate(samples) if s.role == "identify"]
    plain, known = quick.plain(), {samples[k].payload for k in fitted}

    def others(without: int) -> tuple[np.ndarray, np.ndarray]:
        chi = solve(added([sums[k] for k in fitted if k != without]), None, plain).chi
        return chi, np.array([normal.errors(chi, plain) for normal in sums])

    def misfit(errors: np.ndarray, without: int) -> float:
        kept = np.log(np.fmax(np.delete(errors, without, 0) if without >= 0 else errors, 3e-3))
        return float(np.nansum(_middle(kept, np.nanmean)))

    tables = {-1: others(-1)}
    if len(fitted) > 1 and len(samples) > 2:
        tables |= {k: others(k) for k in fitted}
    misfits = {k: misfit(errors, k) for k, (_, errors) in tables.items()}
    odd_one = min(misfits, key=lambda k: misfits[k])
    odd_one = odd_one if misfits[odd_one] < misfits[-1] - CLEAR else -1
    chi, errors = tables[odd_one]
    with np.errstate(invalid="ignore", divide="ignore"):
        reach = np.array([np.ptp(s.q, axis=0) for s in samples])[:, quick.columns.joint_of]
        sizes = np.sqrt([np.diag(normal.yy) / normal.rows for normal in sums])  # (K, C) rms
    for k, sample in enumerate(samples):
        if sample.payload not in known or (k in fitted and k != odd_one):
            continue  # a load of its own, or one of those that the others are compared with
        rest = [i for i in range(len(samples)) if i != k and i != odd_one]
        usual = _middle(errors[rest])
        if not len(_odd(errors[k], usual)):
            continue
        expected = np.hypot(usual, _unsure(sample, [samples[i] for i in fitted if i != odd_one], plain))
        odd = _odd(errors[k], expected)
        if len(odd):
            size = sizes[k] / np.fmax(_middle(sizes[rest]), 1e-300)
            travel = reach[k] / np.fmax(np.median(reach[rest], axis=0), 1e-9)
            yield Apart(thinned(sample), chi, errors[k], usual, expected, tuple(odd.tolist()), size, travel)


def _odd(error: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Channels whose error (C,) is far beyond what is expected; less is enough where all are."""
    with np.errstate(invalid="ignore", divide="ignore"):
        times = error / expected
        known = times[np.isfinite(times) & (times > 0)]
        together = bool(len(known)) and np.exp(np.mean(np.log(known))) > TOGETHER
        return np.flatnonzero((error > ODD) & (times > (TOGETHER if together else TIMES)))


def _unsure(sample: Sample, fitted: Sequence[Sample], how: Assignment) -> np.ndarray:
    """(C,) standard deviation of the prediction of this recording, in its torque's size: the fit is made
    without each of some stretches of the fitted recordings in turn."""
    parts = [p for s in fitted for p in _stretches(s, max(2, PARTS // len(fitted)))]
    sums = [Normal.of(p) for p in parts]
    chis = [solve(added([*sums[:k], *sums[k + 1 :]]), None, how).chi for k in range(len(sums))]
    thin = thinned(sample)
    made = np.stack([thin.predicted(chi) for chi in chis])
    spread = (len(chis) - 1) * made.var(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.sqrt((thin.weight * spread).sum(axis=0) / (thin.weight * thin.Y**2).sum(axis=0))


def _stretches(s: Sample, count: int) -> list[Sample]:
    return [s.rows(rows) for rows in np.array_split(np.arange(len(s.t)), count)]


def _middle(values: np.ndarray, of: Any = np.nanmedian) -> np.ndarray:
    """(C,) of values (K, C); NaN where a channel has none."""
    out = np.full(values.shape[1], np.nan)
    some = np.isfinite(values).any(axis=0)
    out[some] = of(values[:, some], axis=0)
    return out


def thinned(s: Sample) -> Sample:
    """Rows enough to judge by, few enough to try a hundred motions."""
    return s.rows(slice(None, None, max(1, len(s.t) // ROWS)))


def _assigned(s: Sample, how: Assignment) -> Sample:
    order, factor = list(how.order), np.array(how.factor)
    return replace(s, Y=s.Y[:, order] * factor, late=s.late[:, :, order] * factor)


def _unlike(apart: Apart, c: int) -> bool:
    """No load or contact does that: a torque as large as elsewhere hardly goes with its motion."""
    r, error = _correlation(apart, c), apart.error[c]
    if not apart.expected[c] <= EXPLAINED:  # what the others do not foretell, or not explain either
        return False
    alike = 0.5 < apart.size[c] < 2.0 or len(apart.odd) > len(apart.error) / 2
    alike = alike and apart.travel[c] > 0.3
    return bool(alike and ((error > 0.5 and r < 0.3) or (error > 1.0 and r < 0.75)))


def _correlation(apart: Apart, c: int) -> float:
    s = apart.sample
    y, x = s.Y[:, c], s.W[c] @ apart.chi
    w = s.weight[:, c]
    y, x = y - np.average(y, weights=w), x - np.average(x, weights=w)
    return float(abs((w * x) @ y) / np.sqrt(max(((w * x) @ x) * ((w * y) @ y), 1e-300)))


def _torques(asked: Asked, apart: Apart) -> Iterator[Cause]:
    """Torques turned, scaled, swapped, late."""
    s, odd = apart.sample, list(apart.odd)
    names = asked.names(odd)
    has, is_ = ("has", "is") if len(odd) == 1 else ("have", "are")

    def cause(Y: np.ndarray, check: str, signals: tuple[str, ...], words: str, lines: Sequence[str]) -> Cause:
        return Cause(replace(s, Y=Y), check, signals, words, f"{OWN} with {{{', '.join(lines)}}}")

    def times(factor: np.ndarray | float) -> np.ndarray:
        Y = s.Y.copy()
        Y[:, odd] *= factor
        return Y

    turned = [f"{name}: {{sign: -1}}" for name in names]
    yield cause(times(-1), "torque_sign", names, f"{listed(names)} {has} the other sign", turned)
    predicted = s.predicted(apart.chi)
    w = s.weight

    def scale(y: np.ndarray, c: int | list[int]) -> np.ndarray:
        """What y (N,) or (N, k) has to be multiplied by."""
        return (w[:, c] * predicted[:, c] * y).sum(axis=0) / np.maximum((w[:, c] * y**2).sum(axis=0), 1e-300)

    factor = scale(s.Y[:, odd], odd)
    if (np.abs(np.log(np.abs(factor))) > np.log(LARGE)).all() and (factor > 0).all():
        size = ", ".join(f"{1 / f:.3g}" for f in factor)
        lines = [f"{name}: {{scale: {f:.3g}}}" for name, f in zip(names, factor)]
        words = f"{listed(names)} {is_} {size} times what the others say"
        yield cause(times(factor), "torque_scale", names, words, lines)
    channels = asked.quick.columns.need.channels
    for a, b in combinations(range(len(channels)), 2):
        if channels[a].side == channels[b].side and (a in odd or b in odd):
            Y = s.Y.copy()
            for c, d in ((a, b), (b, a)):
                own_gain = float(scale(s.Y[:, d], c)) if asked.currents else 1.0
                Y[:, c] = s.Y[:, d] * (own_gain if 1 / LARGE < own_gain < LARGE else 1.0)
            one, other = pair = (asked.name(a), asked.name(b))
            lines = [f"{one}: {other}", f"{other}: {one}"]
            yield cause(Y, "swapped_signals", pair, f"{one} and {other} look swapped", lines)
    for which in (odd, list(range(len(channels)))):
        shifted = [np.where(np.isin(np.arange(len(channels)), which), late, s.Y) for late in s.late]
        moved = [replace(s, Y=Y) for Y in shifted]
        k = int(np.argmin([np.nansum(np.log(apart.left(its))) for its in moved]))
        lag = LAGS[k]
        if LEAST_LAG <= abs(lag) < max(LAGS):  # the largest is no lag that was found: more would be better
            late = asked.names(which)
            words = f"{listed(late)} {'is' if len(late) == 1 else 'are'} recorded about {abs(lag):g} s "
            words += f"{'after' if lag > 0 else 'before'} the positions"
            yield Cause(moved[k], "channel_delay", late, words, "record both with one clock")


def _positions(quick: Quick, apart: Apart) -> Iterator[Cause]:
    """Positions turned, swapped (alone, or joint for joint with their torques), from another zero."""
    s, columns = apart.sample, quick.columns
    labels = [f"q{j}" for j in columns.need.joints]
    n = len(labels)
    for j, name in enumerate(labels):
        its = np.arange(n) == j
        made = s.moved(columns, factor=np.where(its, -1.0, 1.0))
        line = f"{OWN} with {{{name}: {{sign: -1}}}}"
        yield Cause(made, "position_sign", (name,), f"{name} has the other sign", line)
        turning = str(columns.need.joints[j]) not in columns.model.prismatic
        for offset in OFFSETS if turning else ():
            words = f"{name} starts from another zero, about {-offset:.2g} rad off"
            line = f"{OWN} with {{{name}: {{offset: {offset:.3g}}}}}"
            made = s.moved(columns, offset=np.where(its, offset, 0.0))
            yield Cause(made, "position_zero", (name,), words, line, alike=True)
    for a, b in combinations(range(n), 2):
        made = s.moved(columns, exchanged(n, a, b))
        one, other = pair = (labels[a], labels[b])
        line = f"{OWN} with {{{one}: {other}, {other}: {one}}}"
        yield Cause(made, "swapped_signals", pair, f"{one} and {other} look swapped", line)
        words = f"joints {one[1:]} and {other[1:]} look swapped, positions and torques"
        line = f"{OWN} that exchanges their signals"
        yield Cause(_exchanged(quick, made, a, b), "swapped_signals", pair, words, line)


def _body(quick: Quick, apart: Apart) -> Sample | None:
    """The recording without the torque of the body on one link more, the link on which it explains most; None
    where the model has no bodies. (A weight on a rokae's second link was told as its joint's other zero.)"""
    s, columns = apart.sample, quick.columns
    if columns.need.model == "D":
        return None
    table = Geometry.of(columns.model.geometry)
    bodies = standard(table, s.q, s.dq, s.ddq, free=False)[0]
    predicted = s.predicted(apart.chi)
    weight = np.sqrt(s.weight / np.maximum((s.weight * s.Y**2).sum(axis=0), 1e-300))
    tried = []
    for j in range(len(table.rows)):
        Z = bodies[columns.joint_of, :, 10 * j : 10 * j + 10].transpose(1, 0, 2)  # (N, C, 10)
        Zw = (weight[:, :, None] * Z).reshape(-1, 10)
        x, *_ = np.linalg.lstsq(Zw, (weight * (s.Y - predicted)).ravel(), rcond=1e-6)
        tried.append(replace(s, Y=s.Y - Z @ x))
    return min(tried, key=lambda its: float(np.nansum(np.log(apart.left(its)))))


def _exchanged(quick: Quick, s: Sample, a: int, b: int) -> Sample:
    """The torques of two joints in each other's place, side by side."""
    joint, side = quick.columns.joint_of, [c.side for c in quick.columns.need.channels]
    place = {(int(j), w): c for c, (j, w) in enumerate(zip(joint, side))}
    to = exchanged(len(quick.columns.need.joints), a, b)
    order = [place.get((to[j], w), c) for (j, w), c in place.items()]
    return replace(s, Y=s.Y[:, order], late=s.late[:, :, order])
