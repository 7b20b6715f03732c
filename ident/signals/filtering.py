"""Filtered positions, derivatives, and the sign that Coulomb friction takes (paper 3.3).

Derivatives. Central differences over five points of the filtered positions: dq = (q[-2] - 8 q[-1] + 8 q[1] -
q[2]) / 12 dt. Three points lose 1 % of an acceleration at 4 Hz that is sampled at 100 Hz, five lose 0.01 %.

sign(dq). The velocity that a smooth filter gives begins before the robot does, rings after it stopped, and at
rest is noise: its sign would put a Coulomb torque where there is none, and at rest friction is anything
between -Fc and Fc. On a twin of the paper's robot this alone biased every Fc and Fv by 3 to 8 standard
deviations. Hence
  1. the sign is taken of a velocity filtered at a higher cut-off (4 x), which rings a quarter as long; vs is
     two standard deviations of its noise, estimated for each recording and joint; of a joint that is slow
     for its encoder (resolution.py) it is filtered at 1.4 times the cut-off of its positions: behind four
     times that the steps of a TX40 at 0.1 rad/s were three Stribeck frictions, behind that itself a motion
     that stops turns elsewhere. (Error of the state of friction that gives way over 10 to 90 urad, of some 50
     joints of clean robots, behind 1, 1.25, 1.5, 2 and 3 times it: 0.0094, 0.0092, 0.0099, 0.0118, 0.0171 as
     geometric means, and as rms, which the motions that stop decide, 0.107, 0.104, 0.103, 0.105, 0.114.)
     Of such a joint vs is at least one step in a period of that cut-off: what crosses fewer is that much
     off, where the noise of all samples is a sixth of it,
  2. samples of a joint slower than vs, and of a stretch in which it stands at one place, do not count in its
  channels, from 2 vs on they count fully (`certain`):
     Y and every column of W are multiplied by that weight before they are decimated, so each row stays a
     true equation; errors are reported over all samples nevertheless. A joint that is slow for its encoder
     does not count either before it has gone a whole step since it last turned: where it turned is known no
     better, and dry friction gives way over a travel. (Of an arm at 15 mrad/s, steps of 0.33 mrad, friction
     came 0.1 s too early at one turn and as late at the next: a third of its size was left for 0.3 s, and
     delays were told.)
  3. where it counts, the column is the sign; between -vs and vs it is tanh(2.5 dq / vs),
  4. a torque that comes late carries the sign of then: where it is known by how much, samples do not count
     either whose joint was too slow then. (Counted, they put delays of a twin 0.3 to 0.8 of 17 ms, 2 to 5
     standard deviations, too low.)
  5. samples that are no measurement (examination/fits/samples.py) do not count either,
  6. it runs through the same decimation filter as the torque, as all columns do.
Rest at the ends is not used, nor the first and last moments of a segment, which the filter made up.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ident.recordings.recording import MIN_SAMPLES, RecordingStream, Segment
from ident.recordings.study import FilterSettings
from ident.signals.dry_friction import TurnOver
from ident.signals.low_pass import LowPass, fast_length, filtered, reflected, zero_phase
from ident.signals.resolution import best_cutoff, steps_of
from ident.signals.travelled import Turned, travelled

NOISE_FACTOR = 2.0  # vs in standard deviations of the velocity noise
INNER = 6144  # rows of a window without its halo: more take more memory, fewer more time
NOISE_ROWS = 16000  # samples from which that noise is estimated
STEEPNESS = 2.5  # of the sign between -vs and vs
SIGN = 1.4  # times the cut-off behind which a joint's steps tell its position best


def first_difference(q: np.ndarray, rate_hz: float) -> np.ndarray:
    """Five-point central first derivative of q (N, n) -> (N - 4, n)."""
    return (q[:-4] - 8 * q[1:-3] + 8 * q[3:-1] - q[4:]) * (rate_hz / 12)


def second_difference(q: np.ndarray, rate_hz: float) -> np.ndarray:
    """Five-point central second derivative of q (N, n) -> (N - 4, n)."""
    return (16 * (q[1:-3] + q[3:-1]) - q[:-4] - q[4:] - 30 * q[2:-2]) * (rate_hz**2 / 12)


@dataclass(frozen=True, slots=True)
class FilteredBlock:
    """Consecutive uniform samples of one segment; owning it proves that positions were filtered.

    t (N,), q, dq, ddq, sign_dq (N, n); motor, sensor (N, n) or None: torques as recorded, not filtered (or
    filtered with the position filter when that was asked). vs (n,) is the speed from which a sign is certain,
    certain (N, n) the weight 0..1 that follows from it, speed (N, n) the rate whose sign it is. motor_ddq
    (N, n): the motors' own acceleration where q is the joints' (`positions: joint`). real (N, n), bool: where
    the joint's torque and all positions were measured, not put in for samples that were lost. path (N, n):
    positions along which memories go on, where these are not q; before (k, n): the same of the samples ahead
    of those, none behind a stretch's first block.
    """

    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    sign_dq: np.ndarray
    motor: np.ndarray | None
    sensor: np.ndarray | None
    vs: np.ndarray
    certain: np.ndarray
    speed: np.ndarray | None = None
    motor_ddq: np.ndarray | None = None
    real: np.ndarray | None = None
    path: np.ndarray | None = None
    before: np.ndarray | None = None


@dataclass(frozen=True, slots=True)
class FilterBank:
    """The filters of one recording and the noise they leave on its velocity."""

    position: LowPass
    sign: LowPass
    vs: np.ndarray | None  # (n,) rad/s; None until estimated
    turn_over: tuple[TurnOver, ...] = ()  # of each joint's dry friction; none given: tanh(2.5 dq / vs)
    resting: tuple[int, ...] = ()  # joints that stand at one place throughout the study
    late: tuple[tuple[int, ...], ...] = ()  # of each joint: samples by which its torques come late, if any do
    lowest: tuple[float, ...] = ()  # Hz of each joint behind which its steps tell it best (resolution.py)
    hidden: tuple[float, ...] = ()  # rad | m of each joint: a step, within which a turn is hidden
    light: bool = False  # memories go on along the sign's positions

    @property
    def filters(self) -> tuple[tuple[LowPass, LowPass], ...]:
        """Of position and sign: one pair for all joints, or one for each."""
        return tuple((self.position.up_to(hz), self.sign.up_to(SIGN * hz)) for hz in self.lowest or [np.inf])

    def responses(self, frequency_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of position and sign filters, (F, 1) or (F, n)."""
        position = [its.response(frequency_hz) for its, _ in self.filters]
        sign = [its.response(frequency_hz) for _, its in self.filters]
        return np.stack(position, axis=1), np.stack(sign, axis=1)

    @property
    def beside(self) -> int:
        """Samples on either side of a block that are filtered with it."""
        return 2 + max((abs(k) for its in self.late for k in its), default=0)

    @property
    def halo(self) -> int:
        return max(its.halo for pair in self.filters for its in pair) + self.beside

    @property
    def transient(self) -> int:
        return max(position.transient for position, _ in self.filters) + 2

    def with_late(self, seconds: Sequence[Sequence[float]]) -> FilterBank:
        """The same where the torques of each joint come late by so many seconds."""
        late = tuple(tuple(sorted({round(s * self.position.rate_hz) for s in its} - {0})) for its in seconds)
        return replace(self, late=late if any(late) else ())


