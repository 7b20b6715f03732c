"""The stand-in for a compiled model where there is no compiler: the same programs, run by NumPy over blocks.

About 1 us a sample; CasADi's virtual machine, the other way without a compiler, takes some 30.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from generated.kernel import Placement, Samples

Array = np.ndarray
CHUNK = 2048


class NumpyKernel:
    """`Kernel`'s functions for a `modelgen.emit.description.Derived`."""

    def __init__(self, derived: Any) -> None:
        import sympy as sp

        self._derived = derived
        self._labels = [joint["label"] for joint in derived.description["joints"]]
        self._prismatic = [joint["prismatic"] for joint in derived.description["joints"]]
        self._extra = derived.description["extra_inputs"]
        names = [v + k for v in ("q", "dq", "ddq", "sign") for k in self._labels] + list(self._extra)
        self._term_names = names
        symbols = [sp.Symbol(name, real=True) for name in names]
        self._terms = sp.lambdify(symbols, list(derived.terms), "numpy") if derived.terms else None

    def stream(self, samples: Samples, buffer: Array, place: Placement, width: int) -> Callable[[], int]:
        places = [
            *enumerate(place.rows.tolist()),
            *zip(place.copy_of.tolist(), place.copy_rows.tolist()),
        ]
        starts = iter(range(0, samples.rows, width))

        def fill() -> int:
            start = next(starts)
            stop = min(start + width, samples.rows)
            sources, _ = self.sources(samples, start, stop)
            for source, row in places:
                buffer[row, : stop - start] = sources[source]
            return 1

        return fill

    def sources(self, samples: Samples, first: int, last: int) -> tuple[list[Any], dict[str, Array]]:
        """Entries, then dq, ddq, sign of each joint and 1, as in batch.c; and the inputs by name."""
        samples.refuse(first, last)
        q, dq, ddq, sign, extra = (None if a is None else a[first:last] for a in samples.arrays)
        assert q is not None and dq is not None and ddq is not None and extra is not None
        sign = np.sign(dq) if sign is None else sign
        inputs: dict[str, Array] = {name: extra[:, k] for k, name in enumerate(self._extra)}
        for i, k in enumerate(self._labels):
            inputs |= {f"q{k}": q[:, i], f"dq{k}": dq[:, i], f"ddq{k}": ddq[:, i], f"sign{k}": sign[:, i]}
            inputs |= {f"c{k}": np.cos(q[:, i]), f"s{k}": np.sin(q[:, i])}
        with np.errstate(all="ignore"):
            entries = list(self._derived.columns.evaluate(inputs))
            if self._terms:
                entries += list(self._terms(*(inputs[name] for name in self._term_names)))
        return [*entries, *dq.T, *ddq.T, *sign.T, 1.0], inputs

    def dense(
        self,
        samples: Samples,
        first: int,
        last: int,
        W: Array,
        source: Array,
        target: Array,
        past_caches: bool,
    ) -> None:
        flat = W.reshape(len(W), -1)
        for start in range(first, last, CHUNK):
            stop = min(start + CHUNK, last)
            sources, _ = self.sources(samples, start, stop)
            flat[start:stop] = 0.0
            for s, t in zip(source.tolist(), target.tolist()):
                flat[start:stop, t] = sources[s]

    def torque(self, samples: Samples, first: int, last: int, chi: Array, tau: Array) -> None:
        columns = len(self._derived.columns.outputs)
        for start in range(first, last, CHUNK):
            stop = min(start + CHUNK, last)
            sources, inputs = self.sources(samples, start, stop)
            known: dict[str, Any] = inputs | {f"chi{b}": value for b, value in enumerate(chi)}
            with np.errstate(all="ignore"):
                for channel, value in enumerate(self._derived.torque.evaluate(known)):
                    tau[start:stop, channel] = value
            for channel, parameter, source in self._derived.description["nonzeros"]:
                if isinstance(source, int) and source >= columns:
                    tau[start:stop, channel] += chi[parameter] * sources[source]
