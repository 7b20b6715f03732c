"""What changed in which joint of which robot, and was not the temperature, the load or the season.

Friction (Coulomb, viscous, offset) of each joint and day is whitened by the usual covariance of its
estimates; each component is predicted from the robot's own past, its temperature proxy, load and speed, and
from what its sisters did that day (a median: hall temperature, a new program), and what is left goes into a
CUSUM (charts.py). Friction follows temperature and load more than wear: Bittencourt and Axelsson, IEEE/ASME
Trans. Mechatron. 19, 2014.

Two rates of false alarms, both stated: WATCH, one in a robot-year, is what is worth a look; ALARM, one in ten
years of the whole fleet, is what is named.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ident.fleet.charts import Charts, charts, threshold
from modelgen.geometry.names import ParameterName

KINDS = ("Fcm", "Fvm", "Offm", "Fcl", "Fvl", "Offl")
WATCH = 1.0  # false alarms in a robot-year
ALARM = 0.1  # and in a year of the whole fleet
SISTERS = 5  # robots that have a day at least, for its median to say something
MANY = 60
ODD = 6.0  # robust deviations of a joint's friction from that of its sisters


@dataclass(frozen=True, slots=True)
class Point:
    """One robot's fit of one day: values (b,) NaN where not seen, covariance (b, b), heat, speed, load (n,)
    means of the motion, error in percent."""

    robot: str
    day: str
    values: np.ndarray
    covariance: np.ndarray
    heat: np.ndarray
    speed: np.ndarray
    load: np.ndarray
    error_percent: float


@dataclass(frozen=True, slots=True)
class Change:
    """Friction of a joint that changed: first seen on `day`, since about `since`; level "alarm" or "watch";
    `strength` of the chart over the threshold of an alarm; what the friction was and became, N m or N."""

    robot: str
    joint: str
    parameter: str
    level: str
    day: str
    since: str
    strength: float
    before: float
    after: float

    @property
    def percent(self) -> float:
        return float(100 * (self.after - self.before) / max(abs(self.before), 1e-12))

    def sentence(self) -> str:
        """What changed, in words."""
        moved = f"{'rose' if self.after >= self.before else 'fell'} by {abs(self.percent):.0f} %"
        return (
            f"{self.robot}, joint {self.joint}: friction at its usual speed {moved} "
            f"(from {self.before:.3g} to {self.after:.3g}) since about {self.since}, seen on {self.day}; "
            "temperature proxy, load, speed and its sisters do not explain it"
        )


@dataclass(frozen=True, slots=True)
class Trends:
    """changes, strongest first; friction (robots, days, joints) at the usual speed, level (robots, days,
    joints) of the charts over the threshold of an alarm; thresholds of an alarm and of what is worth a look;
    rates per robot-year and fleet-year."""

    robots: tuple[str, ...]
    days: tuple[str, ...]
    joints: tuple[str, ...]
    changes: tuple[Change, ...]
    friction: np.ndarray
    level: np.ndarray
    error_percent: np.ndarray  # (robots, days)
    a_year: float  # observations of a robot
    alarm: float
    watch: float
    odd: tuple[tuple[str, str, float], ...]  # robot, joint, how far from its sisters (robust deviations)


def trends(
    points: Sequence[Point], parameters: Sequence[str], joints: Sequence[str], a_year: float = 365.25
) -> Trends:
    """`a_year`: observations of a robot in a year, by which rates become thresholds."""
    robots = tuple(sorted({point.robot for point in points}))
    days = tuple(sorted({point.day for point in points}))
    at = {(point.robot, point.day): point for point in points}
    shape = len(robots), len(days), len(joints)
    friction, level = np.full(shape, np.nan), np.zeros(shape)
    error = np.full(shape[:2], np.nan)
    for (robot, day), point in at.items():
        error[robots.index(robot), days.index(day)] = point.error_percent
    own = [_own(parameters, joint) for joint in joints]
    sides = 2 * sum(len(its) for its in own)
    watch = threshold(a_year * sides / WATCH)
    alarm = max(threshold(a_year * sides * len(robots) / ALARM), watch)
    changes: list[Change] = []
    for j, (joint, its) in enumerate(zip(joints, own)):
        if its:
            found = _joint(at, robots, days, j, its, [parameters[k][:2] for k in its], alarm)
            friction[:, :, j] = found.friction
            top = found.charts.level.reshape(len(days), len(robots), len(its))
            level[:, :, j] = top.max(axis=2).T / alarm
            changes += _changes(found, robots, days, joint, [parameters[k] for k in its], watch, alarm)
    changes.sort(key=lambda change: (-change.strength, change.robot, change.joint))
    odd = _odd_ones(friction, robots, joints)
    return Trends(
        robots, days, tuple(joints), tuple(changes), friction, level, error, a_year, alarm, watch, odd
    )


def _own(parameters: Sequence[str], joint: str) -> list[int]:
    named = [ParameterName.of(name) for name in parameters]
    return [k for k, its in enumerate(named) if its and its.kind in KINDS and its.label == joint]


@dataclass(frozen=True, slots=True)
class _Joint:
    charts: Charts
    friction: np.ndarray  # (robots, days)


def _joint(
    at: dict[tuple[str, str], Point],
    robots: Sequence[str],
    days: Sequence[str],
    j: int,
    its: list[int],
    kinds: Sequence[str],
    alarm: float,
) -> _Joint:
    R, K, p = len(robots), len(days), len(its)
    y, motion = np.full((K, R, p), np.nan), np.full((K, R, 3), np.nan)
    S = np.full((K, R, p, p), np.nan)
    for r, robot in enumerate(robots):
        for k, day in enumerate(days):
            point = at.get((robot, day))
            if point is not None:
                y[k, r], S[k, r] = point.values[its], point.covariance[np.ix_(its, its)]
                motion[k, r] = point.heat[j], point.load[j], point.speed[j]
    seen = np.isfinite(y).all(axis=2)
    speed = np.nanmedian(motion[:, :, 2]) if seen.any() else 0.0
    weigh = np.array([{"Fv": speed, "Fc": 1.0}.get(kind, 0.0) for kind in kinds])
    friction = np.where(seen, y @ weigh, np.nan).T
    L = _half(S[seen])
    white = np.linalg.solve(L, np.where(seen, y.transpose(2, 0, 1), np.nan).reshape(p, -1)).reshape(p, K, R)
    inverse = np.linalg.inv(L)
    v = np.einsum("ij,krjl,il->kri", inverse, S, inverse)
    white, changed = white.transpose(1, 2, 0), np.zeros(R, bool)
    while True:  # a robot that wears is nobody's custom: the strongest is left out, the others judged again
        found = _charts(white, motion, v, changed)
        top = np.where(changed, 0.0, found.level.reshape(K, R, p).max(axis=(0, 2)))
        if R - changed.sum() <= SISTERS or top.max() <= alarm:
            return _Joint(found, friction)
        changed[int(np.argmax(top))] = True


def _half(S: np.ndarray) -> np.ndarray:
    """L (p, p) of the covariances (m, p, p): L L' has their median deviations and mean correlations."""
    p = S.shape[-1]
    deviations = np.sqrt(np.maximum(np.diagonal(S, axis1=1, axis2=2), 1e-300))
    if not len(S):
        return np.eye(p)
    correlation = np.mean(S / (deviations[:, :, None] * deviations[:, None, :]), axis=0)
    return np.linalg.cholesky(correlation + 1e-6 * np.eye(p)) * np.median(deviations, axis=0)[:, None]


