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
from ident.diagnosis.scoring import Bank, make_bank, make_system
from modelgen.effects.states import integrate_dahl

RATES = tuple(5e-4 * 1.41**k for k in range(10))  # rad/s of tanh(dq / rate)
TRAVELS = tuple(2e-6 * 1.6**k for k in range(12))  # rad of Dahl's law, up to 0.35 mrad
SOFTER = 1.3  # times the rate or travel, for a derivative
WORTH = 2.0  # log-likelihood that a new turn-over must gain


def settle_sign(
    rows: Rows,
    view: ModelView,
    bank: Bank,
    extra: np.ndarray | None = None,
    torque: np.ndarray | None = None,
    passes: int = 2,
    worth: float = WORTH,
    found: Sequence[tuple[int, int, Sequence[int]]] = (),
    late: Mapping[int, float] | None = None,
) -> tuple[Rows, ModelView, Bank]:
    """Rows, view and bank with each joint's turn-over chosen; the same bank when nothing is worth a change.

    `extra` (channels, M, e): columns of what was found so far; `torque` (channels, M): instead of the
    measured one; `found`: (joint, column of `extra`, channels) of Coulomb friction that was found; `late`:
    {channel: s} by which a channel's torque comes late, and a new turn-over with it.
    """
    late = late or {}
    extra = np.zeros((*bank.base.shape[:2], 0)) if extra is None else extra
    torque = rows.y if torque is None else torque
    given = bank
    places = coulomb_places(view)
    b = bank.base.shape[2]
    for joint, column, channels in found:
        places.setdefault(joint, []).append((b + column, list(channels)))
    if not places:
        return rows, view, bank
    fine = rows.fine
    sign, turn_over = fine.sign.copy(), list(fine.turn_over)
    filtered = rows.low_pass @ sign
    options = {j: _options(rows, j) for j in places}
    base = bank.base
    for _ in range(passes):
        system = make_system(bank, extra, torque)
        changed = False
        for j, columns in places.items():
            best, gain = None, worth
            behind = _delayed(
                rows, options[j], sign[:, j], {c: late[c] for c in late if view.joint_of[c] == j}
            )
            for option, (_, _, low) in enumerate(options[j]):
                d = low - filtered[:, j]
                if np.abs(d).max() < 1e-9:
                    continue
                change = {c: np.zeros((len(d), len(columns))) for c in {c for _, cs in columns for c in cs}}
                for i, (_, cs) in enumerate(columns):
                    for c in cs:
                        change[c][:, i] = behind[c][:, option] if c in behind else d
                score = system.score(change)
                size = np.array([system.coefficients[k] for k, _ in columns])
                ratio = float(score.coefficients @ size) / max(float(size @ size), 1e-30)
                replaced = replacing(score.identify, ratio)
                if replaced > gain:
                    best, gain = option, replaced
            if best is not None:
                turn_over[j], sign[:, j], filtered[:, j] = options[j][best]
                changed = True
        if not changed:
            break
        base, extra = base.copy(), extra.copy()
        for j, columns in places.items():
            for k, channels in columns:
                for c in channels:
                    (base[c] if k < b else extra[c])[:, k if k < b else k - b] = filtered[:, j]
        bank = make_bank(base, bank.keep, bank.folds)
    if bank is given:
        return rows, view, bank
    rows = replace(rows, fine=replace(fine, sign=sign, turn_over=tuple(turn_over)))
    return rows, _entries_with(view, sign), bank


def _delayed(
    rows: Rows, options: Sequence, sign: np.ndarray, late: Mapping[int, float]
) -> dict[int, np.ndarray]:
    """{channel: (M, options)} what each turn-over would change in a channel whose torque comes late."""
    if not late:
        return {}
    change = np.stack([v - sign for _, v, _ in options], axis=1)
    return {c: rows.filter.matrix(delay) @ change for c, delay in late.items()}


def coulomb_places(view: ModelView) -> dict[int, list[tuple[int, list[int]]]]:
    """{joint: [(parameter, channels)]} of the model's Coulomb friction."""
    places: dict[int, list[tuple[int, list[int]]]] = {}
    for k, name in enumerate(view.parameters):
        kind, row = split_name(name)
        if kind in ("Fcm", "Fcl"):
            channels = [c for c, (index, _) in enumerate(view.entries) if k in index]
            places.setdefault(row - 1, []).append((k, channels))
    return places


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
    sign = fine.sign.copy()
    sign[:, list(joints)] = np.tanh(fine.dq[:, list(joints)] / fine.sign_width[list(joints)])
    filtered = rows.low_pass @ sign
    base = bank.base.copy()
    for j, columns in coulomb_places(view).items():
        for k, channels in columns:
            for c in channels:
                base[c, :, k] = filtered[:, j]
    turn_over = list(fine.turn_over)
    for j in joints:
        turn_over[j] = TurnOver("rate", float(fine.sign_width[j]))
    rows = replace(rows, fine=replace(fine, sign=sign, turn_over=tuple(turn_over)))
    return rows, _entries_with(view, sign), make_bank(base, bank.keep, bank.folds)


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
    """(M,) change of the joint's filtered sign when its friction turns over a little softer."""
    now = rows.fine.turn_over[joint]
    other = sign_of(rows, joint, TurnOver(now.law, SOFTER * now.value))
    return rows.low_pass @ (other - rows.fine.sign[:, joint])


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
