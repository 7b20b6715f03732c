"""What may be there in place of a fault that a check names: everyday faults that one number describes.

    a torque takes up a share of another one, drifts, is larger in one recording or from an instant on, or has
    another zero there or from then on, or is recorded as a power of itself
    a joint's friction changes with its load, a spring pulls on it, or a cable on two of them
    a torque lacks gravity; those of the first joints are in another unit than the others
    a position is a number times too large, starts from another zero, drifts, or holds another joint's
    two joints are in each other's place
    a gear yields, so that its link is not where the motor's position says

Each is fitted to the same rows, the model's parameters with it, so that it can be held against the named one
stretch by stretch. What is done to a torque is linear in the number; a position is found by Gauss-Newton
steps on the motion itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ident.examination.fits.best_factor import factor_of
from ident.examination.fits.hypothesis import CLEARLY, Asked
from ident.examination.fits.quick import Assignment, Fit, Quick
from ident.examination.fits.samples import Sample, of_bodies
from ident.examination.fits.stretches import ODD, RARE, Explained, agreed, half_of, steadily
from ident.examination.positions.coupled import held_too
from ident.examination.positions.places import along, exchanged
from ident.examination.torques.weightless import felt, without_gravity

STEPS, SMALL = 6, 1e-4  # of Gauss-Newton, and its difference
ENOUGH = 1e-3  # gain of a step, below which it is the last
LEAST, MOST = -0.9, 1.2  # how far from one a factor may go by them; a zero up to half a turn
STARTS = (-0.5, 1.0, 2 * np.pi - 1)  # twice or half as large, or in turns: far from where steps lead to
PHASES = (0.0, np.pi / 4, np.pi / 2, 3 * np.pi / 4)  # rad, of a wave over a turn
MOST_OFF = 0.03  # rad: more error than an encoder or a gear has over a turn
POWERS = {0.5: "the square", 2.0: "the root"}  # by which it is what it should be
INSTANTS = 8  # parts of a recording at whose ends a torque may have changed
Motion = Callable[[float], Quick]  # the recordings with another one, by a number
Signal = Callable[[int, Sample], np.ndarray]  # (N,) of a recording, by its number


@dataclass(frozen=True, slots=True)
class Rival:
    """A fault in words, and what the recordings are with it undone. Errors are shares of the torques that are
    left where one is a number times too large (in N m none would be left of one that is nothing), of those
    that were recorded where another signal is taken from one (of little that is left they would be large)."""

    words: str
    explained: Explained
    recording: str = ""  # that alone it is about
    zero: bool = False  # where a torque starts from another one there
    beside: bool = False  # asked elsewhere: here only what may be there in place of another one
    joint: int | None = None  # by its place, whose position it is
    check: str = ""  # that tells a position the same
    settled: bool = True  # whether no other number explains more, as far as was sought
    lacks: bool = False  # an effect that the model lacks, not a fault of a log
    zeros: tuple[float, Motion] | None = None  # its number, and the recordings with any other one


def alike(pool: Iterable[Rival], before: Explained, told: Explained) -> list[Rival]:
    """Those that explain at least half of what is told does, of the same torques, and that stretch by stretch
    are not rejected beside it; most first."""
    near = [r for r in pool if half_of(before, told, r.explained)]
    kept = [r for r in near if not steadily(r.explained, told, RARE)]
    return sorted(kept, key=lambda r: -r.explained.gains_over(before).sum())


def gaining(pool: Iterable[Rival], before: Explained) -> tuple[list[Rival], int]:
    """Those that explain more than before, and of how many: each has equations of its own."""
    kept, count = list[Rival](), 0
    for rival in pool:
        count += 1
        if rival.explained.fit.gain_over(before.fit) > 0:
            kept.append(rival)
    return kept, count


def standing(
    asked: Asked, whole: Quick, how: Assignment, told: Explained, itself: str = ""
) -> list[Rival] | None:
    """Rivals, but for the told one itself, that explain more than is explained without any; None: stretch by
    stretch one of them explains more than what is told, or chance confirms one of all that were asked. What
    is asked elsewhere does so of the same torques alone. (The last two joints of an LWR4+, mostly noise,
    exchanged gain more than a fifth torque that is 3 times too large in one run.)"""
    others = (its for its in rivals(asked, whole, how) if its.words != itself)
    plain = Explained.by(whole, how)
    kept, count = gaining(others, plain)
    asks = (its for its in kept if not its.beside or half_of(plain, told, its.explained))
    return None if any(agreed(told, its.explained, ODD / count) for its in asks) else kept


def rivals(asked: Asked, whole: Quick, how: Assignment) -> Iterator[Rival]:
    """Of rows that are all fitted (stretches.all_rows); of the instants of a recording the best one."""
    fit = whole.fit(how)
    for c in np.flatnonzero(whole.identify.rows > 10).tolist():
        yield from _of_torque(asked, whole, fit, how, c)
        yield from _powers(whole, how, c, asked.name(c))
    yield from _units(asked, whole, how)
    yield from of_positions(whole, fit, how)
    yield from _drifting(whole, fit, how)
    yield from _eccentric(whole, fit, how)
    yield from _yielding(whole, fit, how)
    yield from _held(whole, how)
    yield from _exchanged(asked, whole, how)
    yield from _cabled(whole, how)
    for c in felt(whole):
        words = f"{asked.name(c)} does not feel gravity"
        yield Rival(words, Explained.by(without_gravity(whole, [c]), how))


def of_one_recording(asked: Asked, whole: Quick, how: Assignment) -> Iterator[Rival]:
    """Those of them that are about one recording alone."""
    fit = whole.fit(how)
    for c in np.flatnonzero(whole.identify.rows > 10).tolist():
        yield from (its for its in _of_torque(asked, whole, fit, how, c) if its.recording)
    yield from (its for its in _held(whole, how) if its.recording)


def _held(whole: Quick, how: Assignment) -> Iterator[Rival]:
    """A position that holds another joint's."""
    for words, recording, moved in held_too(whole):
        yield Rival(words, Explained.by(moved, how), recording, beside=bool(recording))


