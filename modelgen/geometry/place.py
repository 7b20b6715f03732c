"""Where an effect stands and what it may see there: places, stretches of motion, and the model being
fitted."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from modelgen.geometry.names import Channel

if TYPE_CHECKING:  # a robot's constants are SymPy's, which a fit without effects does not need
    from modelgen.geometry.robot import Robot

Array = np.ndarray
PlaceSide = Literal["motor", "link", "sensor"]

# side of the gear -> sign with which each measured torque shows what happens there
SEEN: Mapping[str, Mapping[str, int]] = {
    "motor": {"motor": 1, "drive": 1},
    "link": {"motor": 1, "sensor": 1},
    "sensor": {"sensor": 1, "drive": -1},
}
STEPS = (1e-5, 1.0, 1.0)  # of q, dq and ddq, in which derivatives are taken
USUAL_SLIDE = 0.6  # m of travel, where it is not known
REVOLUTE_TRAVEL = 4.8  # rad; a slide's travel counts as this much of a revolute joint's


@dataclass(frozen=True)
class Place:
    """Where one effect stands.

    joint, source   moving joints from 0; None: the whole robot (source: no pair)
    side            "motor" before the gear, "link" behind it (motor and sensor both show it), "sensor" what
    the
                    sensor alone records; None: every torque
    recording       label of the only recording it acts in; start, stop: s since that recording's first sample
    link            row of the robot file, from 1, that a body is fixed to or a force acts on
    parts           linear parameters in use; empty: those that are not optional
    drive           kinds of drive parameters ("Iam") that the model has at the joint
    travel          range of the joint, and of the source, in the recordings [rad | m]; None: not known
    """

    joint: int | None = None
    source: int | None = None
    side: PlaceSide | None = None
    recording: str | None = None
    start: float | None = None
    stop: float | None = None
    link: int | None = None
    parts: tuple[str, ...] = ()
    prismatic: bool = field(default=False, compare=False)  # the joint slides: N and m for N m and rad
    source_prismatic: bool | None = field(default=None, compare=False)
    drive: frozenset[str] = field(default=frozenset(), compare=False)
    travel: float | None = field(default=None, compare=False)
    source_travel: float | None = field(default=None, compare=False)

    def rows(self, channels: Sequence[Channel]) -> dict[int, int]:
        """{channel number: +1 or -1} of the torques of its joint (of all joints) that show it."""
        seen = SEEN[self.side] if self.side else {c.side: 1 for c in channels}
        return {
            number: seen[c.side]
            for number, c in enumerate(channels)
            if c.side in seen and self.joint in (None, c.joint)
        }

    @property
    def comes_and_goes(self) -> bool:
        """Whether it acts in a part of its recording alone."""
        return self.start is not None or self.stop is not None

    def gate(self, recording: str, t: Array) -> Array:
        """(N,) 1 inside its recording and window (start <= t < stop), else 0; t in s since the first
        sample."""
        inside = np.full(len(t), self.recording in (None, recording))
        if self.start is not None:
            inside &= t >= self.start
        if self.stop is not None:
            inside &= t < self.stop
        return inside.astype(float)


@dataclass(frozen=True)
class Layout:
    """What there is to place effects on. `travel`: range of each joint [rad | m]; `drives` and `left_out`:
    kinds of drive parameters that the model has, and that a study took out of it, joint by joint (empty: not
    known)."""

    robot: Robot
    channels: tuple[Channel, ...]
    recordings: tuple[str, ...] = ()
    travel: tuple[float, ...] = ()
    drives: tuple[frozenset[str], ...] = ()
    left_out: tuple[frozenset[str], ...] = ()

    @property
    def n(self) -> int:
        return self.robot.n

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Per moving joint, whether it slides."""
        return tuple(self.robot.link(j).sigma == 1 for j in self.robot.moving)

    @property
    def sides(self) -> frozenset[str]:
        return frozenset(c.side for c in self.channels)

    def covers(self, joint: int | None, kinds: Collection[str]) -> bool:
        """Whether the model has parameters of these kinds at a joint, as themselves or in a sum."""
        if not kinds or joint is None or not self.left_out:
            return False
        return self.left_out[joint].isdisjoint(kinds)

    def place(self, joint: int | None = None, source: int | None = None, **more: object) -> Place:
        """A place that knows whether its joints slide and how far, and what the model has there."""
        slides = self.prismatic
        return self.with_travel(
            Place(
                joint,
                source,
                prismatic=joint is not None and slides[joint],
                source_prismatic=None if source is None else slides[source],
                drive=self.drives[joint] if self.drives and joint is not None else frozenset(),
                **more,  # type: ignore[arg-type]
            )
        )

    def with_travel(self, place: Place) -> Place:
        """The place with the ranges of its joints."""
        own, source = (
            self.travel[j] if self.travel and j is not None else None for j in (place.joint, place.source)
        )
        return replace(place, travel=own, source_travel=source)


