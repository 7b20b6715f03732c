"""Torques recorded late or early against the positions: one channel, or all of them alike.

Both are written by one logger, but come over other buses, through other filters. A delay of some samples is
an effect that the diagnosis fits; here it is told where it spoils a channel: taken back, its error falls by a
third on the recordings that are fitted and clearly on those that are not, stretch by stretch (beside a weight
on one run of a Franka its last sensor, which drags by itself, was told to be late). It has to spoil it where
the joints keep their direction, too, and however dry friction turns over: that gives way over a travel and
comes late where joints turn or start, and nowhere else (of clean arms at 6 to 100 mrad/s by 0.05 to 0.07 s);
nor is it told where a step of the encoders hides a turn for as long. A strong smoothing of the torque looks
like it and is said with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ident.examination.check import Check, listed
from ident.examination.fits.hypothesis import CLEARLY, Asked, Hypothesis
from ident.examination.fits.quick import FLOOR, Assignment, Fit, Normal, Quick, added, alone, gain_of, solve
from ident.examination.fits.samples import LAGS, Sample
from ident.examination.fits.stretches import RARE, Explained, all_rows, confirmed, half_of, steadily
from ident.examination.fits.turning import with_any_turn_over

SPOILED = 0.03  # error of a channel from which it is asked
OWN, HELD, TOGETHER = 0.5, 0.25, 0.35  # gain of one channel's own error, on validate, of each of all
FITTED_S = 0.1  # which a diagnosis fits: the bound of its effect
OVER = 4.6  # times a lag: after it a hundredth is left of a turn that takes as long on the mean
RATES = tuple(sign * x for x in (0.001, 0.002, 0.005, 0.01, 0.02) for sign in (1, -1))  # of clocks


def delays(asked: Asked) -> Iterator[Hypothesis]:
    """One torque, or all of them, at another time than their positions; where one is, more of them are held
    against it. (Of an LWR4+ whose positions were all 0.11 s late its fourth torque was told as 0.15 s
    early.)"""
    fit = asked.fit
    seen = np.flatnonzero(np.isfinite(fit.error)).tolist()
    groups = [[c] for c in seen if fit.error[c] > SPOILED]
    if groups and len(seen) > 1:
        groups.append(seen)
    for which in groups:
        if not _worth_asking(asked, which):
            continue
        its, moved, lag, other = _best(asked, which)
        rate = 0.0
        if len(which) == len(seen):
            its, moved, lag, other, rate = _or_running(asked, which, its, moved, lag, other)
        own = _gain(asked.fit.error, other.error, which)
        held = own
        if fit.validate is not None and other.validate is not None:
            held = _gain(fit.validate, other.validate, which)
        if own < (OWN if len(which) == 1 else TOGETHER) or held < HELD:
            continue
        if its.gain < 0.8 * own or not confirmed(asked.quick, asked.how, moved, asked.how, len(seen)):
            continue
        if abs(lag) < hidden_s(asked, which):
            continue
        if not all(_spoils(asked, moved, which, aside) for aside in asides(lag, rate)):
            continue
        yield its if len(which) == len(seen) else _or_more(asked, its, moved, seen)


def _or_more(asked: Asked, its: Hypothesis, moved: Quick, seen: Sequence[int]) -> Hypothesis:
    """One torque at another time, or more of them where those explain steadily more: all, or those up to a
    joint or behind it, as one drive's bus has them; with all that are not rejected beside that and explain as
    much of the same torques. (Of a rokae's third torque 0.04 s late the third to the last were told as 0.03 s
    late, or the last three, which other torques' gains had brought.)"""
    groups = [seen, *(part for k in range(2, len(seen) - 1) for part in (seen[:k], seen[k:]))]
    each = [(its, moved), *(_best(asked, group)[:2] for group in groups)]
    tried = [(h, Explained.by(all_rows(way), asked.how)) for h, way in each]
    plain, one = Explained.by(all_rows(asked.quick), asked.how), tried[0][1]
    more = [(h, way) for h, way in tried[1:] if h.gain > its.gain and steadily(one, way, RARE)]
    first, told = max(more, key=lambda each: each[0].gain, default=tried[0])
    near = [
        h
        for h, way in tried
        if h is not first and half_of(plain, told, way) and not steadily(way, told, RARE)
    ]
    return first.beside(sorted(near, key=lambda h: -h.gain))


def _best(asked: Asked, which: Sequence[int]) -> tuple[Hypothesis, Quick, float, Fit]:
    """These torques at the other time with which they are explained best: recordings, time [s] and fit."""
    quick, fit, how = asked.quick, asked.fit, asked.how
    fits = [_at(quick, how, which, k) for k in range(len(LAGS))]
    best = int(np.argmax([other.gain_over(fit) for other in fits]))
    other, lag, samples = fits[best], LAGS[best], []
    for s in quick.samples:
        Y = s.Y.copy()
        for c in which:
            Y[:, how.order[c]] = s.late[best][:, how.order[c]]
        samples.append(replace(s, Y=Y))
    said = "all torques" if len(which) == len(fit.error) > 1 else listed(asked.names(which))
    more = " or more" if abs(lag) >= max(LAGS) else ""  # is not looked for
    words = f"{said} {'is' if len(which) == 1 else 'are'} recorded about {abs(lag):g} s{more} "
    words += f"{'after' if lag > 0 else 'before'} the positions"
    smoothed, moved = " or smoothed as much" if lag > 0 else "", quick.of(samples)
    remedy = "record torques and positions with one clock; "
    fitted = abs(lag) <= FITTED_S
    shown = "ident diagnose fits the delay where the runs that judge show it, too"
    remedy += shown if fitted else f"or move the torques' stamps by {-lag:g} s"
    return _told(asked, which, words, smoothed, other, moved, remedy, fitted), moved, lag, other


def _or_running(
    asked: Asked, which: Sequence[int], its: Hypothesis, moved: Quick, lag: float, other: Fit
) -> tuple[Hypothesis, Quick, float, Fit, float]:
    """All torques by a clock of another rate, which is returned, too, where that explains clearly more than
    one delay; beside it where the delay is not rejected. (A UR10e's, a hundredth too slow over 50 s, were
    told to be 0.3 s early; of its own by half as much nothing was, and a delay of its first joint and two
    hystereses in a diagnosis.)"""
    made = {rate: asked.quick.of([_running(s, rate) for s in asked.quick.samples]) for rate in RATES}
    fits = {rate: quick.fit(asked.how) for rate, quick in made.items()}
    rate = max(RATES, key=lambda rate: fits[rate].gain_over(asked.fit))
    if fits[rate].gain_over(other) < CLEARLY:
        return its, moved, lag, other, 0.0
    words = (
        f"the clock of the torques runs about {100 * abs(rate):.2g} % too {'fast' if rate > 0 else 'slow'}"
    )
    told = _told(asked, which, words, "", fits[rate], made[rate], "stamp torques and positions by one clock")
    one, two = (Explained.by(all_rows(quick), asked.how) for quick in (moved, made[rate]))
    told = told if steadily(one, two, RARE) else told.beside([its])
    longest = max(s.t[-1] - s.t[0] for s in asked.quick.samples)
    return told, made[rate], rate * longest, fits[rate], rate


def _running(s: Sample, rate: float) -> Sample:
    """With torques taken later by a share of the time since its start."""
    return replace(s, Y=s.later(rate * (s.t - s.t[0])))


def _told(
    asked: Asked,
    which: Sequence[int],
    words: str,
    also: str,
    other: Fit,
    moved: Quick,
    remedy: str,
    fitted: bool = False,
) -> Hypothesis:
    errors = (np.maximum(x.error[which], FLOOR) for x in (asked.fit, other))
    before, after = (100 * float(np.exp(np.mean(np.log(x)))) for x in errors)
    message = f"{words}{also}: so moved, the error falls from {before:.0f} to {after:.0f} %"
    check = Check("channel_delay", asked.names(which), message, remedy, open=not fitted)
    return Hypothesis(other.gain_over(asked.fit), asked.how, check, moved, words)


def _gain(before: np.ndarray, after: np.ndarray, which: Sequence[int]) -> float:
    """Of each of these channels in the mean."""
    return gain_of(before[which], after[which]) / len(which)


def asides(lag: float, rate: float = 0.0) -> tuple[Callable[[Quick], Quick], ...]:
    """Two ways to put aside the turns at which friction looks like a torque that is late by as much [s]; or
    by a share of the time since a recording's start."""
    return partial(_away_from_turns, lag=abs(lag), rate=abs(rate)), with_any_turn_over


def foretold_later(whole: Quick, how: Assignment, k: int, which: Sequence[int], seconds: float) -> float:
    """By how much more, in the mean of these torques, a fit of the other recordings foretells recording k's
    taken that much later."""
    its = whole.samples[k].read(how.order, how.factor)
    rest = added([each for i, each in enumerate(whole.each) if i != k])
    predicted = its.predicted(solve(rest, None, how).chi)
    here, late = (
        np.sqrt((its.weight * (Y - predicted) ** 2).sum(axis=0)) for Y in (its.Y, its.later(seconds))
    )
    return _gain(here, late, which)


def _spoils(asked: Asked, moved: Quick, which: Sequence[int], aside: Callable[[Quick], Quick]) -> bool:
    """Whether a torque is spoiled, and taken back less so, with turns put aside in this way."""
    one, two = (aside(way).fit(asked.how).error[which] for way in (asked.quick, moved))
    return bool(np.nanmax(one, initial=0.0) > SPOILED) and gain_of(one, two) / len(which) >= HELD


def hidden_s(asked: Asked, which: Sequence[int]) -> float:
    """s for which a turn of these torques' joints is hidden within a step of their encoders, where they are
    slow for these. (Of three hundred clean arms in such steps the torques of nine were told to be 0.02 s
    early.)"""
    every = np.concatenate([s.ddq for s in asked.quick.samples])
    faster = np.maximum(np.sqrt(np.mean(every**2, axis=0)), 1e-12)
    joints = [asked.quick.columns.joint_of[c] for c in which]
    return float(np.sqrt(2 * asked.hidden / faster)[joints].max()) if len(asked.hidden) else 0.0


def _away_from_turns(quick: Quick, lag: float, rate: float) -> Quick:
    """Without the samples of each channel whose joint turns or rests within a lag [s], or has not left that
    behind by then."""
    samples = []
    for s in quick.samples:
        weight, late = s.weight.copy(), rate * (s.t - s.t[0]) if rate else lag
        for c, joint in enumerate(quick.columns.joint_of):
            still = s.weight[:, c] == 0
            turns = s.t[1:][(np.diff(np.sign(s.dq[:, joint])) != 0) | (still[1:] & still[:-1])]
            last = np.append(-np.inf, turns)[np.searchsorted(turns, s.t + late, side="right")]
            weight[:, c] *= last < s.t - OVER * late
        samples.append(replace(s, weight=weight))
    return quick.of(samples)


def _worth_asking(asked: Asked, which: Sequence[int]) -> bool:
    """Whether any lag could bring the gain that is asked for: no channel's error in a fit of all is below
    that of a fit of its own, whose normal matrix is solved once for all lags."""
    quick, fit, how, gain = asked.quick, asked.fit, asked.how, np.zeros(len(LAGS))
    for c in which:
        k, G, size = how.order[c], quick.identify.G[c], np.zeros(len(LAGS))
        v = np.zeros((len(G), len(LAGS)))
        for s in quick.fitted:
            late = s.late[:, :, k] * np.sqrt(s.weight[:, c])
            v += (s.W[c] * np.sqrt(s.weight[:, c : c + 1])).T @ late.T
            size += (late**2).sum(axis=1)
        best = alone(G, v, size)
        gain += [gain_of(fit.error[[c]], best[m : m + 1]) for m in range(len(LAGS))]
    return bool(gain.max() / len(which) >= (OWN if len(which) == 1 else TOGETHER))


def _at(quick: Quick, how: Assignment, which: Sequence[int], lag: int) -> Fit:
    """The fit with some channels' torques taken that much later."""
    identify = _moved(quick.identify, quick.fitted, how, which, lag)
    held = [s for s in quick.samples if s.role == "validate"]
    return solve(identify, _moved(quick.validate, held, how, which, lag) if quick.validate else None, how)


def _moved(
    normal: Normal, samples: Sequence[Sample], how: Assignment, which: Sequence[int], lag: int
) -> Normal:
    v, yy = normal.v.copy(), normal.yy.copy()
    for c in which:
        k = how.order[c]
        v[c, k], yy[c, k] = 0.0, 0.0
        for s in samples:
            y = s.weight[:, c] * s.late[lag][:, k]
            v[c, k] += y @ s.W[c]
            yy[c, k] += y @ s.late[lag][:, k]
    return replace(normal, v=v, yy=yy)