def _exchanged(asked: Asked, whole: Quick, how: Assignment) -> Iterator[Rival]:
    """Two joints in each other's place, by their positions alone or with their torques. (Of a UR10e with its
    last two exchanged the fourth one was told to start from another zero.)"""
    labels = whole.columns.need.joints
    for a, b in combinations(range(len(labels)), 2):
        order, names = exchanged(len(labels), a, b), f"{labels[a]} and {labels[b]}"
        moved, torques = whole.moved(order), along(whole.columns, order)
        yield Rival(f"the positions of joints {names} are exchanged", Explained.by(moved, how), beside=True)
        if torques is not None:
            its = Explained.by(moved, how.placed(torques, asked.gains))
            yield Rival(f"joints {names} are exchanged, positions and torques", its, beside=True)


def _cabled(whole: Quick, how: Assignment) -> Iterator[Rival]:
    """Two joints that a spring is stretched by together: one stiffness of each, and one between them. (Of
    an arm with a hose over its wrist q6 was 1.28 times too large, or a spring on joint 6 missing.)"""
    labels = whole.columns.need.joints
    joint_of = np.array(whole.columns.joint_of, int)[:, None]
    for a, b in combinations(range(len(labels)), 2):

        def pulled(s: Sample, a: int = a, b: int = b) -> Sample:
            on_a, on_b = joint_of == a, joint_of == b
            crossed = on_a * s.q[:, b] + on_b * s.q[:, a]
            return s.beside(np.stack([on_a * s.q[:, a], crossed, on_b * s.q[:, b]], axis=2))

        words = f"the model lacks a cable over joints {labels[a]} and {labels[b]}"
        made = whole.of([pulled(s) for s in whole.samples])
        yield Rival(words, Explained.by(made, how), beside=True, lacks=True)


