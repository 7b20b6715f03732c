"""Which numbers of a robot no robot has: an angle in degrees, a length in mm, gravity in mm/s^2 or in g.

Each function returns the problem with its remedy as the end of a sentence, or "". A number is refused where
the other unit is certain (nobody writes an angle of 14 turns); what is merely odd is a remark.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

TURN = 2 * math.pi * (1 + 1e-9)
LONGEST = 50.0  # m, of one row: cranes end there, and a robot of 5 cm in mm begins there
TURNS_OF_A_JOINT = 8 * math.pi  # rad; wrists with cables inside do less
FASTEST = {0: 400.0, 1: 100.0}  # rad/s, m/s
EARTH = (9.75, 9.84)  # m/s^2, equator to pole and mountain to sea
HEAVIEST = 30.0  # m/s^2: more than Jupiter
LIGHTEST = 1.2  # m/s^2: less than the moon; 1 is meant in g


def angle(value: float) -> str:
    """A twist or a constant of theta, in rad."""
    if abs(value) <= TURN:
        return ""
    turns = abs(value) / (2 * math.pi)
    meant = Fraction(value).limit_denominator(1000) / 180
    p, q = meant.numerator, meant.denominator
    text = ("-" if p < 0 else "") + ("pi" if abs(p) == 1 else f"{abs(p)}*pi") + (f"/{q}" if q > 1 else "")
    hint = f"; {text}?" if abs(value) <= 3600 and q <= 180 else ""
    return f"is {value:.6g} rad, {turns:.3g} turns{hint} Angles are in rad within one turn"


def length(value: float) -> str:
    """A d, r or b, in m."""
    if abs(value) <= LONGEST:
        return ""
    return f"is {value:.6g} m, longer than any robot's link; {value / 1000:.6g}? Lengths are in m"


def gravity(vector: Sequence[float]) -> str:
    """Gravity in the base frame, in m/s^2; zero is a robot in orbit, or one whose axes are all vertical."""
    size = math.hypot(*vector)
    if size == 0 or LIGHTEST <= size <= HEAVIEST:
        return ""
    return f"has the size {size:.6g} m/s^2, Earth's is 9.81; write for example [0, 0, -9.81]"


def odd_gravity(vector: Sequence[float]) -> str:
    """What is possible, but seldom meant."""
    size = math.hypot(*vector)
    if size == 0:
        return "gravity is zero, as in orbit; write [0, 0, -9.81] if the robot stands on Earth"
    if not EARTH[0] <= size <= EARTH[1]:
        return f"gravity has the size {size:.4g} m/s^2, not Earth's 9.81; correct it if that was meant"
    return ""


def limits(sigma: int, q: Sequence[float] | None, dq: float | None) -> str:
    """Limits of a joint: rad and rad/s, or m and m/s on a prismatic one."""
    reach = max(map(abs, q)) if q else 0.0
    if sigma == 0 and reach > TURNS_OF_A_JOINT:
        return f"reaches {reach:.6g} rad, {reach / (2 * math.pi):.3g} turns; write rad, not degrees"
    if sigma == 1 and reach > LONGEST:
        return f"reaches {reach:.6g} m; write m, not mm"
    if dq is not None and sigma in FASTEST and dq > FASTEST[sigma]:
        unit = "m/s, not mm/s" if sigma else "rad/s, not degrees/s"
        return f"allows the speed {dq:.6g}; write {unit}"
    return ""
