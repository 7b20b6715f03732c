"""Every way in which a signal of one recording may be another one, and what that explains."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from ident.examination.check import listed
from ident.examination.fits.hypothesis import (
    CLEARLY,
    SWAPPED,
    Asked,
)
from ident.examination.fits.quick import Quick, added, solve
from ident.examination.fits.samples import LAGS, Sample
from ident.examination.fits.stretches import RARE, Explained, steadily
from ident.examination.one_recording.another_torque import Reading, Sums, readings
from ident.examination.one_recording.changed import Changed, unsigned
from ident.examination.positions.coupled import held
from ident.examination.positions.places import along, exchanged
from ident.examination.positions.units import DEGREES, NEXT, POSITION_FACTORS, ratios, times_too
from ident.examination.rivals.scales import FACTOR, ends
from ident.examination.tables.signals import TURNS
from ident.examination.torques.delays import HELD, TOGETHER, asides, foretold_later, hidden_s
from ident.examination.torques.signs import all_signs
from ident.examination.torques.weightless import every, felt, without_gravity

OFFSETS = (*(sign * x for x in (0.05, 0.1, 0.2, 0.35, 0.5, 0.8, np.pi / 2) for sign in (1, -1)), np.pi)  # rad
FINER_S = (-0.01, -0.005, 0.005, 0.01)  # about the lag that is best
SMOOTHED_S = (0.2, 0.8)
SMOOTHER = (
    "look at its plot; record it with less noise, or fit with a lower filter: {position_cutoff_hz: ...}"
)
OWN = "give this recording a columns: of its own in the study"


def torques_in_one(asked: Asked, whole: Quick, before: Explained) -> Iterator[Changed]:
    sums = Sums.of(whole, asked.how)
    for k, sample in enumerate(whole.samples):
        told = list(readings(asked, sums, k, before.fit))
        most = max((gain for gain, _ in told), default=0.0)
        for gain, reading in told:
            if gain > max(most - SWAPPED, 0.0):
                its = _read(whole, asked, sample, reading)
                if not all_signs(replace(asked, quick=its.explained.quick, fit=its.explained.fit)):
                    yield its  # or it is the other recordings
        yield from _late(asked, whole, k)
    yield from unsigned(asked, whole, [s.label for s in whole.samples])


def _read(whole: Quick, asked: Asked, sample: Sample, its: Reading) -> Changed:
    explained = _taken(asked, whole, sample, sample.read(its.source, its.factor))
    remedy = _own_line(asked, sample, its.changes)
    factor = its.changes[its.signals[0]].get("scale")
    told = its.signals, its.check, its.words, remedy
    return Changed(sample.label, *told, explained, its.least, its.drives, factor)


def factors_of(asked: Asked, whole: Quick, its: Changed) -> tuple[float, float]:
    """Those between which none is rejected beside the one of its torques."""
    (s,) = (s for s in whole.samples if s.label == its.recording)
    order, seen = asked.how.order, [c for c in asked.seen if asked.name(c) in its.signals]
    own = np.isin(np.arange(len(order)), [order[c] for c in seen])
    factors = (its.factor or 1.0) * np.geomspace(1 / FACTOR, FACTOR, 61)
    read = (s.read(range(len(order)), np.where(own, f, 1.0)) for f in factors)
    _, low, high = ends(factors, [_taken(asked, whole, s, other) for other in read], whole.fit(asked.how))
    return low, high


def _late(asked: Asked, whole: Quick, k: int) -> Iterator[Changed]:
    """Each torque of recording k, or all, at the time at which the others foretell it best. Of all of them
    that may explain less of all recordings, of which it spoils the fit, where the others foretell them as
    much better as a fit of all that is fitted would have to explain them. (Of a TX40's judged run whose
    torques lag by 0.02 s nothing was said, and 24 % were left for 11.)"""
    s, how = whole.samples[k], asked.how
    own = s.read(how.order, how.factor)
    rest = added([its for i, its in enumerate(whole.each) if i != k])
    predicted = s.predicted(solve(rest, None, how).chi)

    def left(late: np.ndarray) -> np.ndarray:
        return np.sqrt((s.weight * (late - predicted) ** 2).sum(axis=-2))

    every_lag = left(own.late)  # (lags, C)
    for which in every(asked.seen):
        lag = LAGS[int(np.argmin(_product(every_lag[:, which])))]
        near = [lag + x for x in FINER_S if abs(lag + x) < max(LAGS)]
        seconds = min([lag, *near], key=lambda x: _product(left(own.later(x))[which]))
        if abs(seconds) == max(LAGS) or abs(seconds) < hidden_s(asked, which):  # more is better, or hidden
            continue
        places = [how.order[c] for c in which]
        Y = s.Y.copy()
        Y[:, places] = s.later(seconds)[:, places]
        names = asked.names(which)
        words = f"{listed(names)} {'is' if len(which) == 1 else 'are'} recorded about {abs(seconds):g} s "
        words += "after the positions or smoothed as much" if seconds > 0 else "before the positions"
        explained = _taken(asked, whole, s, replace(s, Y=Y))
        least = CLEARLY if len(which) > 1 and _foretold_late(asked, whole, k, which, seconds) else SWAPPED
        yield Changed(s.label, names, "channel_delay", words, "record both with one clock", explained, least)


def _product(left: np.ndarray) -> Any:
    """Of what is left of torques (..., C), its logarithm."""
    return np.log(np.maximum(left, 1e-300)).sum(axis=-1)


def _foretold_late(asked: Asked, whole: Quick, k: int, which: Sequence[int], seconds: float) -> bool:
    """Whether the other recordings foretell these torques of recording k so much better at that other time,
    where their joints keep their direction, too, and however their friction turns over."""
    if foretold_later(whole, asked.how, k, which, seconds) < TOGETHER:
        return False
    ways = (aside(whole) for aside in asides(seconds))
    return all(foretold_later(way, asked.how, k, which, seconds) >= HELD for way in ways)


def _own_line(asked: Asked, sample: Sample, changes: Mapping[str, Mapping[str, Any]]) -> str:
    """Of the study, with columns of the recording's own."""
    return f"recordings: [{{name: {json.dumps(sample.label)}, {asked.line(changes)}}}]"