def _of_torque(asked: Asked, whole: Quick, fit: Fit, how: Assignment, c: int) -> Iterator[Rival]:
    """A torque with another signal in it."""
    channels, own = whole.columns.need.channels, how.order[c]
    name = asked.name(c)

    def found(signal: Signal, itself: bool = False) -> tuple[float, Rival | None]:
        its = [signal(r, s) for r, s in enumerate(whole.samples)]
        return _without(whole, fit, how, c, its, whole if not itself else None)

    for k in np.flatnonzero(whole.identify.rows > 10).tolist():
        if k != c and channels[k].side == channels[c].side:
            other, g = how.order[k], how.factor[k]
            share, rival = found(lambda r, s, other=other, g=g: g * s.Y[:, other])  # type: ignore[misc]
            if rival:
                words = f"{name} takes up {share:.2g} of {asked.name(k)}"
                yield replace(rival, words=words)
    label, joint = whole.columns.need.joints[channels[c].joint], channels[c].joint
    unit = unit_of(whole, c)
    _, rival = found(lambda r, s: np.abs(s.Y[:, own]) * np.sign(s.dq[:, joint]), True)
    if rival:
        yield replace(rival, words=f"the friction of joint {label} changes with its load", lacks=True)
    _, rival = found(lambda r, s: s.q[:, joint])
    if rival:
        yield replace(rival, words=f"the model lacks a spring on joint {label}", lacks=True)
    slope, rival = found(lambda r, s: s.t)
    if rival:
        yield replace(rival, words=f"{name} drifts by {60 * slope:.2g} {unit} a minute")
    for r, sample in enumerate(whole.samples):
        if len(whole.samples) > 1:
            slope, rival = found(lambda i, s, r=r: (i == r) * (s.t - s.t[0]))  # type: ignore[misc]
            if rival:
                words = f"{name} of {sample.label} drifts by {60 * slope:.2g} {unit} a minute"
                yield replace(rival, words=words, recording=sample.label)
            share, rival = found(lambda i, s, r=r: (i == r) * s.Y[:, own], True)  # type: ignore[misc]
            if rival:
                two = len(whole.samples) == 2  # of which either may be the other one
                also = f" or a load is carried {'in one of the two' if two else 'there'}" if share < 1 else ""
                words = f"{name} of {sample.label} is {_times(share)}{also}"
                yield replace(rival, words=words, recording=sample.label)
            most = float(np.abs(sample.Y[:, own]).max())

            def bent(i: int, s: Sample, r: int = r, most: float = most) -> np.ndarray:
                return (i == r) * s.Y[:, own] * np.abs(s.Y[:, own]) / max(most, 1e-300)

            share, rival = found(bent, True)
            if rival:
                so = "large where it is large" if share > 0 else "small where it is large (it saturates)"
                words = f"{name} of {sample.label} is recorded too {so}"
                yield replace(rival, words=words, recording=sample.label)
            zero, rival = found(_after(r, -np.inf, None))
            if rival:
                words = f"{name} of {sample.label} starts from another zero, {zero:.2g} {unit} off"
                yield replace(rival, words=words, recording=sample.label, zero=True)
        instants = np.linspace(sample.t[0], sample.t[-1], INSTANTS + 1)[1:-1]
        for constant in (False, True):
            later: list[tuple[float, Rival]] = []
            for at in instants:
                share, rival = found(_after(r, at, None if constant else own), not constant)
                if rival:
                    so = f"off by {share:.2g} {unit}" if constant else _times(share)
                    words = f"{name} of {sample.label} is {so} from about {at:.3g} s on"
                    rival = replace(rival, words=words, recording=sample.label)
                    later.append((rival.explained.fit.gain_over(fit), rival))
            if later:
                yield max(later, key=lambda each: each[0])[1]


def _powers(whole: Quick, how: Assignment, c: int, name: str) -> Iterator[Rival]:
    """A torque that is recorded as a power of itself, with its sign, times the number that explains most."""
    own = how.order[c]
    for power, words in POWERS.items():
        samples, v, yy = [], whole.identify.v.copy(), whole.identify.yy.copy()
        v[c, own], yy[c, own] = 0.0, 0.0
        for s in whole.samples:
            Y = s.Y.copy()
            Y[:, own] = np.sign(Y[:, own]) * np.abs(Y[:, own]) ** power
            w = s.weight[:, c] * Y[:, own]
            v[c, own], yy[c, own] = v[c, own] + w @ s.W[c], yy[c, own] + w @ Y[:, own]
            samples.append(replace(s, Y=Y))
        made = replace(whole, samples=tuple(samples), identify=replace(whole.identify, v=v, yy=yy))
        factor = factor_of(made, how, [c]).factor
        explained = Explained.by(made, how.times([c], factor))
        yield Rival(f"{name} is recorded as {words} of itself", explained, beside=True)


def _after(r: int, at: float, place: int | None) -> Signal:
    """What stands in a place of recording r after an instant [s]; None: one."""

    def signal(i: int, s: Sample) -> np.ndarray:
        return (i == r) * (s.t > at) * (1.0 if place is None else s.Y[:, place])

    return signal


def _units(asked: Asked, whole: Quick, how: Assignment) -> Iterator[Rival]:
    """Torques of the first joints, two at least, a number times those of two at least behind them, where it
    explains clearly more than one by which neither says anything of the other. (Of a UR10e with half of its
    torques in kgf m the fourth was told as ten times too large; of an LWR4+ whose fourth position started
    from another zero in one run, that four torques may be 992 times too large.)"""
    seen = np.flatnonzero(whole.identify.rows > 10).tolist()
    for k in range(2, len(seen) - 1):
        best = factor_of(whole, how, seen[:k])
        if best.gain - best.absurd < CLEARLY:
            continue
        factor = best.factor
        names = ", ".join(asked.name(c) for c in seen[:k])
        size, word = (factor, "small") if factor > 1 else (1 / factor, "large")
        yield Rival(
            f"{names} are {size:.3g} times too {word} beside the others",
            Explained.by(whole, how.times(seen[:k], factor)),
            beside=True,
        )