@dataclass(frozen=True)
class Motion:
    """One uninterrupted, uniformly sampled stretch of a recording, or a block of one.

    t (N,) s since the recording's first sample; q, dq, ddq, sign_dq (N, n), rad or m, sign_dq the sign of dq
    or its smoothed form; measured (N, C) N m or N as recorded, in the model's channels, or None; path (N, n)
    positions along which memories go on, where these are not q; before (k, n) the same on the way to the
    first sample, or None.
    """

    recording: str
    payload: str | None
    t: Array
    q: Array
    dq: Array
    ddq: Array
    sign_dq: Array
    measured: Array | None
    rate_hz: float
    before: Array | None = None
    path: Array | None = None

    def way(self, joint: int) -> dict[str, Array]:
        """What a joint's states go along: t, q (N,), and `before` (k,) where it is known."""
        path = self.q if self.path is None else self.path
        way = {"t": self.t, "q": path[:, joint]}
        return way if self.before is None else way | {"before": self.before[:, joint]}

    def only(self, rows: slice) -> Motion:
        """These samples of it alone; where they are all, itself: what was asked about it is known."""
        if rows.indices(len(self.t)) == (0, len(self.t), 1):
            return self
        parts = {name: getattr(self, name)[rows] for name in ("t", "q", "dq", "ddq", "sign_dq")}
        before = None if rows.start else self.before
        measured, path = (x if x is None else x[rows] for x in (self.measured, self.path))
        return replace(self, **parts, measured=measured, before=before, path=path)


def torque_slopes(torque: Callable[[Motion, Array, Array, Array], Array], motion: Motion, j: int) -> Array:
    """(3, N, C) derivatives of `torque(motion, q, dq, ddq)` by a joint's q, dq and ddq, by central
    differences: exact for a rigid arm in dq (quadratic) and ddq (linear), to 1e-10 of the torque in q."""
    out = []
    for k, h in enumerate(STEPS):
        ends = []
        for step in (h, -h):
            state = [motion.q, motion.dq, motion.ddq]
            state[k] = state[k].copy()
            state[k][:, j] += step
            ends.append(torque(motion, *state))
        out.append((ends[0] - ends[1]) / (2 * h))
    return np.stack(out)


class Model(Protocol):
    """What an effect may ask of the model that is being fitted, at its current estimate."""

    @property
    def robot(self) -> Robot:
        """With the study's gravity."""
        ...

    @property
    def channels(self) -> tuple[Channel, ...]: ...

    @property
    def parameters(self) -> tuple[str, ...]:
        """b names of the rigid model."""
        ...

    def torque(
        self, motion: Motion, q: Array | None = None, dq: Array | None = None, ddq: Array | None = None
    ) -> Array:
        """(N, C) rigid torque, friction included, found effects not; at another motion where one is given.

        `sign_dq` stays that of `motion` then.
        """
        ...

    def slopes(self, motion: Motion, joint: int) -> Array:
        """(3, N, C) derivatives of that torque by the joint's q, dq and ddq."""
        ...

    def once(self, kind: tuple[Hashable, ...], motion: Motion, make: Callable[[], Array]) -> Array:
        """make(), which `kind` and the motion determine; a model that is asked often keeps it."""
        ...

    def total(self, motion: Motion) -> Array:
        """(N, C) torque with the effects found so far, but for those of kind "measurement": what really acts,
        before the recorder."""
        ...

    def link_torque(self, motion: Motion) -> Array:
        """(N, n) torque that the gears pass on to the links: no rotor, no friction before the gear."""
        ...

    def regressor(self, motion: Motion) -> Array:
        """(N, C, b) columns of `parameters`. Asked only by effects with `changes_model`."""
        ...

    def bodies(self) -> Mapping[str, float]:
        """{"MX2": value, ...} ten inertial parameters a row; a base parameter under the name of the standard
        parameter whose column it keeps. A declared payload is not in it."""
        ...

    def drive_inertia(self, joint: int) -> float:
        """kg m^2 of rotor and gear at the joint that `torque` holds, as Iam or inside a regrouped
        parameter."""
        ...

    def number(self, kind: str, joint: int) -> float | None:
        """Value of the drive parameter of this kind ("Fvm", "Fcl", "Iam") at a joint (from 0), None: none."""
        ...
