"""The motion of one joint acts on another through a shared drive, as in the wrists of small robots."""

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter


class JointCoupling(Effect):
    """The motion of one joint acts on another through a shared drive, as in the wrists of small robots."""

    name = "joint_coupling"
    summary = "the drive of another joint acts on this one: its rate, its acceleration, its friction"
    signature = "the residual of one joint follows the rate or acceleration of another, also when it stands"
    source = "Gautier, Janot, Vandanjon, IEEE TCST 21(2), 2013 (coupled wrist of the Staubli TX40)"
    remedy = "declare the drives that a gearbox couples (`coupled_drives`), or add its term to the model"
    terms = {"Fv": SIGNALS.dq_source, "Ia": SIGNALS.ddq_source, "Fc": SIGNALS.sign_sum}
    linear = (
        LinearParameter("Fv", "N m s/rad", -100.0, 100.0, optional=True),
        LinearParameter("Ia", "kg m^2", -20.0, 20.0, optional=True),
        LinearParameter("Fc", "N m", 0.0, 50.0, "positive", optional=True),  # of the sum of both rates
    )
    joints = "pair"
    typical = {"Fv": 2.0, "Ia": 0.2, "Fc": 0.0}

    def variants(self) -> tuple[tuple[str, ...], ...]:
        """Rate and acceleration alone or together; its dry friction only beside both."""
        return (("Fv",), ("Ia",), ("Fv", "Ia"), ("Fv", "Ia", "Fc"))


EFFECT = JointCoupling()
