"""The sign of Coulomb friction as the recordings show it: how fast friction turns over at a reversal, per
joint.

No real (or simulated) joint has a mathematical sign: friction turns over within a small rate (tanh) or a
small travel (Dahl's presliding, here at most half a milliradian). A sign that is too sharp or too soft
leaves pulses at every reversal of every joint, which look like hysteresis, delay or a Stribeck curve. The
turn-over is a property of the model, chosen by likelihood before anything is looked for; a travel beyond
the cap is an effect and is left for the search.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ident.diagnosis.model_view import ModelView, split_name
from ident.diagnosis.rows import Rows, TurnOver
from ident.diagnosis.scoring import Bank, Columns, make_bank, make_system
from modelgen.effects.states import integrate_dahl

RATES = tuple(5e-4 * 1.41**k for k in range(10))  # rad/s of tanh(dq / rate)
TRAVELS = tuple(2e-6 * 1.6**k for k in range(12))  # rad of Dahl's law, up to 0.35 mrad
SOFTER = 1.3  # times the rate or travel, for a derivative
WORTH = 2.0  # log-likelihood that a new turn-over must gain


Carried = Mapping[int, Mapping[int, np.ndarray]]  # {joint: {channel: (N,) N m that the sign multiplies}}


def settle_sign(
    rows: Rows,
    view: ModelView,
    bank: Bank,
    extra: np.ndarray | None = None,
    torque: np.ndarray | None = None,
    passes: int = 2,
    worth: float = WORTH,
    carried: Carried | None = None,
    late: Mapping[int, float] | None = None,
) -> tuple[Rows, ModelView, Bank]:
    """Rows, view and bank with each joint's turn-over chosen; the same bank when nothing is worth a change.

    `extra` (channels, M, e): columns of what was found so far; `torque` (channels, M): instead of the
    measured one; `carried`: amplitudes of found terms that change sign with the rate (Stribeck, load);
    `late`: {channel: s} by which a channel's torque comes late, and a new turn-over with it.
    """
    extra = np.zeros((*bank.base.shape[:2], 0)) if extra is None else extra
    torque = rows.y if torque is None else torque
    carried, late = carried or {}, late or {}
    given = bank
    places = coulomb_places(view)
    joints = sorted({*places, *carried})
    if not joints:
        return rows, view, bank
    fine = rows.fine
    sign, turn_over = fine.sign.copy(), list(fine.turn_over)
    filtered = rows.low_pass @ sign
    for _ in range(passes):
        system = make_system(bank, extra, torque)
        changed = False
        for j in joints:
            options = _options(rows, j)
            size = coulomb_sizes(places.get(j, []), system.coefficients)
            best, gain = None, worth
            changes = _changes(rows, options, sign[:, j], filtered[:, j], size, carried.get(j, {}), late)
            for option, change in enumerate(changes):
                if max(np.abs(d).max() for d in change.values()) < 1e-9:
                    continue
                score = system.score(change)
                replaced = replacing(score.identify, float(score.coefficients[0]))
                if replaced > gain:
                    best, gain = option, replaced
            if best is not None:
                turn_over[j], sign[:, j], filtered[:, j] = options[best]
                changed = True
        if not changed:
            break
        bank = _bank_with(bank, places, filtered)
    rows = replace(rows, fine=replace(fine, sign=sign, turn_over=tuple(turn_over)))
    if tuple(turn_over) == fine.turn_over:
        return rows, view, given
    if bank is given:  # only found terms carry a sign: the model's columns are the same
        bank = replace(bank)
    return rows, _entries_with(view, sign), bank


def coulomb_sizes(columns: Sequence, coefficients: np.ndarray) -> dict[int, float]:
    """{channel: N m} of the model's Coulomb friction of one joint."""
    out: dict[int, float] = {}
    for k, channels in columns:
        for c in channels:
            out[c] = out.get(c, 0.0) + float(coefficients[k])
    return out


def _changes(rows, options, sign, filtered, size, carried, late) -> list[Columns]:
    """For each turn-over {channel: (M, 1)} that it would change in the torque."""
    out: list[Columns] = [{} for _ in options]
    fine = None
    for c in sorted({*size, *carried}):
        if c in carried or c in late:
            if fine is None:
                fine = np.stack([v - sign for _, v, _ in options], axis=1)
            matrix = rows.filter.matrix(late[c]) if c in late else rows.low_pass
            amplitude = size.get(c, 0.0) + carried.get(c, np.zeros(1))
            values = matrix @ (fine * amplitude[:, None])
        else:
            values = size[c] * (np.stack([low for _, _, low in options], axis=1) - filtered[:, None])
        for option, change in enumerate(out):
            change[c] = values[:, [option]]
    return out