def _taken(asked: Asked, whole: Quick, sample: Sample, other: Sample) -> Explained:
    """All recordings fitted together with another sample in the place of one."""
    return Explained.by(whole.of([other if s is sample else s for s in whole.samples]), asked.how)


def weightless_in_one(asked: Asked, whole: Quick) -> Iterator[Changed]:
    for sample in whole.samples:
        for which in every([c for c in felt(whole) if c in asked.seen]):
            names = asked.names(which)
            words = f"{listed(names)} {'does' if len(names) == 1 else 'do'} not feel gravity"
            explained = Explained.by(without_gravity(whole, which, sample.label), asked.how)
            remedy = "log that recording with the controller's gravity torque"
            yield Changed(sample.label, names, "gravity_compensated", words, remedy, explained)


def positions_in_one(asked: Asked, whole: Quick) -> Iterator[Changed]:
    for sample in whole.samples:
        for joint in range(len(asked.joints)):
            yield from _position(asked, whole, sample, joint)
        yield from _joints(asked, whole, sample)
        yield from _all_in_degrees(asked, whole, sample)


def _all_in_degrees(asked: Asked, whole: Quick, sample: Sample) -> Iterator[Changed]:
    """All positions of one recording, of which one goes beyond two turns. (Of a TX40 one of whose runs has
    them so it was said that they look it, and 1219 % were left.)"""
    turning = np.array([joint not in whole.columns.model.prismatic for joint in asked.joints])
    reach = np.abs(sample.q).max(axis=0)
    if turning.sum() > 1 and reach[turning].max() > TURNS:
        names = tuple(f"q{joint}" for joint, turns in zip(asked.joints, turning) if turns)
        moved = sample.moved(whole.columns, factor=np.where(turning, DEGREES, 1.0))
        line = _own_line(asked, sample, {name: {"scale": float(f"{DEGREES:.6g}")} for name in names})
        explained = _taken(asked, whole, sample, moved)
        yield Changed(sample.label, names, "angle_unit", "all positions are in degrees", line, explained)