def filter_bank(settings: FilterSettings, rate_hz: float) -> FilterBank:
    sign_cutoff = settings.sign_cutoff_hz or 4 * settings.position_cutoff_hz
    return FilterBank(
        LowPass(settings.position_cutoff_hz, rate_hz, settings.order),
        LowPass(min(sign_cutoff, 0.4 * rate_hz), rate_hz, settings.order),
        None,
        light=settings.path == "sign",
    )


def velocity_noise(q: np.ndarray, bank: FilterBank, steps: np.ndarray | None = None) -> np.ndarray:
    """Standard deviation (n,) of the velocity whose sign is taken, from positions q (N, n) as recorded, in
    `steps` (n,) where they are rounded.

    What the sign filter removes from q is noise of the band above it; taken as white, the same level passes
    through filter and derivative with the gain computed here. The median over 64 stretches ignores reversals.
    It is no less than rounding makes: a joint that hardly moves stands on one step for most of them. (Of a
    UR10e's third joint at rest the flicker by a step counted as motion: 4 kg were told of its run.)
    """
    each = bank.filters if bank.lowest else bank.filters * q.shape[1]
    steps = np.zeros(q.shape[1]) if steps is None else steps
    return np.array([_rate_noise(its, sign, step) for its, (_, sign), step in zip(q.T, each, steps)])


