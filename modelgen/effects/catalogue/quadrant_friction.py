"""Load-dependent friction that differs when the motor drives the load and when the load drives the motor."""

import sympy as sp

from modelgen.effects.carried import CARRIED, HIDDEN_ROTOR, OWN_FRICTION, OWN_OFFSET
from modelgen.effects.effect import SIGNALS, Effect, LinearParameter

load = sp.Abs(CARRIED) * SIGNALS.sign_dq
quadrant = sp.sign(CARRIED) * SIGNALS.sign_dq  # +1 the motor drives the load, -1 the load drives


class QuadrantFriction(Effect):
    """Dry friction mu |tau_link| sign(dq), with mu_drive where load torque and rate agree in sign and
    mu_brake where they do not: a gear's efficiency in its two directions of power.

    Equal, they are `load_dependent_friction`; their difference is a multiple of tau_link itself while the
    joint moves, so a wrong `drive_gain_error` looks alike.
    """

    name = "quadrant_friction"
    summary = "friction under load differs between driving and braking"
    signature = "steps at reversals that follow |tau_link|, higher in two of the four quadrants of rate, load"
    source = (
        "Hamon, Gautier, Garrec, New dry friction model with load- and velocity-dependence and dynamic "
        "identification of multi-DOF robots, ICRA 2011"
    )
    contains = ("load_dependent_friction",)
    remedy = "add its term to the friction model, or state the gear's efficiency both ways"
    terms = {"mu_drive": load * (1 + quadrant) / 2, "mu_brake": load * (1 - quadrant) / 2}
    linear = (
        LinearParameter("mu_drive", "-", 0.0, 0.6, "positive"),
        LinearParameter("mu_brake", "-", 0.0, 0.6, "positive"),
    )
    nonlinear = (HIDDEN_ROTOR, OWN_FRICTION, OWN_OFFSET)
    typical = {"mu_drive": 0.12, "mu_brake": 0.05, "Iam": 0.0, "own": 0.0, "own_offset": 0.0}
    common = False


EFFECT = QuadrantFriction()