def _joints(asked: Asked, whole: Quick, sample: Sample) -> Iterator[Changed]:
    """Two positions of one recording exchanged, alone or with their torques; a joint's position and torque
    with the other sign, or those of all joints."""
    columns, how, n = whole.columns, asked.how, len(asked.joints)
    channels, joint_of, labels = range(len(how.order)), np.array(columns.joint_of, int), asked.joints

    def told(
        check: str, words: str, moved: Sample, source: Sequence[int], factor: np.ndarray, changes: dict
    ) -> Changed:
        order, factors = np.arange(len(channels)), np.ones(len(channels))
        order[list(how.order)], factors[list(how.order)] = np.array(how.order)[list(source)], factor
        explained = _taken(asked, whole, sample, moved.read(order.tolist(), factors))
        line = _own_line(asked, sample, changes)
        return Changed(sample.label, tuple(changes), check, words, line, explained)

    for a, b in combinations(range(n), 2):
        moved, source = sample.moved(columns, exchanged(n, a, b)), along(columns, exchanged(n, a, b))
        one, other = f"q{labels[a]}", f"q{labels[b]}"
        changes: dict[str, dict] = {one: {"of": other}, other: {"of": one}}
        words = f"{one} and {other} look swapped"
        yield told("swapped_signals", words, moved, channels, np.ones(len(channels)), changes)
        if source is not None:
            words = f"joints {labels[a]} and {labels[b]} look swapped, positions and torques"
            changes |= {asked.name(c): {"of": asked.name(k)} for c, k in enumerate(source) if c != k}
            factor = asked.gains / asked.gains[source]
            yield told("swapped_signals", words, moved, source, factor, changes)
    for its in every(range(n)):
        turned = np.isin(np.arange(n), its)
        own = np.flatnonzero(turned[joint_of])
        names = (*(f"q{labels[j]}" for j in its), *asked.names(own))
        words = "all positions and torques have" if len(its) == n > 1 else f"{listed(names)} have"
        moved, factor = sample.moved(columns, factor=np.where(turned, -1.0, 1.0)), np.ones(len(channels))
        factor[own] = -1.0
        changes = {name: {"sign": -1} for name in names}
        yield told("position_sign", f"{words} the other sign", moved, channels, factor, changes)


def _position(asked: Asked, whole: Quick, sample: Sample, joint: int) -> Iterator[Changed]:
    """One position of one recording, moved in all ways that are ordinary."""
    name, columns = f"q{asked.joints[joint]}", whole.columns
    its = np.arange(len(asked.joints)) == joint

    def changed(check: str, words: str, remedy: str, **motion: float) -> Changed:
        factor, offset = (
            np.where(its, motion.get(key, none), none) for key, none in (("factor", 1.0), ("offset", 0.0))
        )
        explained = _taken(asked, whole, sample, sample.moved(columns, factor=factor, offset=offset))
        return Changed(sample.label, (name,), check, f"{name} {words}", remedy, explained)

    def line(**change: float) -> str:
        return _own_line(asked, sample, {name: change})

    yield changed("position_sign", "has the other sign", line(sign=-1), factor=-1.0)
    if asked.joints[joint] in columns.model.prismatic:
        return
    yield changed("angle_unit", "is in degrees", line(scale=DEGREES), factor=DEGREES)
    for factor in POSITION_FACTORS:
        yield changed("angle_unit", f"is {times_too(1 / factor)}", line(scale=factor), factor=factor)
    yield from _smoothed(asked, whole, sample, joint)
    yield from _before_a_gear(asked, whole, sample, joint)
    for offset in OFFSETS:
        words = f"starts from another zero, about {-offset:.2g} rad off"
        remedy = f"{OWN} with {{{name}: {{offset: {offset:.3g}}}}}"  # no line: known to some degrees only
        yield replace(changed("position_zero", words, remedy, offset=offset), least=CLEARLY)
    for too in held(columns):
        if too.j == joint:
            explained = _taken(asked, whole, sample, too.without(columns, sample))
            remedy = f"{too.remedy} of that recording"
            yield Changed(sample.label, (name,), "coupled_position", too.words, remedy, explained)


