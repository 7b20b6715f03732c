"""What a motion may ask of a robot: limits of every joint from the robot file, from options, else assumed.

Options are texts as a user types them: "dq=1.5" for every joint, "q:2=-1..1", "jerk:3=40", "tau:1=120".
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ident.errors import IdentError
from modelgen.geometry.robot import Robot

Array = np.ndarray
KEYS = ("q", "dq", "ddq", "jerk", "tau")
UNITS = {"q": "rad", "dq": "rad/s", "ddq": "rad/s^2", "jerk": "rad/s^3", "tau": "N m"}
ASSUMED = {  # where the robot file states nothing: of a joint that turns, of one that slides (m)
    "q": ((-math.pi, math.pi), (-0.3, 0.3)),
    "dq": (2.0, 0.5),
    "ddq": (10.0, 3.0),
    "jerk": (100.0, 30.0),
}

LEAST = 1e-3  # rad, m: amplitude that shows something


class ExcitationError(IdentError):
    """A motion that cannot be designed as asked."""


@dataclass(frozen=True)
class Bounds:
    """Limits of n joints, SI units: low, high, dq, ddq, jerk, tau, each (n,); tau is inf where none is known.

    `labels` are the k of q_k; `assumed` says which limits nobody stated, `beyond` which options allow more
    than the robot file."""

    labels: tuple[str, ...]
    slides: tuple[bool, ...]
    low: Array
    high: Array
    dq: Array
    ddq: Array
    jerk: Array
    tau: Array
    assumed: tuple[str, ...] = ()
    beyond: tuple[str, ...] = ()

    @property
    def half(self) -> Array:
        return (self.high - self.low) / 2

    @property
    def middle(self) -> Array:
        return (self.high + self.low) / 2

    def excess(self, states: Sequence[Array], tau: Array | None = None) -> tuple[float, str]:
        """(largest use of a limit as a share of it, in words); states q, dq, ddq, jerk (N, n), tau (N, n)."""
        used = {"q": np.abs(states[0] - self.middle) / self.half}
        used |= {key: np.abs(s) / getattr(self, key) for key, s in zip(("dq", "ddq", "jerk"), states[1:])}
        if tau is not None:
            used["tau"] = np.abs(tau) / self.tau
        worst = {key: float(share.max()) for key, share in used.items()}
        key = max(worst, key=worst.__getitem__)
        joint = int(np.argmax(used[key].max(axis=0)))
        return worst[key], self.told(key, joint)

    def check_room(self, period: float, start: Array | None = None) -> None:
        """Raises ExcitationError where a limit leaves a joint less than LEAST of a sine of that period, s, or
        of the way to either side of its start."""
        w = 2 * math.pi / period
        room = {key: getattr(self, key) / w**k for k, key in enumerate(("half", "dq", "ddq", "jerk"))}
        key = min(room, key=lambda key: float(room[key].min()))
        joint = int(np.argmin(room[key]))
        if room[key][joint] < LEAST:
            told, unit = self.told("q" if key == "half" else key, joint), "m" if self.slides[joint] else "rad"
            raise ExcitationError(
                f"{told}, leaves it {2 * room[key][joint]:.1g} {unit} to move in; that shows nothing."
            )
        inside = np.inf if start is None else np.minimum(self.high - start, start - self.low)
        ends = np.flatnonzero((inside >= 0) & (inside < LEAST))  # outside is no start at all
        if len(ends):
            told, unit = self.told("q", ends[0]), "m" if self.slides[ends[0]] else "rad"
            raise ExcitationError(
                f"the start is at the end of {told}, and leaves no way to either side; start it at least "
                f"{LEAST:g} {unit} inside."
            )

    def told(self, key: str, joint: int) -> str:
        """'dq of joint 3, at most 2 rad/s'."""
        unit = UNITS[key]
        if self.slides[joint]:
            unit = unit.replace("rad", "m").replace("N m", "N")
        if key == "q":
            return f"q of joint {self.labels[joint]}, {self.low[joint]:.4g} to {self.high[joint]:.4g} {unit}"
        return f"{key} of joint {self.labels[joint]}, at most {getattr(self, key)[joint]:.4g} {unit}"


def bounds_of(robot: Robot, options: Sequence[str] = ()) -> Bounds:
    """The robot file's limits, narrowed or replaced by options. Raises ExcitationError."""
    labels = robot.joint_labels
    slides = tuple(robot.link(j).sigma == 1 for j in robot.moving)
    values: dict[str, list] = {key: [] for key in KEYS}
    stated: dict[str, set[int]] = {key: set() for key in KEYS}
    for k, row in enumerate(robot.moving):
        limits = robot.link(row).limits
        for key in KEYS:
            given = getattr(limits, key, None) if limits else None
            if given is not None:
                stated[key].add(k)
            values[key].append(given if given is not None else ASSUMED.get(key, (math.inf,) * 2)[slides[k]])
    beyond = []
    for text in options:
        key, joints, value = _option(text, labels)
        for k in joints:
            if k in stated[key] and _more(value, values[key][k]):
                beyond.append(f"--limit {text} allows joint {labels[k]} more than its robot file does")
            values[key][k] = value
            stated[key].add(k)
    missing = [key for key in ASSUMED if len(stated[key]) < len(labels)]
    low, high = np.array(values["q"], dtype=float).T
    rest = {key: np.array(values[key], dtype=float) for key in KEYS[1:]}
    return Bounds(labels, slides, low, high, **rest, assumed=tuple(missing), beyond=tuple(beyond))


def _more(value: Any, own: Any) -> bool:
    """Whether a limit, or one end of a range, is wider than another."""
    low, high, least, most = *np.broadcast_to(value, 2), *np.broadcast_to(own, 2)
    return bool(high > most or (low < least and least < most))


def _option(text: str, labels: Sequence[str]) -> tuple[str, list[int], object]:
    name, equals, value = text.partition("=")
    key, colon, label = name.strip().partition(":")
    if not equals or key not in KEYS:
        raise ExcitationError(
            f"--limit {text}: write KEY=VALUE or KEY:JOINT=VALUE with one of {', '.join(KEYS)}, "
            "for example dq:2=1.5 or q=-1..1."
        )
    if colon and label not in labels:
        raise ExcitationError(f"--limit {text}: there is no joint {label}; joints are {', '.join(labels)}.")
    try:
        numbers = [float(part) for part in value.split("..")]
    except ValueError:
        numbers = []
    if not all(map(math.isfinite, numbers)) or len(numbers) != (2 if key == "q" else 1):
        form = "two numbers, low..high" if key == "q" else "one number"
        raise ExcitationError(f"--limit {text}: give {form}, in {UNITS[key]}.")
    if key == "q" and numbers[0] >= numbers[1]:
        remedy = "swap them" if numbers[0] > numbers[1] else "a joint that may not move shows nothing"
        raise ExcitationError(f"--limit {text}: the lower limit is not below the upper one; {remedy}.")
    if key != "q" and numbers[0] <= 0:
        raise ExcitationError(f"--limit {text}: a joint that may not move shows nothing; give more than 0.")
    joints = [labels.index(label)] if colon else list(range(len(labels)))
    return key, joints, tuple(numbers) if key == "q" else numbers[0]
