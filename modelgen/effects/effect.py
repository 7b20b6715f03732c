"""One physical effect as a class: what it adds to a torque, where it may stand, how it is found and told.

Generator, simulator, fit and diagnosis read this one definition; no module outside this folder knows an
effect by name. A term is a SymPy expression over the signals of a joint (:class:`Signals`) and the effect's
nonlinear (shape) parameters; the torque it adds is

    sum over linear parameters p of  p * term_p(signals; nonlinear parameters)      [N m | N]

Expressions use only + - * / exp sin cos tanh sign abs sqrt pow, so that CasADi can turn them into C.
`sign_dq` is a signal of its own: whoever evaluates a column passes the same (smoothed) sign as to the model.

Kinds of effect, and what their terms mean:
    column       the term is added to a torque
    motion       the term is the change of the link's position, q_link = q + sum p term_p  [rad]; a class
                 may make torques of some in its `columns`, as of a backlash's crossing
    measurement  the term is added to what is recorded; `tau` is the undisturbed channel, `dtau` its rate
    load         the term is a dimensionless gate; :mod:`modelgen.effects.loads` makes torques of it
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from modelgen.effects.definition import ChannelKind, EffectError
from modelgen.effects.expressions import Expressions
from modelgen.effects.memory import Memory
from modelgen.effects.parameters import SIGNALS, LinearParameter, NonlinearParameter, Quantity, Signals, State
from modelgen.effects.place import Layout, Model, Motion, Place, PlaceSide
from modelgen.effects.scaling import metres_per_radian, radian_power, sign_of_sum
from modelgen.effects.telling import Report, Telling
from modelgen.effects.truth import Stage, Truth

__all__ = [
    "SIGNALS",
    "ChannelKind",
    "Effect",
    "EffectError",
    "Layout",
    "LinearParameter",
    "Model",
    "Motion",
    "NonlinearParameter",
    "Place",
    "Quantity",
    "Report",
    "Signals",
    "State",
    "Truth",
]

Array = np.ndarray
Columns = dict[int, Array]  # channel number -> (N, p)


class Effect(Expressions, Telling):
    """One physical effect. A subclass states the attributes and overrides the methods that differ.

    `Effect(name=..., terms=...)` makes one without a class, for a plain term.
    """

    # ---- where it stands, and its columns there

    def places(self, layout: Layout) -> Iterable[Place]:
        """Every place where it may stand: each joint (and source), each side of the gear that is measured."""
        for side in self.sides(layout):
            for joint in range(layout.n):
                sources = [s for s in range(layout.n) if s != joint] if self.joints == "pair" else [None]
                for source in sources:
                    for parts in self.variants():
                        place = layout.place(joint, source, side=side, parts=parts)
                        if place.rows(layout.channels):
                            yield place

    def sides(self, layout: Layout) -> tuple[PlaceSide, ...]:
        """Sides of the gear where it may act and that the channels can tell apart."""
        measured = layout.sides
        if "tau_link" in self.needs and not measured & {"motor", "sensor"}:
            return ()  # the torque behind the gear is nowhere seen
        if self.channel == "sensor":
            return ("sensor",) if "sensor" in measured else ()
        if self.channel == "link":
            return ("link",) if measured & {"motor", "sensor"} else ()
        if "motor" in measured and "sensor" in measured:
            return ("motor", "sensor") if self.channel == "any" else ("motor", "link")
        return ("motor",) if measured & {"motor", "drive"} else ("link",)

    def variants(self) -> tuple[tuple[str, ...], ...]:
        """Sets of linear parameters that may stand alone; () is all that are not optional."""
        return ((),)

    @property
    def needed(self) -> frozenset[str]:
        """Linear parameters without which it would be another effect."""
        sets = [set(parts) for parts in self.variants() if parts]
        return frozenset(p.name for p in self.linear if p.own and all(p.name in parts for parts in sets))

    def parameters_of(self, place: Place) -> tuple[str, ...]:
        """Linear parameters in use at a place, in the order of the columns."""
        return place.parts or tuple(p.name for p in self.linear if not p.optional)

    def starts(
        self,
        place: Place,
        motions: Sequence[Motion],
        residuals: Sequence[Array],
        model: Model | None = None,
    ) -> Sequence[dict[str, float]]:
        """Starting shape parameters, the product of the grids; residuals: one (N,) a motion, of the place's
        first channel, NaN where it does not count."""
        scale = metres_per_radian(place, motions)
        points: list[dict[str, float]] = [{}]
        for p in self.nonlinear:
            factor = 1.0 if p.angle else scale ** radian_power(p.unit)
            points = [{**point, p.name: value * factor} for point in points for value in p.grid]
        return points

    def signals(
        self, place: Place, motion: Motion, model: Model, theta: Mapping[str, float], memory: Memory | None
    ) -> dict[str, Array]:
        """(N,) signals that the terms use at a place."""
        j, source, needs = place.joint, place.source, self.needs
        out = {"t": motion.t}
        if j is not None:
            out |= {"q": motion.q[:, j], "dq": motion.dq[:, j], "ddq": motion.ddq[:, j]}
            out["sign_dq"] = motion.sign_dq[:, j]
            if "tau_link" in needs:
                out["tau_link"] = model.link_torque(motion)[:, j]
            if "friction" in needs:
                end = "l" if place.side == "link" else "m"
                viscous, dry, offset = (model.number(kind + end, j) or 0.0 for kind in ("Fv", "Fc", "Off"))
                out["friction"] = viscous * motion.dq[:, j] + dry * motion.sign_dq[:, j]
                out["offset"] = np.full(len(motion.t), offset)
                if end == "l":  # what a share of the link's friction is added to is the bodies' torque
                    out["tau_link"] = out["tau_link"] - out["friction"] - offset
        if source is not None and j is not None:
            out |= {"q_source": motion.q[:, source], "dq_source": motion.dq[:, source]}
            out["ddq_source"] = motion.ddq[:, source]
            if "sign_sum" in needs:
                out["sign_sum"] = sign_of_sum(motion, j, source)
        way = {} if j is None else motion.way(j)
        return out | self.states(out | way, theta, motion.recording, memory, place)

    def columns(
        self,
        place: Place,
        theta: Mapping[str, float],
        size: Array | None,
        motion: Motion,
        model: Model,
        memory: Memory | None = None,
    ) -> Columns:
        """{channel number: (N, p)} unfiltered columns of `parameters_of(place)`.

        `size`: last linear coefficients (p,), None or 0 for the tangent at nothing; only effects that are not
        linear in their size use it: their columns are secants, columns @ size is the effect. `memory`: one
        dict a pass, for effects that go on from block to block.
        """
        theta = self.complete(theta)
        values = self.numpy_columns(self.signals(place, motion, model, theta, memory), theta)
        use = [self.linear_names.index(name) for name in self.parameters_of(place)]
        gated = values[:, use] * place.gate(motion.recording, motion.t)[:, None]
        return {c: sign * gated for c, sign in place.rows(model.channels).items()}

    def regressor_change(
        self, place: Place, theta: Mapping[str, float], motion: Motion, model: Model
    ) -> dict[int, Array]:
        """{parameter number of the model: (N, C)} change of the model's own columns; for `changes_model`.

        The equations are then (W + change) chi + columns @ a: exact for any size, linear in chi.
        """
        return {}

    def torque_change(
        self, place: Place, theta: Mapping[str, float], motion: Motion, model: Model, chi: Array
    ) -> Array:
        """(N, C) what that change makes of the model's parameters chi (b,)."""
        total = np.zeros((len(motion.t), len(model.channels)))
        for number, change in self.regressor_change(place, theta, motion, model).items():
            total += chi[number] * change
        return total

    def factor(self, size: Array) -> float:
        """By which it multiplies, in its channels, all that acts before it; `size` (p,) as for `columns`.

        Sizes and the model's parameters are then one product, found together however large the factor is:
        steps that hold one of the two converge for factors between 0 and 2 alone."""
        return 1.0

    def late(self, size: Array) -> float:
        """Seconds by which a torque is recorded later than the motion that it belongs to, with the sign that
        dry friction had then; `size` (p,) as for `columns`."""
        return 0.0

    # ---- what it does to a simulated truth

    def stages(self, place: Place) -> tuple[Stage, ...]:
        """When a simulator lets it act."""
        return ("link_torque",) if place.side == "link" else ("torque",)

    def simulate(self, truth: Truth, place: Place, values: Mapping[str, float]) -> Truth:
        """The truth with the effect; `values`: linear and nonlinear parameters. By default its columns are
        added to the torque on its side of the gear."""
        return truth.with_torque(place, self._torque(truth, place, values))

    def _torque(
        self, truth: Truth, place: Place, values: Mapping[str, float], only: tuple[str, ...] | None = None
    ) -> Array:
        """(N,) torque of its terms (of some of them) in the joint of a truth."""
        j, s = place.joint, place.source
        assert j is not None
        q, dq, ddq = truth.state(place)
        signals = {"t": truth.t - truth.t[0], "q": q[:, j], "dq": dq[:, j], "ddq": ddq[:, j]}
        signals["tau_link"] = truth.tau_link[:, j]
        signals["friction"] = signals["offset"] = np.zeros(len(truth.tau_link))
        if s is not None:
            signals |= {"q_source": q[:, s], "dq_source": dq[:, s], "ddq_source": ddq[:, s]}
        columns = self.numpy_columns(signals, {n: values[n] for n in self.nonlinear_names})
        size = [values.get(n, 0.0) * (only is None or n in only) for n in self.linear_names]
        return columns @ np.array(size) * place.gate(truth.recording, truth.t - truth.t[0])

    def usual(self, given: Mapping[str, float], own: Mapping[str, float]) -> dict[str, float]:
        """Reported values of a usual robot beside those that are given; sizes that are left out are not
        there. Where nothing is typical, one of each size and the middle of each shape's grid.

        `own`: the joint's "Fc" and "Fv", where the robot's are known.
        """
        names = {quantity.name for quantity in self.quantities}
        middle = {**dict.fromkeys(self.linear_names, 1.0), **self.complete(None)}
        values = {**{name: value for name, value in middle.items() if name in names}, **self.typical}
        if set(given) & set(self.size_names):
            values |= dict.fromkeys(self.size_names, 0.0)
        return {**values, **given}