def _rate_noise(q: np.ndarray, filter: LowPass, rounding: float) -> float:
    """That of one joint, q (N,), in steps of `rounding`."""
    removed = q - zero_phase(q, filter.rate_hz, filter.cutoff_hz, filter.order)
    stretch = max(len(q) // 64, 8)
    pieces = removed[: len(q) // stretch * stretch].reshape(-1, stretch)
    high_band = np.sqrt(np.median((pieces**2).mean(axis=1)))
    high_band = max(high_band, 0.3 * np.sqrt((removed**2).mean()))
    frequency = np.linspace(0, filter.rate_hz / 2, 2001)
    response = filter.response(frequency)
    step = 2 * np.pi * frequency / filter.rate_hz
    derivative = filter.rate_hz * (8 * np.sin(step) - np.sin(2 * step)) / 6
    above = np.mean((1 - response) ** 2)
    white = high_band / np.sqrt(above) if above >= 1e-6 else 0.0
    return float(max(white, rounding / np.sqrt(12)) * np.sqrt(np.mean((derivative * response) ** 2)))


def smooth_sign(dq: np.ndarray, vs: np.ndarray) -> np.ndarray:
    """tanh(2.5 dq / vs), the plain sign where vs is zero."""
    return np.where(vs > 0, np.tanh(STEEPNESS * dq / np.where(vs > 0, vs, 1.0)), np.sign(dq))


def told_sign(
    q: np.ndarray,
    dq: np.ndarray,
    hz: float,
    vs: np.ndarray,
    turns: Sequence[TurnOver],
    states: list[float | None],
) -> np.ndarray:
    """`smooth_sign` (N, n), with the joints' own turn-over where one is given; states (n,) go from block to
    block."""
    out = smooth_sign(dq, vs)
    for j, turn in enumerate(turns):
        if turn.rate > 0 or turn.travel > 0:
            out[:, j], states[j] = turn.followed(q[:, j], dq[:, j], hz, states[j])
    return out


def certainty(dq: np.ndarray, vs: np.ndarray) -> np.ndarray:
    """0 for speeds up to vs, 1 from 2 vs on; a joint at rest is 0 also where vs is zero."""
    return np.clip(np.abs(dq) / np.maximum(vs, 1e-9) - 1.0, 0.0, 1.0)


def _shown(light: np.ndarray, bank: FilterBank, turned: list[Turned | None], count: int) -> np.ndarray:
    """(N, n) bool: whether each joint has gone on since it last turned by more than its steps hide, along
    positions `light` (N, n); turned (n,) go from block to block of `count` rows."""
    out = np.ones(light.shape, bool)
    for j, hidden in enumerate(bank.hidden):
        if hidden > 0:
            path, turned[j] = travelled(light[:, j], turned[j], count)
            out[:, j] = path >= hidden
    return out


def _certain(
    around: np.ndarray, shown: np.ndarray, vs: np.ndarray, bank: FilterBank, count: int
) -> np.ndarray:
    """(count, n) of a block, from the speeds `around` it and whether a turn is `shown`: where a torque comes
    late, of then as well."""
    sure, begin = certainty(around, vs) * shown, bank.beside - 2
    out = sure[begin:][:count].copy()
    for j, its in enumerate(bank.late):
        for k in its:
            out[:, j] *= sure[begin - k :][:count, j]
    return out


@dataclass(frozen=True, slots=True)
class Smoothed:
    """One window of a segment (its number) after the transforms.

    first: number of its first row in the segment; q, bent (N + 4, n): positions through the position filter
    and the gears' bending (`positions: joint`), with two rows more at either end; light (N + 2 beside, n):
    positions through the sign's filter, with as many more as its bank asks for;
    motor, sensor (N, .): torques as recorded; weight (N, n) bool: what is a measurement.
    """

    segment: int
    first: int
    q: np.ndarray
    light: np.ndarray
    bent: np.ndarray | None
    motor: np.ndarray | None
    sensor: np.ndarray | None
    weight: np.ndarray

    @property
    def size(self) -> int:
        """Numbers held."""
        signals = (self.q, self.light, self.bent, self.motor, self.sensor)
        return sum(x.size for x in signals if x is not None) + self.weight.size // 8


def _span(segment: Segment, bank: FilterBank, first: int, count: int) -> tuple[np.ndarray, slice]:
    """Times of `count` rows of a segment, and which of them are in motion and out of the transients."""
    period = 1.0 / bank.position.rate_hz
    begin = max(segment.move_start, segment.start + bank.transient * period)
    end = min(segment.move_end, segment.end - bank.transient * period)
    t = segment.start + (first + np.arange(count)) * period
    use = (t >= begin - 1e-9) & (t <= end + 1e-9)
    return t, slice(int(np.argmax(use)), count - int(np.argmax(use[::-1]))) if use.any() else slice(0, 0)


def _smoothed(stream: RecordingStream, bank: FilterBank) -> Iterator[tuple[Smoothed, np.ndarray, slice]]:
    """Windows of a recording that have rows to use, filtered; each beside the rows it was made of (R, m + n)
    and which of them it is about."""
    n, period = len(stream.need.joints), 1.0 / bank.position.rate_hz
    cut = (
        (number, segment, *its)
        for number, (segment, blocks) in enumerate(stream.segments())
        for its in windows(blocks, bank.halo)
    )
    for number, segment, first, window, inner in cut:
        _, span = _span(segment, bank, first, inner.stop - inner.start)
        if span.stop == span.start:
            continue
        size = fast_length(len(window))
        wide = slice(inner.start - 2, inner.stop + 2)
        wider = slice(inner.start - bank.beside, inner.stop + bank.beside)
        frequency = np.fft.rfftfreq(size, period)
        low, lighter = bank.responses(frequency)
        spectrum = np.fft.rfft(window[:, :n], size, axis=0)
        q = np.fft.irfft(spectrum * low, size, axis=0)[wide].copy()
        light = np.fft.irfft(spectrum * lighter, size, axis=0)[wider].copy()
        bent: np.ndarray | None = None
        if stream.stiffness is not None:  # q = q_m - tau_l / k, of the position filter's band alike
            bending = np.fft.rfft(window[:, -2 * n : -n] / stream.stiffness, size, axis=0)
            bent = np.fft.irfft(bending * low, size, axis=0)[wide].copy()
        _, motor, sensor = (x if x is None else x.copy() for x in stream.split(window[inner]))
        weight = stream.weight(window[inner])
        yield Smoothed(number, first, q, light, bent, motor, sensor, weight), window, inner


def _block(
    stream: RecordingStream,
    bank: FilterBank,
    its: Smoothed,
    states: list[float | None],
    turned: list[Turned | None],
) -> FilteredBlock:
    """What follows from a window's filtered positions; rows at rest and in filter transients are left out."""
    rate, n = bank.position.rate_hz, len(stream.need.joints)
    segment = stream.survey.segments[its.segment]
    t, span = _span(segment, bank, its.first, len(its.weight))
    vs = bank.vs if bank.vs is not None else np.zeros(n)
    here = slice(bank.beside, bank.beside + len(its.weight))
    around = first_difference(its.light, rate)  # two rows less at either end
    speed = around[bank.beside - 2 :][: len(its.weight)]
    dq, ddq = first_difference(its.q, rate), second_difference(its.q, rate)
    light = its.light[here]
    sign = told_sign(light[span], speed[span], rate, vs, bank.turn_over, states)
    shown = _shown(its.light, bank, turned, len(its.weight))[2:-2]
    certain = _certain(around, shown, vs, bank, len(its.weight))[span]
    certain[:, segment.resting] = 0.0  # its encoder's flicker has no sign
    for j in bank.resting:  # rounding is no motion; its load is seen all the same, beside static friction
        dq[:, j] = ddq[:, j] = speed[:, j] = sign[:, j] = 0.0
        certain[:, j] = 1.0
    return FilteredBlock(
        t[span],
        its.q[2:-2][span],
        dq[span],
        ddq[span],
        sign,
        None if its.motor is None else its.motor[span],
        None if its.sensor is None else its.sensor[span],
        vs,
        certain * its.weight[span],
        speed[span],
        None if its.bent is None else (ddq + second_difference(its.bent, rate))[span],
        its.weight[span] > 0,
        light[span] if bank.light else None,
        (light if bank.light else its.q[2:-2])[: span.start],
    )


def windows(blocks: Iterable[np.ndarray], halo: int) -> Iterator[tuple[int, np.ndarray, slice]]:
    """Regroup blocks (N, m) into windows with `halo` rows on either side, reflected oddly at the two ends.

    Yields (number of the first inner row, window, slice of the inner rows in it).
    """
    inner_rows = max(INNER, 4 * halo)
    held: list[np.ndarray] = []
    count = start = 0
    begun = False
    for block in blocks:
        held.append(block)
        count += len(block)
        while count >= inner_rows + (2 * halo if begun else halo + 1):
            rows = np.concatenate(held)
            if not begun:
                rows, begun = _odd_start(rows, halo), True
            yield start, rows[: inner_rows + 2 * halo], slice(halo, halo + inner_rows)
            start += inner_rows
            held = [rows[inner_rows:]]
            count = len(held[0])
    if held:
        rows = np.concatenate(held)
        if not begun:
            rows = _odd_start(rows, halo)
        if len(rows) > halo:
            total = len(rows)
            yield start, _odd_end(rows, halo), slice(halo, total)


def _odd_start(rows: np.ndarray, halo: int) -> np.ndarray:
    return reflected(rows, halo, 0)


def _odd_end(rows: np.ndarray, halo: int) -> np.ndarray:
    return reflected(rows, 0, halo)


def prepare(
    stream: RecordingStream,
    settings: FilterSettings,
    turn_over: Sequence[TurnOver] = (),
    resting: Sequence[int] = (),
    lowest: Sequence[float] | None = None,
) -> FilterBank:
    """The filters of a recording with the velocity noise estimated on the first samples that move. lowest: as
    of other settings, whose positions these are."""
    n, bank = len(stream.need.joints), filter_bank(settings, stream.rate_hz)
    bank = replace(bank, turn_over=tuple(turn_over), resting=tuple(resting))
    q, steps = _first_moving(stream), steps_of(stream)
    if lowest is None:
        seconds = [its.move_end - its.move_start for its in stream.survey.segments]
        usual = sum(seconds) / len(seconds)
        likely = bank.sign.up_to(bank.sign.cutoff_hz / SIGN)
        lowest = [best_cutoff(x, step, likely, usual) for x, step in zip(q.T, steps)]
    bank = replace(bank, lowest=tuple(lowest) if np.isfinite(lowest).any() else ())
    if settings.sign_velocity is not None:
        return replace(bank, vs=np.full(n, settings.sign_velocity))
    vs = NOISE_FACTOR * velocity_noise(q, bank, steps)
    if bank.lowest:
        hz = np.array(bank.lowest)
        steps = np.where(np.isfinite(hz), steps, 0.0)
        vs = np.maximum(vs, steps * np.where(steps > 0, SIGN * hz, 0.0))
        bank = replace(bank, hidden=tuple(steps.tolist()))
    return replace(bank, vs=vs)


def _first_moving(stream: RecordingStream) -> np.ndarray:
    """Positions (N, n) of the first samples that move."""
    q: list[np.ndarray] = []
    rows = 0
    for segment, blocks in stream.segments():
        skip = int((segment.move_start - segment.start) * stream.rate_hz)
        for block in blocks:
            moving = block[max(skip, 0) :, : len(stream.need.joints)]
            skip -= len(block)
            q.append(moving)
            rows += len(moving)
            if rows > NOISE_ROWS:
                break
        if rows > MIN_SAMPLES:
            break
    return np.concatenate(q)


def filter_stream(
    stream: RecordingStream, bank: FilterBank, *, torque_too: bool = False
) -> Iterator[tuple[int, FilteredBlock]]:
    """All filtered blocks of a recording with the number of their segment. The transforms of a short one are
    kept for the next time.

    `torque_too` passes the torques through the position filter as well (for the error at the full rate).
    """
    n, key = len(stream.need.joints), (bank.filters, bank.beside)
    low = np.zeros((0, 0))

    def made() -> Iterator[Smoothed]:
        nonlocal low
        for its, window, inner in _smoothed(stream, bank):
            if torque_too:
                low = window[inner].copy()
                low[:, n:-n] = filtered(bank.position, window[:, n:-n], inner)
            yield its

    states: list[float | None] = [None] * n
    turned: list[Turned | None] = [None] * n
    last = 0
    for its in made() if torque_too and key in stream.held else stream.held.blocks(key, made()):
        if its.segment != last:
            last, states[:], turned[:] = its.segment, [None] * n, [None] * n
        if torque_too:
            _, motor, sensor = stream.split(low)
            its = replace(its, motor=motor, sensor=sensor)
        yield its.segment, _block(stream, bank, its, states, turned)


__all__ = [
    "FilterBank",
    "FilteredBlock",
    "LowPass",
    "filter_stream",
    "prepare",
    "smooth_sign",
    "velocity_noise",
    "zero_phase",
]
