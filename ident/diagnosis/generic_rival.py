"""What anything could explain: products of {1, q, dq, ddq, sign dq, t} of all joints and sin/cos(q) times
those.

Where such a nameless column beats the best effect of the catalogue clearly, nobody is blamed and the joint
is reported as unexplained with the variables of the winning columns.
"""

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse

from ident.diagnosis.rows import Fine
from ident.diagnosis.scoring import Score, System
from ident.diagnosis.terms import Context


@dataclass(frozen=True)
class GenericLibrary:
    """(M, K) filtered products and the variables each one is made of."""

    values: np.ndarray
    variables: tuple[tuple[str, ...], ...]
    products: dict[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)


@dataclass(frozen=True)
class Rival:
    """The best nameless explanation of one channel."""

    channel: int
    variables: tuple[str, ...]
    columns: np.ndarray  # (M, p)
    score: Score
    share_percent: float  # of the channel's residual energy


def build_generic(fine: Fine, low_pass: scipy.sparse.csr_array) -> GenericLibrary:
    """Some nine hundred columns for seven joints, filtered in blocks."""
    n = fine.q.shape[1]
    base: list[tuple[tuple[str, ...], np.ndarray]] = [((), np.ones(len(fine.t)))]
    waves: list[tuple[tuple[str, ...], np.ndarray]] = []
    for k in range(n):
        q = fine.q[:, k]
        centred = q - q.mean()
        base += [
            ((f"q{k + 1}",), centred),
            ((f"dq{k + 1}",), fine.dq[:, k]),
            ((f"ddq{k + 1}",), fine.ddq[:, k]),
            ((f"dq{k + 1}",), fine.sign[:, k]),
        ]
        for m in (1, 2):
            waves += [((f"q{k + 1}",), np.sin(m * q)), ((f"q{k + 1}",), np.cos(m * q))]
    base.append((("t",), fine.t / 60.0))
    names: list[tuple[str, ...]] = []
    parts: list[np.ndarray] = []
    block: list[np.ndarray] = []

    def flush() -> None:
        if block:
            parts.append(low_pass @ np.stack(block, axis=1))
            block.clear()

    def add(one, two) -> None:
        names.append(tuple(sorted({*one[0], *two[0]})))
        block.append(one[1] * two[1])
        if len(block) == 200:
            flush()

    for i, one in enumerate(base):
        for two in base[i:]:
            add(one, two)
    for wave in waves:
        for two in base:
            add(wave, two)
    flush()
    return GenericLibrary(np.hstack(parts), tuple(names))


def best_rival(
    library: GenericLibrary, system: System, channel: int, context: Context, size: int = 2
) -> Rival | None:
    """Greedy choice of up to `size` columns on one channel by the identify rows; scored on both kinds of
    rows."""
    mask = system.identify_mask(channel)
    w = system.weight[channel]
    if channel not in library.products:
        masked = library.values * mask[:, None]
        library.products[channel] = (
            system.bank.base[channel].T @ masked,
            np.einsum("ij,ij->j", masked, library.values),
        )
    model, squares = library.products[channel]
    own, own_names = local_columns(context, system, channel)
    masked_own = own * mask[:, None]
    L = np.hstack([library.values, own])
    names = library.variables + own_names
    model = np.hstack([model, system.bank.base[channel].T @ masked_own])
    squares = np.concatenate([squares, np.einsum("ij,ij->j", masked_own, own)])
    raw = np.concatenate([model, (system.extra[channel] * mask[:, None]).T @ L])
    XtL = system.basis.T @ raw * w
    norms = squares * w
    left = norms - np.einsum("ij,ij->j", XtL, XtL)
    v = L.T @ (system.residual[channel] * mask) * w
    usable = left > 1e-4 * norms
    chosen: list[int] = []
    directions: list[tuple[np.ndarray, float]] = []
    best: Rival | None = None
    for _ in range(size):
        gain = np.where(usable & (left > 1e-4 * norms), v * v / np.maximum(left, 1e-300), 0.0)
        k = int(np.argmax(gain))
        if gain[k] <= 0:
            break
        chosen.append(k)
        usable[k] = False
        columns = L[:, chosen]
        score = system.score({channel: columns})
        if best is None or score.held_out > best.score.held_out:
            share = 100 * (1 - score.rss[channel] / max(system.rss[channel], 1e-30))
            best = Rival(channel, _variables(names, chosen), columns, score, float(np.clip(share, 0, 100)))
        # partial the chosen column out of the others
        cross = L.T @ (L[:, k] * mask) * w - XtL.T @ XtL[:, k]
        for cj, dj in directions:
            cross = cross - cj * cj[k] / dj
        d = max(float(cross[k]), 1e-300)
        v = v - cross * v[k] / d
        left = left - cross * cross / d
        directions.append((cross, d))
    return best


