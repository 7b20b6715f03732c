"""A model of one robot: names, rules, and its evaluation over arrays of samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from generated.errors import GeneratedError

Array = np.ndarray


class Model:
    """Base parameters, rules, regressor and torque of one model of a robot."""

    def __init__(self, description: Mapping[str, Any], columns: Callable[[dict[str, Array]], list]) -> None:
        self._description, self._columns = description, columns
        self.robot_name: str = description["robot"]
        self.model: str = description["model"]
        self.payload: str | None = description["payload"]
        self.parameters: tuple[str, ...] = tuple(description["parameters"])
        self.channels: tuple[str, ...] = tuple(description["channels"])
        self.standard_parameters: tuple[str, ...] = tuple(description["standard_parameters"])
        self.rules: dict[str, str] = dict(description["rules"])
        self.unidentifiable: tuple[str, ...] = tuple(description["unidentifiable"])
        self.operations: dict[str, int] = dict(description["operations"])
        self.n = len(description["joints"])
        self.nonzeros = np.array([entry[:2] for entry in description["nonzeros"]], dtype=np.intp).reshape(
            -1, 2
        )
        self._sources = [entry[2] for entry in description["nonzeros"]]

    def regroup(self, standard: Mapping[str, float]) -> Array:
        """chi (b,) of given standard parameters; absent ones are zero. Raises GeneratedError."""
        unknown = sorted(set(standard) - set(self.standard_parameters))
        if unknown:
            raise GeneratedError(
                f"{self.robot_name} model {self.model} has no standard parameter {', '.join(unknown)}; "
                "names are in model.standard_parameters."
            )
        rules = self._description["regroup"]
        return np.array(
            [sum(c * float(standard.get(s, 0.0)) for s, c in rules[name].items()) for name in self.parameters]
        )

    def _state(self, q: Any, dq: Any, ddq: Any, sign: Any) -> tuple[Array, Array, Array, Array]:
        arrays = []
        for name, value in (("q", q), ("dq", dq), ("ddq", ddq), ("sign", sign)):
            if value is None:
                continue
            try:
                array = np.asarray(value, dtype=np.float64)
            except (TypeError, ValueError):
                raise GeneratedError(
                    f"{name} is not an array of real numbers; give float64 of shape (N, {self.n})."
                ) from None
            if array.ndim != 2 or array.shape[1] != self.n:
                raise GeneratedError(
                    f"{name} has shape {array.shape}; {self.robot_name} needs (N, {self.n})."
                )
            arrays.append(array)
            if array.shape != arrays[0].shape:
                raise GeneratedError(
                    f"{name} has {array.shape[0]} rows and q has {arrays[0].shape[0]}; give as many."
                )
        if sign is None:
            arrays.append(np.sign(arrays[1]))
        return tuple(arrays)  # type: ignore[return-value]

    def _values(self, q: Array, dq: Array, ddq: Array, sign: Array) -> list[Any]:
        inputs: dict[str, Array] = {}
        for i, joint in enumerate(self._description["joints"]):
            k = joint["label"]
            inputs |= {f"q{k}": q[:, i], f"dq{k}": dq[:, i], f"ddq{k}": ddq[:, i]}
            inputs |= {f"c{k}": np.cos(q[:, i]), f"s{k}": np.sin(q[:, i])}
        inertial = self._columns(inputs)
        signals = {"dq": dq, "ddq": ddq, "sign": sign}
        values = []
        for source in self._sources:
            if isinstance(source, int):
                values.append(inertial[source])
            elif source == "one":
                values.append(1.0)
            else:
                name = source.rstrip("0123456789")
                values.append(signals[name][:, int(source[len(name) :])])
        return values

    def regressor(
        self, q: Any, dq: Any, ddq: Any, out: Array | None = None, *, sign: Any = None, threads: int = 1
    ) -> Array:
        """W (N, len(channels), b), C-contiguous float64, written into `out` when given."""
        q, dq, ddq, sign = self._state(q, dq, ddq, sign)
        shape = (len(q), len(self.channels), len(self.parameters))
        if out is None:
            out = np.zeros(shape)
        elif (
            not isinstance(out, np.ndarray)
            or out.shape != shape
            or out.dtype != np.float64
            or not out.flags.c_contiguous
        ):
            raise GeneratedError(
                f"out is not a C-contiguous float64 array of shape {shape}; make one with numpy.empty."
            )
        else:
            out[:] = 0.0
        for (channel, parameter), value in zip(self.nonzeros, self._values(q, dq, ddq, sign)):
            out[:, channel, parameter] = value
        return out

    def nonzero_blocks(
        self, q: Any, dq: Any, ddq: Any, *, sign: Any = None, threads: int = 1
    ) -> Iterator[tuple[slice, Array]]:
        """(rows, values (nnz, len(rows))) of the entries in `nonzeros`, valid until the next turn."""
        q, dq, ddq, sign = self._state(q, dq, ddq, sign)
        return self._nonzero_blocks(q, dq, ddq, sign)

    def _nonzero_blocks(self, q: Array, dq: Array, ddq: Array, sign: Array) -> Iterator[tuple[slice, Array]]:
        for start in range(0, len(q), 1024):
            rows = slice(start, min(start + 1024, len(q)))
            values = np.empty((len(self._sources), rows.stop - rows.start))
            for row, value in zip(values, self._values(q[rows], dq[rows], ddq[rows], sign[rows])):
                row[:] = value
            yield rows, values

    def regressor_blocks(
        self, q: Any, dq: Any, ddq: Any, *, sign: Any = None, threads: int = 1
    ) -> Iterator[tuple[slice, Array]]:
        """(rows, W (len(rows), len(channels), b)) ; W is valid until the next turn, of any strides."""
        q, dq, ddq, sign = self._state(q, dq, ddq, sign)
        return self._regressor_blocks(q, dq, ddq, sign)

    def _regressor_blocks(
        self, q: Array, dq: Array, ddq: Array, sign: Array
    ) -> Iterator[tuple[slice, Array]]:
        shape = (len(self.channels), len(self.parameters))
        for rows, values in self._nonzero_blocks(q, dq, ddq, sign):
            W = np.zeros((*shape, values.shape[1]))
            W[self.nonzeros[:, 0], self.nonzeros[:, 1]] = values
            yield rows, W.transpose(2, 0, 1)

    def torque(self, q: Any, dq: Any, ddq: Any, chi: Any, *, sign: Any = None, threads: int = 1) -> Array:
        """(N, len(channels)) in N m (N on a prismatic joint) of base parameters chi (b,)."""
        q, dq, ddq, sign = self._state(q, dq, ddq, sign)
        chi = np.asarray(chi, dtype=np.float64)
        if chi.shape != (len(self.parameters),):
            raise GeneratedError(
                f"chi has shape {chi.shape}; this model has {len(self.parameters)} parameters."
            )
        tau = np.zeros((len(q), len(self.channels)))
        for (channel, parameter), value in zip(self.nonzeros, self._values(q, dq, ddq, sign)):
            tau[:, channel] += chi[parameter] * value
        return tau
