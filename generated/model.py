"""A model of one robot: names, rules, and its evaluation over arrays of samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol

import numpy as np

from generated.blocks import BLOCK, blocks, in_parts, zero_rows
from generated.errors import GeneratedError
from generated.kernel import Placement, Samples

Array = np.ndarray
CACHES = 8 << 20  # bytes: a larger W is written past the caches


class Evaluator(Protocol):
    """What evaluates samples: the compiled `Kernel`, or `NumpyKernel` where there is no compiler."""

    def stream(self, samples: Samples, buffer: Array, place: Placement, width: int) -> Callable[[], int]: ...
    def dense(self, *arguments: Any) -> None: ...
    def torque(self, *arguments: Any) -> None: ...


class Model:
    """One model of one robot, compiled. Rows are channels, columns base parameters; SI units, joint side.

    `joint_names` are the robot file's (q1, ... where it names none), `standard_values` the inertial
    parameters that it gives, `notes` what was rounded in reading it. `nonzeros` (nnz, 2) holds the (channel,
    parameter) of the entries of W that are not zero for all motions, in the order of `nonzero_blocks`.
    """

    def __init__(
        self,
        description: Mapping[str, Any],
        kernel: Evaluator,
        reload: tuple,
        functions: Callable[[], Mapping],
    ) -> None:
        self._description, self._kernel, self._reload, self._functions = (
            description,
            kernel,
            reload,
            functions,
        )
        self.robot_name: str = description["robot"]
        self.model: str = description["model"]
        self.payload: str | None = description["payload"]
        self.effects: tuple[str, ...] = tuple(description["effects"])
        self.parameters: tuple[str, ...] = tuple(description["parameters"])
        self.channels: tuple[str, ...] = tuple(description["channels"])
        self.standard_parameters: tuple[str, ...] = tuple(description["standard_parameters"])
        self.rules: dict[str, str] = dict(description["rules"])
        self.unidentifiable: tuple[str, ...] = tuple(description["unidentifiable"])
        self.operations: dict[str, Any] = dict(description["operations"])
        self.extra_inputs: tuple[str, ...] = tuple(description["extra_inputs"])
        joints = description["joints"]
        self.joint_names: tuple[str, ...] = tuple(j.get("name", f"q{j['label']}") for j in joints)
        self.standard_values: dict[str, float] = dict(description.get("standard_values", {}))
        self.notes: tuple[str, ...] = tuple(description.get("notes", ()))
        self.n = len(description["joints"])
        nonzeros = description["nonzeros"]
        self.nonzeros = np.array([entry[:2] for entry in nonzeros], dtype=np.intp).reshape(-1, 2)
        self.nonzeros.flags.writeable = False
        self._source = np.array([self._source_number(entry[2]) for entry in nonzeros], dtype=np.int32)
        width = len(self.parameters)
        self._target = np.array([channel * width + p for channel, p, _ in nonzeros], dtype=np.int32)
        self._in_W = self._placement(self._target)
        self._in_nonzeros = self._placement(np.arange(len(nonzeros)))

    @property
    def prismatic(self) -> tuple[str, ...]:
        """Labels of the joints whose q is a length, as channel names bear them: ("3",)."""
        return tuple(joint["label"] for joint in self._description["joints"] if joint["prismatic"])

    @property
    def geometry(self) -> Mapping[str, Any]:
        """The robot's MDH table and gravity in floats, see `modelgen.geometry.kinematics.Geometry.of`."""
        geometry: Mapping[str, Any] = self._description["geometry"]
        return geometry

    @property
    def limits(self) -> tuple[Mapping[str, Any], ...]:
        """Per joint what the robot file states of {"q": (low, high), "dq", "ddq", "tau"}; SI units."""
        return tuple(joint.get("limits", {}) for joint in self._description["joints"])

    def __repr__(self) -> str:
        payload = f", payload={self.payload!r}" if self.payload else ""
        effects = f", effects={self.effects!r}" if self.effects else ""
        return f"generated.load({self.robot_name!r}, {self.model!r}{payload}{effects})"

    def __reduce__(self) -> tuple:
        return self._reload

    def _source_number(self, source: int | str) -> int:
        """The number of a source in generated/batch.c: entries, then dq, ddq, sign of each joint, then 1."""
        if isinstance(source, int):
            return source
        behind = self._description["columns"]
        if source == "one":
            return behind + 3 * self.n
        name = source.rstrip("0123456789")
        return behind + ("dq", "ddq", "sign").index(name) * self.n + int(source[len(name) :])

    def regroup(self, standard: Mapping[str, float]) -> Array:
        """chi (b,) of standard parameters {name: value}; absent ones are zero."""
        if not isinstance(standard, Mapping):
            raise GeneratedError("the standard parameters are no mapping; give {name: value}.")
        unknown = sorted(map(str, set(standard) - set(self.standard_parameters)))
        if unknown:
            raise GeneratedError(
                f"{self.robot_name}, model {self.model}, has no standard parameter {', '.join(unknown)}; "
                "its names are in standard_parameters."
            )
        values = {name: _numbers(name, value) for name, value in standard.items()}
        for name, value in values.items():
            if value.shape or not np.isfinite(value):
                raise GeneratedError(f"{name} is {standard[name]!r}; give one finite number.")
        rules = self._description["regroup"]
        chi = [sum(c * float(values.get(s, 0.0)) for s, c in rules[name].items()) for name in self.parameters]
        return np.array(chi, dtype=np.float64)

    def regressor(
        self,
        q: Any,
        dq: Any,
        ddq: Any,
        out: Array | None = None,
        *,
        sign: Any = None,
        extra: Mapping[str, Any] | None = None,
        threads: int = 1,
    ) -> Array:
        """W (N, len(channels), b), C-contiguous float64, written into `out` when given.

        q, dq, ddq (N, n): rad, rad/s, rad/s^2 (m on prismatic joints). `sign` (N, n) replaces sign(dq) in the
        Coulomb columns. `extra` gives the signals and parameters in `extra_inputs`. Raises GeneratedError.
        """
        samples = self._samples(q, dq, ddq, sign, extra)
        shape = (samples.rows, len(self.channels), len(self.parameters))
        if out is None:
            out = np.empty(shape)
        elif (
            not isinstance(out, np.ndarray)
            or out.shape != shape
            or out.dtype != np.float64
            or not (out.flags.c_contiguous and out.flags.writeable and out.flags.aligned)
        ):
            raise GeneratedError(
                f"out is not a writable C-contiguous float64 array of shape {shape}; use numpy.empty."
            )
        elif any(_overlap(out, array) for array in (q, dq, ddq, sign, *(extra or {}).values())):
            raise GeneratedError("out lies over an input, which it would overwrite; give it its own memory.")
        past_caches = out.nbytes > CACHES

        def part(first: int, last: int) -> None:
            self._kernel.dense(samples, first, last, out, self._source, self._target, past_caches)

        in_parts(part, samples.rows, threads)
        return out

    def torque(
        self,
        q: Any,
        dq: Any,
        ddq: Any,
        chi: Any,
        *,
        sign: Any = None,
        extra: Mapping[str, Any] | None = None,
        threads: int = 1,
    ) -> Array:
        """(N, len(channels)) in N m (N on prismatic joints) of base parameters chi (b,); W is not formed."""
        samples = self._samples(q, dq, ddq, sign, extra)
        chi = np.ascontiguousarray(_numbers("chi", chi), dtype=np.float64)
        if chi.shape != (len(self.parameters),):
            raise GeneratedError(
                f"chi has shape {chi.shape}; give ({len(self.parameters)},), a value per base parameter."
            )
        if not np.isfinite(chi).all():
            name = self.parameters[int(np.argmin(np.isfinite(chi)))]
            raise GeneratedError(f"chi holds a value of {name} that is not finite; give a number.")
        tau = np.empty((samples.rows, len(self.channels)))
        in_parts(
            lambda first, last: self._kernel.torque(samples, first, last, chi, tau), samples.rows, threads
        )
        return tau

    def regressor_blocks(
        self,
        q: Any,
        dq: Any,
        ddq: Any,
        *,
        sign: Any = None,
        extra: Mapping[str, Any] | None = None,
    ) -> Iterator[tuple[slice, Array]]:
        """(rows, W (len(rows), len(channels), b)) block by block: any strides, read only, till the next turn.

        To work on several cores give each thread rows of its own: the kernel releases the interpreter's lock.
        """
        samples = self._samples(q, dq, ddq, sign, extra)
        shape = (len(self.channels), len(self.parameters))
        W = zero_rows(shape[0] * shape[1])
        fill = self._stream(samples, W, self._in_W)
        view = _read_only(W)[:, :BLOCK].reshape(*shape, BLOCK).transpose(2, 0, 1)
        return blocks(samples, fill, view, lambda view, count: view[:count])

    def nonzero_blocks(
        self,
        q: Any,
        dq: Any,
        ddq: Any,
        *,
        sign: Any = None,
        extra: Mapping[str, Any] | None = None,
    ) -> Iterator[tuple[slice, Array]]:
        """(rows, values (nnz, len(rows))) of the entries in `nonzeros`, read only, until the next turn."""
        samples = self._samples(q, dq, ddq, sign, extra)
        values = zero_rows(len(self._source))
        fill = self._stream(samples, values, self._in_nonzeros)
        return blocks(samples, fill, _read_only(values)[:, :BLOCK], lambda view, count: view[:, :count])

    def casadi(self, name: str) -> Any:
        """The CasADi Function "regressor" (q, dq, ddq) -> W or "torque" (q, dq, ddq, chi) -> tau."""
        if name not in ("regressor", "torque"):
            raise GeneratedError(f"there is no CasADi function {name!r}; choose 'regressor' or 'torque'.")
        return self._functions()[name]

    def _placement(self, place: Array) -> Placement:
        """Where a buffer holds what, if non-zero k stands in its row place[k]."""
        entries, one = self._description["columns"], self._description["columns"] + 3 * self.n
        rows = np.full(entries, -1, dtype=np.int64)
        ones, copies = [], []
        for source, k in zip(self._source.tolist(), place.tolist()):
            if source == one:
                ones.append(k)
            elif source < entries and rows[source] < 0:
                rows[source] = k
            else:
                copies.append((source, k))
        of, to = np.array(copies, dtype=np.int64).reshape(-1, 2).T
        return Placement(rows, of.astype(np.int32), to.copy(), np.array(ones, dtype=np.int64))

    def _stream(self, samples: Samples, buffer: Array, place: Placement) -> Callable[[], int]:
        """The kernel's stream into `buffer` of zeros; constants are written here, once."""
        buffer[place.ones] = 1.0
        return self._kernel.stream(samples, buffer, place, BLOCK)

    def _samples(self, q: Any, dq: Any, ddq: Any, sign: Any, extra: Mapping[str, Any] | None) -> Samples:
        arrays = [self._table(name, value) for name, value in (("q", q), ("dq", dq), ("ddq", ddq))]
        signs = None if sign is None else self._table("sign", sign)
        rows = len(arrays[0])
        for name, array in (("dq", arrays[1]), ("ddq", arrays[2]), ("sign", signs)):
            if array is not None and len(array) != rows:
                raise GeneratedError(
                    f"{name} has {len(array)} rows and q has {rows}; give one row per sample."
                )
        q, dq, ddq = arrays
        return Samples(q, dq, ddq, signs, self._extra(extra or {}, rows))

    def _table(self, name: str, value: Any) -> Array:
        array = _numbers(name, value)
        if array.ndim != 2 or array.shape[1] != self.n:
            raise GeneratedError(
                f"{name} has shape {array.shape}; {self.robot_name} needs (N, {self.n}), one row per sample."
            )
        if array.dtype == np.float64 and array.flags.aligned and not any(s % 8 for s in array.strides):
            return array
        with np.errstate(over="ignore"):  # what is too large becomes infinite, and is refused as that
            return np.array(array, dtype=np.float64, order="C")

    def _extra(self, given: Mapping[str, Any], rows: int) -> Array:
        if not isinstance(given, Mapping):
            raise GeneratedError("extra is no mapping; give {name: values}.")
        if set(given) != set(self.extra_inputs):
            wanted = ", ".join(self.extra_inputs) or "none"
            has = ", ".join(sorted(given)) or "nothing"
            raise GeneratedError(f"extra has {has}; this model needs {wanted}.")
        table = np.empty((rows, len(self.extra_inputs)))
        for k, name in enumerate(self.extra_inputs):
            value = _numbers(name, given[name])
            if value.shape not in ((), (rows,)):
                raise GeneratedError(
                    f"{name} has shape {value.shape}; give a number or one per sample, ({rows},)."
                )
            table[:, k] = value
        if not np.isfinite(table).all():
            row, k = np.argwhere(~np.isfinite(table))[0]
            raise GeneratedError(
                f"{self.extra_inputs[k]} holds {table[row, k]} in row {row} (from 0); give finite numbers."
            )
        return table


def _numbers(name: str, value: Any) -> Array:
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise GeneratedError(f"{name} has masked values; leave their samples out.")
    try:
        array = np.asarray(value)
        if array.dtype.kind == "O" and not any(isinstance(x, str | bytes | bool) for x in array.flat):
            array = np.array([float(x) for x in array.flat]).reshape(array.shape)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0, dtype="S1")
    if array.dtype.kind not in "fiu":
        raise GeneratedError(f"{name} is not an array of real numbers; give float64.")
    return array


def _read_only(array: Array) -> Array:
    """The same memory, which nobody who is handed it can change; the kernel writes it by its address."""
    view = array.view()
    view.flags.writeable = False
    return view


def _overlap(out: Array, given: Any) -> bool:
    array = np.asarray(given) if hasattr(given, "__array__") else None
    if array is None or not np.may_share_memory(out, array):
        return False
    try:
        return np.shares_memory(out, array, max_work=100_000)  # type: ignore[arg-type]
    except np.exceptions.TooHardError:
        return True
