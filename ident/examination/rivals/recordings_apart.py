"""A recording whose torques are unlike everything that its motion asks for, by what the others say.

Every recording's torques are predicted by a fit of the recordings that are fitted, without it, and without
the one among them that contradicts the others most. How far the prediction may be wrong by itself, where what
is fitted hardly shows what it asks for, a delete-block jackknife of the fit says. A load that is carried, a
contact, a warmer gear change torques too; they hardly make one unlike everything, but 5 kg did an AIRBOT's
last one. Of which signal it is `another_signal` asks.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ident.distributions import t_beyond
from ident.examination.check import Check, instead, listed
from ident.examination.fits.bodies import AS_OTHERS, beyond_own
from ident.examination.fits.hypothesis import EXPLAINED, Asked
from ident.examination.fits.quick import Assignment, Normal, Quick, added, solve
from ident.examination.fits.samples import Sample
from ident.examination.fits.stretches import HALF, RARE, Explained, all_rows, steadily
from ident.examination.fits.unexplained import ODD, TIMES, by_each_recording, odd_one
from ident.examination.rivals.rivals import of_one_recording
from ident.examination.tables.repeats import TRAVELLED

TOGETHER = 1.8  # that of all channels, in the mean
ROWS = 300  # of a recording that is looked into
PARTS = 12  # of the fitted recordings that are left out in turn
CLEAR = 0.3  # gain of the others' prediction by which one recording that is fitted is told from them
OF_HALF = "another signal, zero, sign or unit from there on or up to there, a load, or a contact"
OF_WHOLE = (
    "a load that is not declared, a contact, another state of the robot, what the model lacks, or a signal "
    "that is not as it is told, here or there"
)
HOW = "ident diagnose asks which; check how they were recorded"


@dataclass(frozen=True, slots=True)
class Apart:
    """A recording, chi that the others give, errors (C,) here, elsewhere, and as they are expected here,
    channels that are odd; size and travel (C,) of its torques and of their joints against the others', and
    whether these go anywhere here."""

    sample: Sample
    chi: np.ndarray
    error: np.ndarray
    usual: np.ndarray
    expected: np.ndarray
    odd: tuple[int, ...]
    size: np.ndarray
    travel: np.ndarray
    goes: np.ndarray


def recordings_unlike(asked: Asked, found: Sequence[Apart]) -> Iterator[Check]:
    """A warning for each of the recordings found apart whose torques nothing ordinary makes so."""
    for apart in found:
        contradicted = _contradicted(asked, apart)
        unlike = [c for c in apart.odd if _unlike(apart, c) and contradicted[c]]
        unlike = [c for c in unlike if asked.name(c) not in asked.clipped]  # of which a part is left
        most = len(unlike) > 1 and len(unlike) > len(apart.error) / 2
        if not unlike or (not most and np.nanmedian(_by_itself(apart.sample)) > EXPLAINED):
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
            "another run's, or another robot's, a sign that changes on the way, a clock of another rate, or "
            "something large that acts here or that the model lacks (a load, a contact, a zero that changes)",
            "check how it was recorded, or leave the recording out",
        )


def halves_apart(asked: Asked) -> Iterator[Check]:
    """A half of a recording with torques that all other halves foretell worse than chance leaves them, and
    that one fit of all does not take. (Of a UR10e two of whose torques were exchanged in half of the fitted
    run 46 % were left for 5, and nothing was said.)"""
    whole, each = asked.quick.samples, list[Sample]()
    for s in whole:
        ends = (0, len(s.t) // 2, len(s.t))
        halves = zip(("first", "second"), (s.rows(slice(ends[k], ends[k + 1])) for k in (0, 1)))
        each += [replace(half, label=f"{which} half of {s.label}") for which, half in halves]
    parts, told = replace(asked, quick=asked.quick.of(each)), set[tuple[int, tuple[str, ...]]]()
    for apart in recordings_apart(parts.quick, asked.how):
        rate, against = RARE / (apart.error.size * len(each)), _contradicted(parts, apart)
        odd = [c for c in apart.odd if against[c] and _beyond_chance(apart, c, rate)]
        odd = [c for c in odd if asked.name(c) not in asked.clipped]  # of which a part is left
        if odd:
            most = odd[int(np.argmax((apart.error / apart.expected)[odd]))]
            names, k = asked.names(odd), [s.label for s in each].index(apart.sample.label)
            half, both = _itself_odd(parts.quick, asked.how, k, odd)
            which = f": {OF_HALF}" if half > both else f", and the other half goes with it: {OF_WHOLE}"
            sure = both < HALF * half
            if half > both and not sure:
                which = f", and these do not tell whether the other half goes with it: {OF_WHOLE}"
            if half <= both and (k // 2, names) in told:
                continue  # both halves, which go with each other
            told.add((k // 2, names))
            yield Check(
                "unrelated_torque",
                names,
                f"in the {apart.sample.label} {listed(names)} {'is' if len(odd) == 1 else 'are'} foretold by "
                f"all the rest worse than its motion leaves unsure ({asked.name(most)} to "
                f"{100 * apart.error[most]:.0f} %, not {100 * apart.expected[most]:.0f} %){which}",
                "look at its plot, and use the other half with from: or to:" if sure else HOW,
                recording=whole[k // 2].label,
            )


def _itself_odd(quick: Quick, how: Assignment, k: int, channels: Sequence[int]) -> tuple[float, float]:
    """How much less of these torques is left, by its logarithm, where half k of a recording has a robot of
    its own, and where both of its halves have one, than where one robot is that of all. (Of a TX40 whose last
    torques were 1.7 times too large in the run that judges the half that does not show it was to be used; of
    a KR 300 with another torque in its fifth one in all of that run the half that shows it less.)"""
    other = k ^ 1
    rest = [its for i, its in enumerate(quick.each) if i not in (k, other)]

    def left(*groups: Sequence[Normal]) -> float:
        chi2 = np.zeros(len(how.order))
        for normal in map(added, groups):
            chi2 += normal.right(how)[0] * np.nan_to_num(solve(normal, None, how).error) ** 2
        return float(np.log(np.fmax(chi2[list(channels)], 1e-300)).sum())

    one, two = quick.each[k], quick.each[other]
    whole = left([*rest, one, two])
    return whole - left([*rest, two], [one]), whole - left(rest, [one, two])


def foretold_badly(asked: Asked, found: Sequence[Apart]) -> Iterator[Check]:
    """The same of those of which most torques are odd and nothing is told, or one that chance seldom leaves
    and that everyday faults of one recording would explain: ordinary causes make them so, too. (Of a rokae
    with 2 kg in the run that judges 30 % were foretold for 3, of a TX40 and a Franka with another zero of one
    torque 363 and 66 % for 31 and 9, and nothing was said.)"""
    fitted = [s.label for s in asked.quick.fitted]
    for apart in found:
        odd, causes = list(apart.odd), ""
        if len(odd) <= len(asked.seen) / 2:
            sure = _causes(asked, [c for c in odd if _beyond_chance(apart, c, RARE / apart.error.size)])
            odd = [c for c, words in sure.items() if words]
            causes = "; ".join(f"{words[0]}{instead(words[1:])}" for words in sure.values() if words)
            causes = f"; it would be explained where {causes}" if causes else ""
        if not odd:
            continue
        others = [label for label in fitted if label != apart.sample.label]
        most = odd[int(np.argmax((apart.error / apart.expected)[odd]))]
        names = asked.names(odd)
        yield _check(
            "unrelated_torque",
            apart,
            names,
            f"{listed(names)} {'is' if len(odd) == 1 else 'are'} foretold by {listed(others)} worse than "
            f"their motions leave unsure ({asked.name(most)} to {100 * apart.error[most]:.0f} %, not "
            f"{100 * apart.expected[most]:.0f} %): {OF_WHOLE}{causes}",
            HOW,
        )


def _beyond_chance(apart: Apart, c: int, rate: float) -> bool:
    """Whether what is expected, of a torque that is foretold at all, leaves its error to chance so seldom. Of
    a joint that rests friction is anything between its two signs. (Of a clean AIRBOT whose last joint rested
    its torque was foretold to 171 %.)"""
    error, expected = apart.error[c], apart.expected[c]
    known = expected <= EXPLAINED and apart.goes[c]
    return bool(known and t_beyond(float(error / expected), PARTS - 1) < rate)


def _causes(asked: Asked, channels: Sequence[int]) -> dict[int, list[str]]:
    """Of each torque the everyday faults of one recording with which one fit of all explains it about as fits
    of each do, most first."""
    if not channels:
        return {}
    whole = all_rows(asked.quick)
    plain, own = Explained.by(whole, asked.how), by_each_recording(whole, asked.how)
    found: dict[int, list[tuple[float, str]]] = {c: [] for c in channels}
    for its in of_one_recording(asked, whole, asked.how):
        error = its.explained.fit.error
        as_others = [c for c in channels if error[c] < AS_OTHERS * own[c] < plain.fit.error[c]]
        if as_others and steadily(plain, its.explained, RARE):
            for c in as_others:
                found[c].append((float(error[c]), its.words))
    return {c: [words for _, words in sorted(each, key=lambda one: one[0])] for c, each in found.items()}


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


def _contradicted(asked: Asked, apart: Apart) -> np.ndarray:
    """(C,) bool: whether one fit of all recordings leaves more of the recording's torques than a fit of
    their own, or that leaves most. (Of an LWR4+ with all torques 0.06 s late a slow recording's fifth was
    another signal: the others foretold it badly, and it goes with them.)"""
    its, plain = asked.quick.samples, asked.quick.plain()
    sums = [Normal.of(thinned(s.read(asked.how.order, asked.how.factor))) for s in its]
    mine = sums[[s.label for s in its].index(apart.sample.label)]
    joint, own = mine.errors(solve(added(sums), None, plain).chi, plain), solve(mine, None, plain).error
    return np.asarray(beyond_own(joint, own) | (own > EXPLAINED))


def _check(check: str, apart: Apart, signals: tuple[str, ...], words: str, remedy: str) -> Check:
    return Check(check, signals, f"in this recording {words}", remedy, recording=apart.sample.label)


def recordings_apart(quick: Quick, how: Assignment) -> Iterator[Apart]:
    """Recordings that the others do not predict, though these predict each other."""
    if len(quick.samples) < 2:
        return
    samples = [s.read(how.order, how.factor) for s in quick.samples]
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
            said, goes = tuple(odd.tolist()), reach[k] > TRAVELLED
            yield Apart(thinned(sample), chi, errors[k], usual, expected, said, size, travel, goes)


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
