"""DIDIM: the parameters whose simulated loop asks for the torques that were measured, without any position.

    chi_(k+1) = argmin ||Y - W(q_s(chi_k)) chi||

Closed-loop output error on the motors' torque by Gauss and Newton. The simulated loop keeps its bandwidth
while chi changes, so its motion hardly depends on chi and W on that motion is the Jacobian (Gautier, Janot
and Vandanjon, IEEE Trans. Control Syst. Technol. 21, 2013). Noise of positions never enters; what does is
every difference between the simulated controller and the real one.
"""

from __future__ import annotations

import numpy as np

from ident.equations.observation import RecordingSystem, stack
from ident.errors import FitFailedError
from ident.estimation.estimators.simulated import Loop
from ident.estimation.least_squares import Estimate, channel_sigma, weighted_least_squares
from ident.progress import Progress, silent

TURNS = 10
STILL = 0.2  # standard deviations: a smaller step is none


def didim(
    loop: Loop, first: Estimate, progress: Progress = silent
) -> tuple[Estimate, tuple[RecordingSystem, ...]]:
    """From a first estimate -> the estimate and the equations of its simulated motion.

    Raises FitFailedError where the loop cannot be simulated or the search does not come to rest.
    """
    estimate = first
    for _ in range(TURNS):
        systems = loop.systems(estimate.chi, progress)
        factors, before = stack(systems), estimate.chi
        estimate = weighted_least_squares(factors, channel_sigma(factors), first.parameters, first.active)
        if np.all(np.abs(estimate.chi - before) <= STILL * np.maximum(estimate.std, 1e-300)):
            return estimate, systems
    raise FitFailedError(
        "estimator: didim did not come to rest: the simulated loop is not the robot's; write its "
        "controller's own kp and kd, or estimator: iv"
    )