def unit_of(whole: Quick, c: int) -> str:
    """Of the torque that a channel's signal, a current or a torque, stands for."""
    joint = whole.columns.need.joints[int(whole.columns.joint_of[c])]
    return "N" if str(joint) in whole.columns.model.prismatic else "N m"


def _times(share: float) -> str:
    """What a torque is times itself of which this share is too much."""
    return f"{1 / (1 - share):.2g} times as large" if abs(1 - share) > 1e-3 else "another signal"


def _without(
    whole: Quick,
    fit: Fit,
    how: Assignment,
    c: int,
    signals: list[np.ndarray],
    recorded: Quick | None,
) -> tuple[float, Rival | None]:
    """How much of some signals (N,) of the recordings explains most of a channel's torque beside the model,
    and the recordings without it; None where the model does the same."""
    f, own = how.factor[c], how.order[c]
    zz = zy = 0.0
    zW = np.zeros(len(fit.chi))
    for s, z in zip(whole.samples, signals):
        w = s.weight[:, c] * z
        zz, zy, zW = zz + float(w @ z), zy + float(w @ s.Y[:, own]) * f, zW + w @ s.W[c]
    size = zz - fit.scale[c] * float(zW @ fit.inverse @ zW)
    if not size > 1e-9 * zz:
        return 0.0, None
    share = float((zy - zW @ fit.chi) / size)
    taken = share / f  # of what is recorded
    v, yy = whole.identify.v.copy(), whole.identify.yy.copy()
    v[c, own] -= taken * zW
    yy[c, own] += taken * (taken * zz - 2 * zy / f)
    less = []
    for s, z in zip(whole.samples, signals):
        Y = s.Y.copy()
        Y[:, own] -= taken * z
        less.append(replace(s, Y=Y))
    made = replace(whole, samples=tuple(less), identify=replace(whole.identify, v=v, yy=yy))
    return share, Rival("", Explained.less(made, how, recorded or made))


def of_positions(whole: Quick, fit: Fit, how: Assignment) -> Iterator[Rival]:
    """Each position times a number, and from another zero."""
    for j, label in enumerate(whole.columns.need.joints):
        its = np.arange(len(whole.columns.need.joints)) == j
        if not any(np.ptp(s.q[:, j]) for s in whole.samples):
            continue

        def times(x: float, its: np.ndarray = its) -> Quick:
            return whole.moved(factor=np.where(its, 1.0 + x, 1.0))

        def zero(x: float, its: np.ndarray = its) -> Quick:
            return whole.moved(offset=np.where(its, x, 0.0))

        unit = "m" if str(label) in whole.columns.model.prismatic else "rad"
        x, explained, settled = _solved(whole, fit, how, times, (LEAST, MOST), STARTS)
        factor, word = (1 + x, "small") if x > 0 else (1 / (1 + x), "large")
        words = f"q{label} is about {factor:.3g} times too {word}"
        yield Rival(words, explained, joint=j, check="angle_unit", settled=settled)
        x, explained, settled = _solved(whole, fit, how, zero, (-np.pi, np.pi))
        words = f"q{label} starts from another zero, {-x:.2g} {unit} off"
        yield Rival(words, explained, joint=j, check="position_zero", settled=settled, zeros=(x, zero))


def _drifting(whole: Quick, fit: Fit, how: Assignment) -> Iterator[Rival]:
    """Each position with counts that are lost, or another clock's, all along each recording. (Of an LWR4+'s
    third one it was told to be swapped with the sixth.)"""
    for j, label in enumerate(whole.columns.need.joints):
        if not any(np.ptp(s.q[:, j]) for s in whole.samples):
            continue
        drift = _behind(whole, j, [s.t[0] - s.t for s in whole.samples])
        unit = "m" if str(label) in whole.columns.model.prismatic else "rad"
        longest = max(float(np.ptp(s.t)) for s in whole.samples)
        x, explained, settled = _solved(whole, fit, how, drift, (-np.pi / longest, np.pi / longest))
        words = f"q{label} drifts by {-60 * x:.2g} {unit} a minute"
        yield Rival(words, explained, joint=j, settled=settled)


