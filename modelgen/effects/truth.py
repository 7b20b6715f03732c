"""What happens in one simulated recording, stage by stage, as effects may change it.

The gear's output follows the planned motion. In this order:

    link_motion    the link leaves it (free play, errors of the gear)
                   then the twin gives tau_link = M(q_l) ddq_l + H(q_l, dq_l) + tau_fl
    link_torque    what acts behind the gear is added to tau_link; a sensor sees that
    motor_motion   the motor is ahead of the link where the gear yields
                   then tau_m = tau_link + Iam ddq_m + tau_fm, tau_l = tau_link
    torque         what acts before the gear is added to tau_m (what a sensor alone sees, to tau_l)
    crosstalk, gain, lag, delay, encoder    what the recorder makes of it
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from modelgen.effects.motions import derivatives, smooth
from modelgen.effects.place import Place
from modelgen.geometry.robot import Robot

Array = np.ndarray
Stage = Literal[
    "link_motion", "link_torque", "motor_motion", "torque", "crosstalk", "gain", "lag", "delay", "encoder"
]
STAGES: tuple[Stage, ...] = (
    "link_motion", "link_torque", "motor_motion", "torque", "crosstalk", "gain", "lag", "delay", "encoder",
)  # fmt: skip
States = tuple[Array, Array, Array]  # q, dq, ddq, each (N, n)
GEAR_S = 0.006  # s: a damped gear passes on a torque's changes as through this Gaussian


@dataclass(frozen=True)
class Truth:
    """One recording in the making. Arrays (N, n), rad | m, N m | N; t (N,) s, uniform.

    `standard`: {"MX2": value} of the robot's bodies, a declared payload included in its link. `smooth_link`:
    the torque passed on without the step of dry friction behind the gear, which a yielding gear would not
    show.
    """

    stage: Stage
    robot: Robot
    recording: str
    t: Array
    motor: States
    link: States
    tau_link: Array
    smooth_link: Array
    torque: Mapping[str, Array]  # "motor", "sensor": what is recorded
    standard: Mapping[str, float] = field(default_factory=dict)
    encoder: Array | None = None  # (N, n) recorded positions, from the stage of that name on

    @property
    def dt(self) -> float:
        return float(self.t[1] - self.t[0])

    def state(self, place: Place) -> States:
        """Motion that an effect there goes with: the link's behind the gear, else the motor's."""
        return self.link if place.side in ("link", "sensor") else self.motor

    def with_torque(self, place: Place, added: Array) -> "Truth":
        """`added` (N,) to the place's joint, or (N, n) to all, on its side of the gear."""
        where = slice(None) if place.joint is None or added.ndim == 2 else place.joint

        def plus(tau: Array) -> Array:
            out = tau.copy()
            out[:, where] += added
            return out

        if self.stage in ("link_motion", "link_torque", "motor_motion"):
            return replace(self, tau_link=plus(self.tau_link), smooth_link=plus(self.smooth_link))
        side = "sensor" if place.side in ("sensor", "link") else "motor"
        return replace(self, torque={**self.torque, side: plus(self.torque[side])})

    def with_recorded(self, side: str, recorded: Array) -> "Truth":
        """The torque of a side replaced."""
        return replace(self, torque={**self.torque, side: recorded})

    def with_encoder(self, q: Array) -> "Truth":
        """The recorded positions replaced."""
        return replace(self, encoder=q)

    def moved(self, which: Literal["motor", "link"], joint: int, by: Array) -> "Truth":
        """Motor or link displaced by `by` (N,), with its rate and acceleration."""
        q, dq, ddq = (part.copy() for part in getattr(self, which))
        rate, acceleration = derivatives(by, self.dt)
        q[:, joint] += by
        dq[:, joint] += rate
        ddq[:, joint] += acceleration
        if which == "motor":
            return replace(self, motor=(q, dq, ddq))
        return replace(self, link=(q, dq, ddq))

    def smooth(self, signal: Array, sigma_s: float = GEAR_S) -> Array:
        """Zero-phase Gaussian of standard deviation sigma_s."""
        return smooth(signal, self.dt, sigma_s)


def played(
    truth: Truth,
    acting: Sequence[tuple[Any, Place, Mapping[str, float]]],
    link_torque: Callable[[States, bool], Array],
    drive_torque: Callable[[States], Array],
) -> Truth:
    """The recording from its planned motion to what is recorded, with the (effect, place, values) that act.

    `link_torque(link, dry)`: (N, n) of the bodies and the friction behind the gear, without the step of dry
    friction where `dry` is False; `drive_torque(motor)`: (N, n) of rotors and friction before the gear.
    """
    for stage in STAGES:
        if stage == "link_torque":
            rigid, smooth = link_torque(truth.link, True), link_torque(truth.link, False)
            truth = replace(truth, tau_link=rigid, smooth_link=smooth)
        elif stage == "torque":
            motor = truth.tau_link + drive_torque(truth.motor)
            truth = replace(truth, torque={"motor": motor, "sensor": truth.tau_link})
        elif stage == "encoder":
            truth = replace(truth, encoder=truth.motor[0])
        truth = replace(truth, stage=stage)
        for effect, place, values in acting:
            if place.recording in (None, truth.recording) and stage in effect.stages(place):
                truth = effect.simulate(truth, place, values)
    return truth
