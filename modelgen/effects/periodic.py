"""What repeats with a joint's position: wavenumbers that a residual shows, and the range worth searching."""

from collections.abc import Mapping, Sequence

import numpy as np

from modelgen.effects.place import REVOLUTE_TRAVEL, USUAL_SLIDE, Motion, Place

Array = np.ndarray
FASTEST = 400.0  # 1/rad of a joint that turns: the teeth of a gear
SHORTEST = 0.002  # m, of one that slides: leads of ball screws are 2 mm and more (ISO 3408)
FEWEST_WAVES = 1.5  # over the travel; fewer are a slope or a bend
BINS = 200_000


def wavenumber_range(travel: float, prismatic: bool) -> tuple[float, float]:
    """(low, high) [1/rad | 1/m] for a joint of this travel [rad | m]."""
    low = 2 * np.pi * FEWEST_WAVES / max(travel, 1e-6)
    high = 2 * np.pi / SHORTEST if prismatic else FASTEST
    return min(low, 0.5 * high), high


def wavenumber_bounds(place: Place) -> tuple[float, float]:
    """Where a wave that was found may end: half as many over the travel as a search begins with. Other runs
    can show that it is one."""
    usual = USUAL_SLIDE if place.prismatic else REVOLUTE_TRAVEL
    low, high = wavenumber_range(usual if place.travel is None else place.travel, place.prismatic)
    return 0.5 * low, high


def beyond_an_error(values: Mapping[str, float], largest: float) -> str | None:
    """Why a position error es sin + ec cos [rad | m] cannot be: gears and encoders err by arc minutes, and
    what bends a joint further than a degree is its load. None where it can."""
    size = float(np.hypot(values.get("es", 0.0), values.get("ec", 0.0)))
    if size <= largest:
        return None
    return f"an error of {size:.2g} is more than a gear or encoder has ({largest:g})"


def travel_of(motions: Sequence[Motion], joint: int) -> float:
    """How far the joint goes in the motions [rad | m]."""
    ends = [(m.q[:, joint].min(), m.q[:, joint].max()) for m in motions if len(m.t)]
    return max(high for _, high in ends) - min(low for low, _ in ends) if ends else 0.0


def peaks(
    motions: Sequence[Motion],
    residuals: Sequence[Array],
    joint: int,
    low: float,
    high: float,
    count: int = 4,
) -> list[float]:
    """Up to 2 `count` wavenumbers in [low, high] where sum of residual exp(i k q) is largest: `count` below
    four times `low`, where slopes leak to, and as many above. Residuals (N,), NaN left out."""
    q = np.concatenate([m.q[:, joint] for m in motions])
    r = np.concatenate([np.asarray(x, dtype=float) for x in residuals])
    good = np.isfinite(r) & np.isfinite(q)
    q, r = q[good], r[good] - r[good].mean() if good.any() else r[good]
    if len(q) < 8 or np.ptp(q) <= 0:
        return []
    width = np.pi / (4 * high)
    place = np.floor((q - q.min()) / width).astype(int)
    if place.max() > BINS:
        return []
    span = 2 * np.pi / np.ptp(q)  # what two waves must differ by
    size = 1 << int(np.ceil(np.log2(8 * 2 * np.pi / (span * width))))
    density = np.bincount(place, weights=r, minlength=1)
    power = np.abs(np.fft.rfft(density, max(size, len(density)))) ** 2
    k = 2 * np.pi * np.arange(len(power)) / (max(size, len(density)) * width)
    found: list[float] = []
    for a, b in ((low, min(4 * low, high)), (4 * low, high)):
        score = np.where((k >= a) & (k <= b), power, 0.0)
        for _ in range(count):
            best = int(np.argmax(score))
            if score[best] <= 0:
                break
            found.append(float(k[best]))
            score[np.abs(k - k[best]) < span] = 0.0
    return found