def coulomb_places(view: ModelView) -> dict[int, list[tuple[int, list[int]]]]:
    """{joint: [(parameter, channels)]} of the model's Coulomb friction."""
    places: dict[int, list[tuple[int, list[int]]]] = {}
    for k, name in enumerate(view.parameters):
        kind, row = split_name(name)
        if kind in ("Fcm", "Fcl"):
            channels = [c for c, (index, _) in enumerate(view.entries) if k in index]
            places.setdefault(row - 1, []).append((k, channels))
    return places


def _bank_with(bank: Bank, places: Mapping[int, Sequence], filtered: np.ndarray) -> Bank:
    """The bank with the Coulomb columns of other signs, `filtered` (M, n)."""
    base = bank.base.copy()
    for j, columns in places.items():
        for k, channels in columns:
            for c in channels:
                base[c, :, k] = filtered[:, j]
    return make_bank(base, bank.keep, bank.folds)


def _entries_with(view: ModelView, sign: np.ndarray) -> ModelView:
    entries = [(index, values.copy()) for index, values in view.entries]
    for j, columns in coulomb_places(view).items():
        for k, channels in columns:
            for c in channels:
                index, values = entries[c]
                values[:, int(np.flatnonzero(index == k)[0])] = sign[:, j]
    return replace(view, entries=tuple(entries))


def sharpened(rows: Rows, view: ModelView, bank: Bank, joints: Sequence[int]) -> tuple[Rows, ModelView, Bank]:
    """Rows, view and bank with friction that turns over at once on these joints."""
    fine = rows.fine
    sign, turn_over = fine.sign.copy(), list(fine.turn_over)
    for j in joints:
        turn_over[j] = TurnOver("rate", float(fine.sign_width[j]))
        sign[:, j] = sign_of(rows, j, turn_over[j])
    sharp = _bank_with(bank, coulomb_places(view), rows.low_pass @ sign)
    rows = replace(rows, fine=replace(fine, sign=sign, turn_over=tuple(turn_over)))
    return rows, _entries_with(view, sign), sharp


def replacing(gain: float, ratio: float) -> float:
    """Gain when a column's step to another turn-over is taken once. `gain` is that of the best multiple
    `ratio` of the step, and the likelihood is quadratic in the multiple."""
    return gain * (2.0 / ratio - 1.0 / ratio**2) if ratio > 0.5 else 0.0


def sign_of(rows: Rows, joint: int, turn_over: TurnOver) -> np.ndarray:
    """(N,) the joint's sign by a law: tanh(dq/value) or Dahl's with the travel `value`."""
    fine = rows.fine
    if turn_over.law == "rate":
        return np.tanh(fine.dq[:, joint] / turn_over.value)
    z = np.empty(len(fine.t))
    for piece in fine.pieces:
        q = fine.q[piece, joint]
        start = float(np.sign(q[min(len(q) - 1, 5)] - q[0]))
        z[piece] = integrate_dahl(q, {"width": turn_over.value}, start)
    return z


def softer(rows: Rows, joint: int) -> np.ndarray:
    """(N,) change of the joint's sign when its friction turns over a little softer."""
    now = rows.fine.turn_over[joint]
    other = sign_of(rows, joint, TurnOver(now.law, SOFTER * now.value))
    return other - rows.fine.sign[:, joint]


def _options(rows: Rows, joint: int) -> list[tuple[TurnOver, np.ndarray, np.ndarray]]:
    """(law, fine, filtered) turn-overs of a joint, from sharp to soft."""
    key = ("turn_overs", joint)
    if key not in rows.memo:
        rows.memo[key] = _all_options(rows, joint)
    return rows.memo[key]


def _all_options(rows: Rows, joint: int) -> list[tuple[TurnOver, np.ndarray, np.ndarray]]:
    top = 0.02 * float(np.abs(rows.fine.dq[:, joint]).max())
    rates = [r for r in RATES if r <= top] or [max(top, 1e-6)]
    laws = [*(TurnOver("rate", r) for r in rates), *(TurnOver("travel", w) for w in TRAVELS)]
    values = [sign_of(rows, joint, law) for law in laws]
    low = rows.low_pass @ np.stack(values, axis=1)
    return [(law, v, low[:, i]) for i, (law, v) in enumerate(zip(laws, values))]