def _charts(white: np.ndarray, motion: np.ndarray, v: np.ndarray, changed: np.ndarray) -> Charts:
    """white, v (K, R, p), motion (K, R, 3) -> charts of R p series, robot by robot; those `changed` (R,) are
    left out of what sisters do."""
    K, R, p = white.shape
    own = white - _median(white, 0)
    sisters = np.zeros_like(white)
    if R > SISTERS:
        usual = np.where(changed[:, None], np.nan, own)
        for r in range(R):
            if R <= MANY or r == 0:  # in a large fleet a robot's own share in the median is nothing
                others = np.delete(usual, r, axis=1) if R <= MANY else usual
                enough = np.isfinite(others[:, :, 0]).sum(axis=1) >= SISTERS
                middle = _median(others, 1)[enough, 0]
            sisters[enough, r] = middle
    moved = motion - _median(motion, 0)
    spread = np.nanstd(moved, axis=(0, 1)) if np.isfinite(moved).any() else np.ones(3)
    moved = moved / np.where(
        spread > 1e-9 * np.nanmax(np.abs(motion), axis=(0, 1), initial=0.0), spread, np.inf
    )
    x = np.ones((K, R, p, 5))
    x[..., 1:4] = moved[:, :, None]
    x[..., 4] = sisters / max(float(np.std(sisters)), 1e-12)
    return charts(white.reshape(K, -1), x.reshape(K, R * p, 5), v.reshape(K, -1))


def _median(values: np.ndarray, axis: int) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of nothing but NaN
        return np.asarray(np.nanmedian(values, axis=axis, keepdims=True))


def _changes(
    found: _Joint,
    robots: Sequence[str],
    days: Sequence[str],
    joint: str,
    names: Sequence[str],
    watch: float,
    alarm: float,
) -> list[Change]:
    """The strongest chart of each robot that ever stood above a threshold."""
    out, p = [], len(names)
    for r, robot in enumerate(robots):
        level = found.charts.level[:, r * p : (r + 1) * p]
        i = int(np.argmax(level.max(axis=0)))
        top = float(level[:, i].max())
        if top <= watch:
            continue
        limit = alarm if top > alarm else watch
        k = int(np.argmax(level[:, i] > limit))
        since = int(found.charts.since[k, r * p + i])
        before, after = found.friction[r, :since], found.friction[r, since : k + 1]
        out.append(
            Change(
                robot,
                joint,
                names[i],
                "alarm" if top > alarm else "watch",
                days[k],
                days[since],
                top / alarm,
                float(np.nanmedian(before)),
                float(np.nanmedian(after[-3:])),
            )
        )
    return out


def _odd_ones(
    friction: np.ndarray, robots: Sequence[str], joints: Sequence[str]
) -> tuple[tuple[str, str, float], ...]:
    """Robots whose joint rubs otherwise than its sisters' from the first day on: levels, not changes."""
    if len(robots) <= SISTERS:
        return ()
    each = _median(friction, 1)[:, 0]
    away = each - _median(each, 0)
    deviation = 1.4826 * _median(np.abs(away), 0)[0]
    far = away / np.where(deviation > 0, deviation, np.inf)
    found = [(robots[r], joints[j], float(far[r, j])) for r, j in zip(*np.nonzero(np.abs(far) > ODD))]
    return tuple(sorted(found, key=lambda item: -abs(item[2])))
