"""The torque that a gear carries, as far as the model knows it.

Of the first joints, and of those parallel to the one before, Iam is regrouped into ZZ: tau_link of the
model still holds the rotor's Iam ddq, which the motor feels and the gear does not carry. And no file says
where a joint's own friction acts: before the teeth that the load presses (own 0), behind (own 1), or in part;
nor where its constant torque does (own_offset). An effect of the load finds these as shape parameters; Iam is
0, and not searched, where the model has one of its own. (Of a load friction of 0.3 an offset of which half is
behind the teeth left 1 %, which was told as friction by position.)
"""

from modelgen.effects.parameters import SIGNALS, NonlinearParameter

HIDDEN_ROTOR = NonlinearParameter("Iam", "kg m^2", 0.0, 1e3, (0.0,), beside="Iam")
OWN_FRICTION = NonlinearParameter("own", "-", 0.0, 1.0, (0.0, 1.0))
OWN_OFFSET = NonlinearParameter("own_offset", "-", 0.0, 1.0, (0.0, 1.0))
PASSED = SIGNALS.tau_link - HIDDEN_ROTOR.symbol * SIGNALS.ddq
CARRIED = PASSED + OWN_FRICTION.symbol * SIGNALS.friction + OWN_OFFSET.symbol * SIGNALS.offset
