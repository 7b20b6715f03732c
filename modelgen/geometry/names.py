"""What the names of torques and parameters say, decided in this one place: kind, joint, side, unit.

A torque is a :class:`Channel`, of a joint (counted from 0 among the moving ones) and a side of its gear:

    tau_m3  motor      tau_l3  sensor (behind the gear)      tau_d3  drive (their difference, model D)

A parameter's name is the paper's (eq. 6): the kind, then the number of the row (bodies) or of the joint
variable (drives), or a payload's label, then R where others were regrouped into it: ZZ2, Iam3, MXL, MY2R.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal

from modelgen.errors import ModelgenError

ChannelSide = Literal["motor", "sensor", "drive"]

PREFIXES: dict[ChannelSide, str] = {"motor": "tau_m", "sensor": "tau_l", "drive": "tau_d"}
INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
GRAVITY = ("MX", "MY", "MZ", "M")  # what a body at rest weighs with
# kind -> (unit on a revolute joint, sides of the gear: "m" before it, "l" behind it, "" a body)
_KINDS: dict[str, tuple[str, str]] = {
    **dict.fromkeys(("XX", "XY", "XZ", "YY", "YZ", "ZZ"), ("kg m^2", "")),
    **dict.fromkeys(("MX", "MY", "MZ"), ("kg m", "")),
    "M": ("kg", ""),
    "Iam": ("kg m^2", "m"),
    "Iac": ("kg m^2", "m"),  # of a drive that a gearbox couples, `coupled_drives`
    "Ial": ("kg m^2", "l"),  # what turns between gear and sensor, `link_inertia`
    "Fvm": ("N m s/rad", "m"),
    "Fvl": ("N m s/rad", "l"),
    "Fvc": ("N m s/rad", "m"),
    "Fcm": ("N m", "m"),
    "Fcl": ("N m", "l"),
    "Fcc": ("N m", "m"),
    "Offm": ("N m", "m"),
    "Offl": ("N m", "l"),
    "g": ("N m/unit", "m"),  # an unknown drive gain
}
_KIND = re.compile("|".join(sorted(_KINDS, key=len, reverse=True)))
_CHANNEL = re.compile(r"(tau_[mld])(.+)")
_UNITS = re.compile(r"N m|kg m\^2|rad")


class ChannelNameError(ModelgenError):
    """A name of a torque that a robot does not have."""


@dataclass(frozen=True, slots=True, order=True)
class Channel:
    """One measured torque: `joint` counts the moving joints from 0."""

    joint: int
    side: ChannelSide

    @classmethod
    def of(cls, name: str, joint_labels: Sequence[str]) -> Channel:
        """Channel of "tau_m3" on a robot whose joints are labelled "1", "2", ...; raises ModelgenError."""
        match = _CHANNEL.fullmatch(name)
        if match is None or match[2] not in joint_labels:
            raise ChannelNameError(
                f"{name!r} is no torque of this robot; write tau_m, tau_l or tau_d and a joint of "
                f"{', '.join(joint_labels)}"
            )
        side = next(side for side, prefix in PREFIXES.items() if prefix == match[1])
        return cls(list(joint_labels).index(match[2]), side)

    def name(self, joint_labels: Sequence[str]) -> str:
        """ "tau_m3"."""
        return f"{PREFIXES[self.side]}{joint_labels[self.joint]}"


@dataclass(frozen=True, slots=True)
class ParameterName:
    """A parameter's name, read. `label`: number of row or joint variable, or a payload's label."""

    kind: str
    label: str
    payload: bool
    regrouped: bool

    @classmethod
    def of(cls, name: str, payloads: Collection[str] = ()) -> ParameterName | None:
        """Read "ZZ2R", "Iam3", "ML"; None for a name that is not the paper's.

        A label that is no number is a payload's; where `payloads` are given, it has to be one of them.
        """
        match = _KIND.match(name)
        if match is None:
            return None
        kind, rest = match[0], name[match.end() :]
        regrouped = rest.endswith("R") and rest not in payloads
        label = rest[:-1] if regrouped else rest
        payload = not label.isdigit()
        if not label or (payload and (kind not in INERTIAL or (payloads and label not in payloads))):
            return None
        return cls(kind, label, payload, regrouped)

    @property
    def standard(self) -> str:
        """The standard parameter whose column it keeps: ZZ2 of ZZ2R."""
        return self.kind + self.label

    @property
    def side(self) -> ChannelSide | None:
        """Side of the gear that it acts on; None for a body's, which all torques see."""
        return {"m": "motor", "l": "sensor", "": None}[_KINDS[self.kind][1]]  # type: ignore[return-value]

    @property
    def of_body(self) -> bool:
        """True for the ten inertial parameters of a link or payload."""
        return self.kind in INERTIAL

    def unit(self, prismatic: Collection[str] = ()) -> str:
        """SI unit; joints listed in `prismatic` (labels) have N where others have N m, and m for rad."""
        unit = _KINDS[self.kind][0]
        return unit if self.of_body else joint_unit(unit, self.label in prismatic)


def unit_of(name: str, prismatic: Collection[str] = ()) -> str:
    """kg m^2 of ZZ2R, kg of ML, ...; empty for names that are not the paper's."""
    parsed = ParameterName.of(name)
    return parsed.unit(prismatic) if parsed else ""


def joint_unit(unit: str, prismatic: bool, source_prismatic: bool | None = None) -> str:
    """A unit that is written for a revolute joint, as it is on this joint.

    "N m" is the joint's torque (N where it slides) and "rad" its position (m); of a pair of joints "rad" is
    of the source. "kg m^2", torque per acceleration, becomes kg m or kg. "N m/rad" -> "N/m",
    "N m s/rad" -> "N s/m", "rad/(N m)" -> "m/N", "1/rad" -> "1/m".
    """
    source = prismatic if source_prismatic is None else source_prismatic
    mass = {0: "kg m^2", 1: "kg m", 2: "kg"}[int(prismatic) + int(source)]
    table = {"N m": "N" if prismatic else "N m", "rad": "m" if source else "rad", "kg m^2": mass}
    return _UNITS.sub(lambda found: table[found[0]], unit).replace("(N)", "N")
