"""The torque that a gear carries, where the rotor's inertia is not known apart from the link's.

Of the first joints, and of those parallel to the one before, Iam is regrouped into ZZ: tau_link of the
model still holds the rotor's Iam ddq, which the motor feels and the gear does not carry. An effect of the
load finds it as a shape parameter; 0 where the model has Iam of its own.
"""

from modelgen.effects.parameters import SIGNALS, NonlinearParameter

HIDDEN_ROTOR = NonlinearParameter("Iam", "kg m^2", 0.0, 1e3, (0.0,))
CARRIED = SIGNALS.tau_link - HIDDEN_ROTOR.symbol * SIGNALS.ddq
