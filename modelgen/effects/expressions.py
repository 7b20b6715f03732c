"""The terms of an effect: symbolic, and as columns of numbers."""

from collections.abc import Mapping

import numpy as np
import sympy as sp

from modelgen.effects import evaluation
from modelgen.effects.definition import Definition, EffectError
from modelgen.effects.memory import Memory, at_first, carried
from modelgen.effects.parameters import STATES

Array = np.ndarray


class Expressions(Definition):
    """Terms over signals and shape parameters."""

    def term(
        self, signals: Mapping[str, sp.Expr] | None = None, theta: Mapping[str, sp.Expr] | None = None
    ) -> dict[str, sp.Expr]:
        """The terms with signals and nonlinear parameters replaced: {linear: expression}."""
        chosen = {sp.Symbol(k, real=True): v for k, v in {**(signals or {}), **(theta or {})}.items()}
        return {name: expression.subs(chosen, simultaneous=True) for name, expression in self.terms.items()}

    def numpy_columns(self, signals: Mapping[str, Array], theta: Mapping[str, float] | None = None) -> Array:
        """(N, n_linear) columns of the terms; `theta` holds the nonlinear parameters, absent ones at
        mid-grid.

        Derived signals that are absent are computed: sign_dq, sign_sum and the states (from q, relaxed at the
        first sample). Raises EffectError when a needed signal is absent.
        """
        theta = self.complete(theta)
        values, rows = self._signal_values(signals, theta)
        return evaluation.columns(self, values, theta, rows)

    def states(
        self,
        signals: Mapping[str, Array],
        theta: Mapping[str, float],
        recording: str = "",
        memory: Memory | None = None,
        key: object = None,
    ) -> dict[str, Array]:
        """{"z": (N,)} of the states along q, going on from `memory`."""
        if self.state is None or "q" not in signals:
            return {}
        state = self.state
        t = signals.get("t", np.arange(len(signals["q"])))

        def along(q: Array, first: float) -> Array:
            return state.integrate(q, theta, first)

        begun = at_first(signals, along, state.initial)
        return {"z": carried(memory, (self.name, key), recording, t, signals["q"], along, begun)}

    def _signal_values(
        self, signals: Mapping[str, Array], theta: Mapping[str, float]
    ) -> tuple[dict[str, Array], int]:
        values = {name: np.asarray(value, dtype=float) for name, value in signals.items()}
        needs = self.needs
        if "sign_dq" in needs and "sign_dq" not in values and "dq" in values:
            values["sign_dq"] = np.sign(values["dq"])
        if "sign_sum" in needs and "sign_sum" not in values and {"dq", "dq_source"} <= set(values):
            values["sign_sum"] = np.sign(values["dq"] + values["dq_source"])
        if needs & set(STATES) - set(values):
            values |= {k: v for k, v in self.states(values, theta).items() if k not in values}
        missing = sorted(needs - set(values))
        if missing:
            raise EffectError(f"{self.name} needs the signal {', '.join(missing)}, which was not given.")
        rows = max((v.shape[0] for v in values.values() if v.ndim), default=1)
        return values, rows