def _eccentric(whole: Quick, fit: Fit, how: Assignment) -> Iterator[Rival]:
    """Each angle with an error that is a wave over a turn, at the best of some phases: over a part of a turn
    it is a zero and a scale. (Of an arm with an eccentric encoder q1 was told to be 1.02 times too large.)"""
    for j, label in enumerate(whole.columns.need.joints):
        if str(label) in whole.columns.model.prismatic or not any(np.ptp(s.q[:, j]) for s in whole.samples):
            continue
        waves: list[Rival] = []
        for phase in PHASES:
            wave = _behind(whole, j, [np.sin(s.q[:, j] + phase) for s in whole.samples])
            x, explained, settled = _solved(whole, fit, how, wave, (-MOST_OFF, MOST_OFF))
            words = f"q{label} is off by {abs(x):.2g} rad once a turn, as an eccentric encoder is"
            waves.append(Rival(words, explained, joint=j, settled=settled))
        yield max(waves, key=lambda its: its.explained.fit.gain_over(fit))


def _yielding(whole: Quick, fit: Fit, how: Assignment) -> Iterator[Rival]:
    """Each joint whose link stays behind its motor as its bodies' torque bends the gear: in proportion, or by
    a play that the torque takes up. Its rates are left as they are: differences of a torque are noise. (Of an
    arm with a gear that yields its position was told to be 1.05 times too small, of another to start from
    another zero; either gear explains four to ten times as much.)"""
    bodies = fit.chi * of_bodies(whole.columns)
    for c in np.flatnonzero(whole.identify.rows > 10).tolist():
        carried = [s.W[c] @ bodies for s in whole.samples]
        size = np.abs(np.concatenate(carried))
        most, usual = float(size.max()), float(np.median(size))
        if not usual > 0:
            continue
        joint = int(whole.columns.joint_of[c])
        label = whole.columns.need.joints[joint]
        unit = "m" if str(label) in whole.columns.model.prismatic else "rad"
        bent = _behind(whole, joint, [tau / most for tau in carried])
        x, explained, settled = _solved(whole, fit, how, bent, (0.0, np.pi))
        words = f"the gear of joint {label} yields by {x / most:.2g} {unit}/({unit_of(whole, c)})"
        yield Rival(words, explained, joint=joint, settled=settled)
        bent = _behind(whole, joint, [tau / (np.abs(tau) + usual) for tau in carried])
        x, explained, settled = _solved(whole, fit, how, bent, (0.0, np.pi))
        words = f"the gear of joint {label} has play, {2 * x:.2g} {unit}"
        yield Rival(words, explained, joint=joint, settled=settled)


def _behind(whole: Quick, joint: int, by: Sequence[np.ndarray]) -> Motion:
    """The recordings with a joint that is behind by a number times (N,) of each."""
    its = np.arange(len(whole.columns.need.joints)) == joint
    each = [(s, shift[:, None] * its) for s, shift in zip(whole.samples, by)]
    return lambda x: whole.of([s.moved(whole.columns, offset=-x * shift) for s, shift in each])


def _solved(
    whole: Quick,
    fit: Fit,
    how: Assignment,
    motion: Motion,
    ends: tuple[float, float],
    starts: Sequence[float] = (),
) -> tuple[float, Explained, bool]:
    """The number with which the torques are explained best along such motions, by the linear steps from the
    motion as it is, or from the best start, that explain more each; and whether they came to rest."""
    tried = [(x, Explained.by(motion(x), how)) for x in starts]
    x, best = max([(0.0, Explained(whole, fit, how)), *tried], key=lambda its: its[1].fit.gain_over(fit))
    for _ in range(STEPS):
        its, near = best.quick, motion(x + SMALL).samples
        chi, inverse = best.fit.chi, best.fit.inverse
        zz = zr = 0.0
        zW = np.zeros(len(chi))
        for s, other in zip(its.samples, near):
            weight = best.fit.scale * s.weight
            predicted = s.predicted(chi)
            Y = s.Y[:, list(how.order)] * how.factor
            z = (other.predicted(chi) - predicted) / SMALL
            zz += float((weight * z * z).sum())
            zr += float((weight * z * (Y - predicted)).sum())
            zW += np.einsum("nc,cnb->b", weight * z, s.W)
        step = zr / max(zz - zW @ inverse @ zW, 1e-300)
        if not ends[0] < x + step < ends[1]:
            break
        after = Explained.by(motion(x + step), how)
        gained = after.fit.gain_over(best.fit)
        if gained > 0:
            x, best = x + step, after
        if gained < ENOUGH:
            return x, best, gained > -ENOUGH
    return x, best, False
