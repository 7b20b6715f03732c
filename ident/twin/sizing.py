"""How large a hidden effect is when the user does not say: large enough to be clearly there, not gross.

The part of the effect's torque that the study's own model cannot absorb is made a stated share of the joint's
torque, see yardstick.py. The share is about what the joint's error rises to, noise apart.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ident.twin.requests import EffectRequest
from ident.twin.trajectories import Motion, reach
from ident.twin.twin import ActiveEffect, SimulationError, Twin, placed
from ident.twin.yardstick import Yardstick
from modelgen.effects.place import Layout, Place
from modelgen.effects.scaling import metres_per_radian, radian_power
from modelgen.geometry.robot import Robot

EXACT = 1e-9  # of a value that a user gives: how it is rounded


def activate(request: EffectRequest, twin: Twin, model: str, motions: Mapping[str, Motion]) -> ActiveEffect:
    """Give a request all its numbers. The user's stand; the effect's size is set if he did not fix it.

    `motions`: the runs that the study fits, by label.
    """
    effect, share = request.effect, request.effect.share
    place = placed(request, twin.robot, model)  # refuses what the study could not show
    values, context = _usual(request, place, twin, model)
    active = _active(request, place, values, context)
    yardstick = Yardstick(twin, model, motions)
    _refuse_impossible(active, twin.robot)
    active = replace(active, visible=yardstick(active))
    if set(request.values) & {*effect.size_names, *effect.size_aliases} or not effect.size_names:
        return active
    if not effect.proportional:  # search
        trials = [
            _active(
                request,
                place,
                {**values, **{size: _rounded(values[size] * factor) for size in effect.size_names}},
                context,
            )
            for factor in np.geomspace(1 / 30, 30, 15)
        ]
        trials = [trial for trial in trials if _plausible(trial)] or [active]
        seen = [yardstick(trial) for trial in trials]
        best = int(np.argmin(np.abs(np.log(np.maximum(seen, 1e-9) / share))))
        return replace(trials[best], visible=seen[best])
    for _ in range(3):  # once where the torque is proportional to the parameters
        active = _scaled(active, share / max(active.visible, 1e-9), values, context)
        active = replace(active, visible=yardstick(active))
        if abs(active.visible / share - 1) < 0.15:
            break
    return active


def _scaled(
    active: ActiveEffect, factor: float, values: dict[str, float], context: Mapping[str, float]
) -> ActiveEffect:
    """All linear parameters times factor, but none beyond what is plausible; sizes told in three digits."""
    effect = active.request.effect
    for p in effect.linear:
        value, bound = abs(active.linear[p.name]), max(abs(p.low), abs(p.high))
        if value * factor > bound:
            factor = bound / value
    linear = {name: value * factor for name, value in active.linear.items()}
    sizes = _with_linear(active, linear, context).reported
    rounded = {name: _rounded(sizes[name]) for name in effect.size_names}
    return _active(active.request, active.place, {**values, **rounded}, context)


def _usual(
    request: EffectRequest, place: Place, twin: Twin, model: str
) -> tuple[dict[str, float], dict[str, float]]:
    """Reported values (the user's, else the joint's own, else usual ones) and what they are relative to."""
    effect = request.effect
    space = reach(twin.robot)
    layout = Layout(twin.robot, (), travel=tuple((2 * space.half).tolist()))
    scale, own = metres_per_radian(layout.with_travel(place)), {}
    if request.joint is not None:
        label = twin.robot.joint_labels[request.joint]
        here, there = ("l", "m") if model == "B" else ("m", "l")  # side of the gear that is recorded
        own = {
            name: twin.standard.get(f"{name}{here}{label}") or twin.standard.get(f"{name}{there}{label}", 0.0)
            for name in ("Fc", "Fv")
        }
        if model == "A":  # which shows the sum of both sides' friction
            own = {name: sum(twin.standard.get(f"{name}{side}{label}", 0.0) for side in "ml") for name in own}
    gravity = dict(zip(("g0x", "g0y", "g0z"), (float(twin.robot.value(x)) for x in twin.robot.gravity)))
    context = {name: gravity.get(name, own.get(name) or 1.0) for name in effect.context}
    values = effect.usual(request.values, own)
    for quantity in effect.quantities:
        if quantity.name in values and quantity.name not in request.values and not quantity.angle:
            values[quantity.name] *= scale ** radian_power(quantity.unit)
    return values, context


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def _plausible(active: ActiveEffect) -> bool:
    effect = active.request.effect
    return all(p.low <= active.linear[p.name] <= p.high for p in effect.linear) and all(
        p.low <= active.nonlinear[p.name] <= p.high for p in effect.nonlinear
    )


def _active(
    request: EffectRequest, place: Place, values: Mapping[str, float], context: Mapping[str, float]
) -> ActiveEffect:
    linear, nonlinear = request.effect.values_from_reported(values, context)
    return _with_linear(ActiveEffect(request, place, linear, nonlinear, {}), linear, context)


def _refuse_impossible(active: ActiveEffect, robot: Robot) -> None:
    """Raise SimulationError for what physics does not allow: negative friction, a wavelength of zero, values
    that do not go together."""
    effect, values = active.request.effect, {**active.linear, **active.nonlinear}
    known = np.diag([(EXACT * values[name]) ** 2 for name in effect.parameters_of(active.place)])
    apart = effect.beyond(values, known, active.place, robot) > 1
    reason = effect.physical(values) or (effect.agreement if apart else "")
    if reason:
        given = ", ".join(f"{key}={value:g}" for key, value in active.request.values.items())
        raise SimulationError(f"{effect.name} with {given} cannot be: {reason}; change it.")


def _with_linear(
    active: ActiveEffect, linear: Mapping[str, float], context: Mapping[str, float]
) -> ActiveEffect:
    report = active.request.effect.report({**linear, **active.nonlinear}, None, context)
    reported = {name: float(f"{entry['value']:.12g}") for name, entry in report.items()}
    return replace(active, linear=linear, reported=reported)
