"""Effects as columns of a model: "stribeck_friction:2" -> the columns of its linear parameters, in SymPy.

Behind the joint come options: source_joint=K for the other joint of a pair, side=link for a motor's effect
that acts behind the gear, where the torque sensor sees it, too.

A term may use the joint's own q, dq, ddq, sign, which the model has. What else it needs (time, the torque in
the gear, a state, the effect's nonlinear parameters) becomes a named extra input: t, tau_link2, z2, vs2.
"""

from __future__ import annotations

import difflib
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import sympy as sp

from modelgen.dynamics.models import Model
from modelgen.effects import Effect, catalogue
from modelgen.effects.parameters import STATES
from modelgen.errors import ModelgenError
from modelgen.geometry.robot import Robot

OWN = {"q": "q", "dq": "dq", "ddq": "ddq", "sign_dq": "sign"}
WHAT = {
    "motion": "changes the motion of the link",
    "measurement": "changes what is recorded",
    "load": "is a load on the whole arm",
}


class EffectNotSeenError(ModelgenError):
    """An effect acts in none of a model's torques."""


@dataclass(frozen=True, slots=True)
class EffectColumn:
    """One column: its parameter's name, the rows it stands in with their sign, its term, the extra inputs."""

    name: str
    channels: tuple[tuple[int, int], ...]  # (row, +1 or -1)
    term: sp.Expr
    extra_inputs: tuple[str, ...]


def effect_columns(
    robot: Robot, model: Model, requests: Sequence[str], taken: Collection[str]
) -> tuple[EffectColumn, ...]:
    """The columns of NAME:JOINT[:source_joint=K][:side=link] requests. `taken`: parameter names of the model.

    Raises ModelgenError where a request names no column of this model.
    """
    columns: list[EffectColumn] = []
    used = set(taken)
    owners: dict[str, tuple[str, int]] = {}  # extra input that only one effect uses -> its request
    times: dict[tuple[str, str], int] = {}  # how often an effect stands on a joint
    for request in requests:
        effect, k, source, channel = _parse(request, robot)
        families = _families(effect, channel, model, request)
        count = times[effect.name, k] = times.get((effect.name, k), 0) + 1
        for suffix, channels in families:
            for name, term in effect.terms.items():
                column, extra = _term(effect, term, k, source, (request, count), owners)
                label = f"{name}{suffix}{k}"
                if label in used and count == 1:
                    label = f"{label}_{effect.name}"
                if label in used or count > 1:  # two of a kind on one joint are two effects
                    label = f"{label}_{count}"
                if label in used:
                    label = f"{name}{suffix}{k}_{effect.name}_{count}"
                used.add(label)
                row = robot.joint_labels.index(k)
                rows = tuple((f * robot.n + row, sign) for f, sign in channels)
                columns.append(EffectColumn(label, rows, column, extra))
    return tuple(columns)


def _parse(request: str, robot: Robot) -> tuple[Effect, str, str | None, str]:
    """(effect, joint, source joint, channel that it acts in)."""
    name, _, rest = request.partition(":")
    joint, *options = rest.split(":")
    known = catalogue()
    if name not in known:
        close = difflib.get_close_matches(name, known, n=1, cutoff=0.4)
        hint = f"did you mean {close[0]}?" if close else f"effects are {', '.join(known)}."
        raise ModelgenError(f"--effect {request}: no effect is called {name!r}; {hint}")
    effect = known[name]
    if effect.kind != "column" or not effect.terms:
        raise ModelgenError(
            f"--effect {request}: {name} {WHAT[effect.kind]}, it is no column of a regressor; "
            "use it in ident simulate or ident diagnose"
        )
    labels = robot.joint_labels
    if joint not in labels:
        raise ModelgenError(f"--effect {request}: write {name}:JOINT with a joint of {', '.join(labels)}")
    source, channel = None, effect.channel
    for option in options:
        if effect.joints == "pair" and option.startswith("source_joint="):
            source = option.removeprefix("source_joint=")
        elif effect.channel == "motor" and option == "side=link":
            channel = "link"
        else:
            takes = ["source_joint=K"] * (effect.joints == "pair") + ["side=link"] * (
                effect.channel == "motor"
            )
            raise ModelgenError(
                f"--effect {request}: {option!r} is not understood; {name} takes "
                f"{' and '.join(takes) or 'no option'} here"
            )
    if effect.joints == "pair":
        here = labels.index(joint)
        source = source or (labels[here - 1 if here else here + 1] if len(labels) > 1 else joint)
        if source not in labels or source == joint:
            raise ModelgenError(
                f"--effect {request}: source_joint={source} is not another joint of the robot"
            )
    return effect, joint, source, channel


def _families(
    effect: Effect, channel: str, model: Model, request: str
) -> list[tuple[str, tuple[tuple[int, int], ...]]]:
    """[(suffix of the parameter's name, ((row family, sign), ...))]: one parameter for each."""
    place = {prefix: f for f, (prefix, _) in enumerate(model.families)}
    if channel == "any":
        suffix = {"tau_m": "m", "tau_l": "l"} if len(place) > 1 else {}
        return [(suffix.get(prefix, ""), ((f, 1),)) for prefix, f in place.items()]
    seen = {
        "motor": {"tau_m": 1, "tau_d": 1},
        "link": {"tau_m": 1, "tau_l": 1},
        "sensor": {"tau_l": 1, "tau_d": -1},
    }[channel]
    rows = tuple((f, seen[prefix]) for prefix, f in place.items() if prefix in seen)
    if not rows:
        raise EffectNotSeenError(
            f"--effect {request}: {effect.name} does not act in the torques of model {model.name}; "
            "choose another model"
        )
    return [("", rows)]


def _term(
    effect: Effect,
    term: sp.Expr,
    k: str,
    source: str | None,
    request: tuple[str, int],
    owners: dict[str, tuple[str, int]],
) -> tuple[sp.Expr, tuple[str, ...]]:
    """The term over the model's inputs, and the extra inputs it needs.

    A parameter or state whose name another effect of the joint has taken gets the effect's name, too; of the
    second effect of a kind on a joint (`request` counts them) it gets the number: wavenumber4_2.
    """

    def symbol(name: str) -> sp.Symbol:
        return sp.Symbol(name, real=True)

    replacements: dict[sp.Expr, sp.Expr] = {}
    extra: list[str] = []
    for found in sorted(term.free_symbols, key=str):
        name = str(found)
        if name in OWN:
            replacements[found] = symbol(OWN[name] + k)
        elif name in ("q_source", "dq_source", "ddq_source"):
            replacements[found] = symbol(name.removesuffix("_source") + str(source))
        elif name == "sign_sum":
            replacements[found] = sp.sign(symbol(f"dq{k}") + symbol(f"dq{source}"))
        else:
            label = name if name == "t" else f"tau{source}" if name == "tau_source" else f"{name}{k}"
            own = name in STATES or name in effect.nonlinear_names
            if own and request[1] > 1:
                label = f"{label}_{request[1]}"
            if own and owners.setdefault(label, request) != request:
                label = f"{label}_{effect.name}"
            extra.append(label)
            replacements[found] = symbol(label)
    return term.xreplace(replacements), tuple(extra)