def _smoothed(asked: Asked, whole: Quick, sample: Sample, joint: int) -> Iterator[Changed]:
    """A position that is better smoothed: behind noise a small factor explains more, too. (A Franka's first
    one with noise of 0.01 rad in one recording was told to be 10 times too large, or in degrees.)"""
    name = f"q{asked.joints[joint]}"
    ways = [(x, sample.smoothed(whole.columns, joint, x)) for x in SMOOTHED_S]
    taken = [(x, _taken(asked, whole, sample, its)) for x, its in ways if its is not None]
    if taken:
        plain = whole.fit(asked.how)
        seconds, explained = max(taken, key=lambda way: way[1].fit.gain_over(plain))
        words = f"{name} is noisy or coarse, better smoothed over {seconds:g} s"
        yield Changed(sample.label, (name,), "noisy_position", words, SMOOTHER, explained)


def _before_a_gear(asked: Asked, whole: Quick, sample: Sample, joint: int) -> Iterator[Changed]:
    """A position that goes beyond two turns in one recording, by the factor with which most is explained, of
    either sign, alone or with its torque. (Of a UR10e's first joint, on the motor's side of a gear of 101 in
    the run that judges, joints 1 and 5 were told to look swapped.)"""
    name, columns, how = f"q{asked.joints[joint]}", whole.columns, asked.how
    reach, plain = float(np.abs(sample.q[:, joint]).max()), whole.fit(how)
    if asked.joints[joint] in columns.model.prismatic or reach <= TURNS:
        return
    its = np.arange(len(asked.joints)) == joint
    own = tuple(np.flatnonzero(np.array(columns.joint_of, int) == joint).tolist())

    def by(factor: float, torques: tuple[int, ...]) -> Explained:
        moved, factors = sample.moved(columns, factor=np.where(its, factor, 1.0)), np.ones(len(how.order))
        factors[[how.order[c] for c in torques]] = 1 / factor
        return _taken(asked, whole, sample, moved.read(range(len(factors)), factors))

    def best(sign: int, torques: tuple[int, ...]) -> tuple[float, Explained]:
        known = {sign * f: by(sign * f, torques) for f in ratios(reach)}
        for step in (NEXT ** (1 / 3), NEXT ** (1 / 9)):
            at = max(known, key=lambda f: known[f].fit.gain_over(plain))
            known |= {f: by(f, torques) for f in (at / step, at * step)}
        return max(known.items(), key=lambda item: item[1].fit.gain_over(plain))

    for torques in ((), own):
        (factor, explained), (other, turned) = (best(sign, torques) for sign in (1, -1))
        sign = " with either sign" * (not steadily(turned, explained, RARE))
        if steadily(explained, turned, RARE):  # which alone is told then
            factor, explained, sign = other, turned, " with the other sign"
        if not torques and not steadily(by(DEGREES, ()), explained, RARE):
            return  # which is told as that
        size, names = float(f"{abs(factor):.4g}"), asked.names(torques)
        turn = {"sign": -1} if factor < 0 else {}
        changes = {name: {"scale": size} | turn}
        changes |= {torque: {"scale": float(f"{1 / size:.4g}")} | turn for torque in names}
        words = f"{name} is {1 / size:.3g} times too large{sign}"
        words += f" and {listed(names)} as many times too small" if names else ""
        words += " (the motor's side of the gear)"
        line = _own_line(asked, sample, changes)
        yield Changed(sample.label, (name, *names), "angle_unit", words, line, explained)