def local_columns(
    context: Context, system: System, channel: int
) -> tuple[np.ndarray, tuple[tuple[str, ...], ...]]:
    """Columns that follow this channel's residual: lines in time, waves in the position that scale with the
    rate, bends of the torque itself, products of three signals with the joint's own."""
    rows = context.rows
    fine = rows.fine
    j = context.view.joint_of[channel]
    q, dq, sign = f"q{j + 1}", f"dq{j + 1}", f"dq{j + 1}"
    parts: list[np.ndarray] = []
    names: list[tuple[str, ...]] = []
    residual = system.residual[channel] * system.identify_mask(channel)
    hop = float(np.median(np.diff(rows.t)))
    place = np.round(rows.t / hop).astype(int)
    density = np.bincount(place, weights=residual)
    size = 1 << int(np.ceil(np.log2(4 * len(density))))
    power = np.abs(np.fft.rfft(density, size)) ** 2
    f = np.fft.rfftfreq(size, hop)
    power[(f < 0.03) | (f > 0.5 * rows.filter.cutoff_hz)] = 0.0
    width = 1.5 / max(float(rows.t.max()), 1.0)
    for _ in range(4):
        line = f[int(np.argmax(power))]
        parts += [np.sin(2 * np.pi * line * rows.t), np.cos(2 * np.pi * line * rows.t)]
        names += [("t",), ("t",)]
        power[np.abs(f - line) < width] = 0.0
    u = rows.low_pass.T @ residual
    waves: list[np.ndarray] = []
    x = fine.q[:, j]
    for factor, name in ((fine.dq[:, j], dq), (fine.sign[:, j], sign)):
        for k in wave_peaks(x, u * factor, 2):
            waves += [np.sin(k * x) * factor, np.cos(k * x) * factor]
            names += [(q, name), (q, name)]
    torque = context.torque[channel] / max(float(np.std(context.torque[channel])), 1e-30)
    for bend in (torque * np.abs(torque), torque**3, np.tanh(3 * torque), np.clip(torque, -1.5, 1.5)):
        waves.append(bend)
        names.append(("tau",))
    for own in (np.sin(x), np.cos(x), fine.dq[:, j], fine.sign[:, j]):
        for other in range(fine.q.shape[1]):
            other_q = fine.q[:, other] - fine.q[:, other].mean()
            waves += [own * other_q**2, own * np.abs(fine.dq[:, other])]
            names += [(q, f"q{other + 1}"), (q, f"dq{other + 1}")]
    for cubic in (2, 3, 4):
        waves.append((x - x.mean()) ** cubic)
        names.append((q,))
    for share in (0.7, 0.8, 0.9):  # what sets in near an end of the range
        low, high = np.quantile(x, (1 - share, share))
        waves += [np.maximum(x - high, 0.0) ** 2, np.maximum(low - x, 0.0) ** 2]
        names += [(q,), (q,)]
    filtered = rows.low_pass @ np.stack(waves, axis=1)
    return np.hstack([np.stack(parts, axis=1), filtered]), tuple(tuple(dict.fromkeys(n)) for n in names)


def wave_peaks(x: np.ndarray, weights: np.ndarray, count: int) -> list[float]:
    """Wavenumbers (2 to 60 a radian) where sum weights exp(i k x) is largest."""
    width = np.pi / 240.0
    place = np.floor((x - x.min()) / width).astype(int)
    if place.max() > 100_000:
        return []
    density = np.bincount(place, weights=weights)
    size = 1 << int(np.ceil(np.log2(max(2 * np.pi / (0.08 * width), len(density)))))
    power = np.abs(np.fft.rfft(density, size)) ** 2
    k = 2 * np.pi * np.arange(len(power)) / (size * width)
    power[(k < 2.0) | (k > 60.0)] = 0.0
    out = []
    for _ in range(count):
        best = int(np.argmax(power))
        if power[best] <= 0:
            break
        out.append(float(k[best]))
        power[np.abs(k - k[best]) < 2 * np.pi / max(float(np.ptp(x)), 0.1)] = 0.0
    return out


def _variables(names: tuple[tuple[str, ...], ...], chosen: list[int]) -> tuple[str, ...]:
    found: list[str] = []
    for k in chosen:
        found += [v for v in names[k] if v not in found]
    return tuple(found)
