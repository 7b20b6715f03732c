"""`ident.fit`: the identified parameters as a value that predicts, summarises, saves and draws itself."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ident.api.study import Study, inputs_of, opened
from ident.api.tables import arrays, frame
from ident.errors import IdentError, one_family
from ident.estimation.fit import FitResult, fit_models, fit_study, interval_factor
from ident.output import staged, write_file
from ident.progress import watched

Progress = Callable[..., Any] | bool | None
Titled = tuple[str, Sequence[str], Sequence[Sequence[str]]]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Fit:
    """Identified parameters of one study. Vectors are over `parameters`, SI units.

    `chi` holds the essential parameters, zero elsewhere; `std` and `covariance` are the honest ones (noise
    that is correlated, no profit from the selection); `result` is the value of the inner rooms.
    """

    result: FitResult

    @property
    def study(self) -> Study:
        return opened(self.result.study)

    @property
    def parameters(self) -> tuple[str, ...]:
        return self.result.columns.parameters

    @property
    def channels(self) -> tuple[str, ...]:
        return self.result.columns.channels

    @property
    def chi(self) -> np.ndarray:
        return self.result.estimate.chi.copy()

    @property
    def essential(self) -> np.ndarray:
        """(b,) bool: what the F-statistic keeps."""
        return self.result.estimate.active.copy()

    @property
    def std(self) -> np.ndarray:
        return self.result.std

    @property
    def covariance(self) -> np.ndarray:
        """(b, b), of all parameters; what the motion does not excite has none (NaN or zero)."""
        return self.result.full_covariance.copy()

    @property
    def checks(self) -> tuple[Any, ...]:
        """What was found in the data before anything was fitted, worst first."""
        from ident.report.files import checks_of

        return checks_of(self.result)

    @property
    def warnings(self) -> tuple[str, ...]:
        return self.result.warnings

    @property
    def error_percent(self) -> dict[str, dict[str, float]]:
        """100 ||error|| / ||torque|| at the full rate: {role: {"total" | channel: percent}}."""
        return self.result.full_rate_error

    def document(self) -> dict[str, Any]:
        """The content of fit.json."""
        from ident.report.files import fit_document

        return fit_document(self.result)

    @property
    def fits(self) -> dict[str, Fit]:
        """This fit under its model's name, as of a `Comparison`."""
        return {self.result.study.model: self}

    def tables(self) -> list[Titled]:
        """Title, header and rows of what the command prints."""
        from ident.report.files import error_table, parameter_table

        return [
            ("essential parameters", *parameter_table(self.result)),
            ("relative error", *error_table(self.result)),
        ]

    def to_frame(self) -> Any:
        """One row a base parameter: name, value, std, relative std, essential, unit, what it regroups."""
        rows = self.document()["parameters"]
        names = ("name", "value", "std", "relative_std_percent", "essential", "unit", "regroups")
        return frame({name: [row[name] for row in rows] for name in names})

    def conf_int(self, level: float = 0.95) -> Any:
        """Two-sided intervals of the essential parameters (Student's t): name, low, high."""
        if not 0 < level < 1:
            raise IdentError(f"level is {level!r}; give a probability between 0 and 1, such as 0.95")
        free = max(self.result.effective_rows - self.result.full.b, 1.0)
        half = interval_factor(free, level) * self.std
        kept = np.flatnonzero(self.essential)
        low, high = self.chi - half, self.chi + half
        return frame(
            {"name": [self.parameters[k] for k in kept], "low": low[kept], "high": high[kept]},
        )

    def residuals(self, recording: str | None = None) -> Any:
        """Measured minus modelled torque [N m|N] at the decimated rate: t, a column a channel, recording.

        Each row is one of the fit's equations; NaN where a channel's row does not count (a joint at rest).
        """
        labels = [system.label for system in self.result.systems]
        if recording is not None and recording not in labels:
            raise IdentError(f"there is no recording {recording!r}; the recordings are {', '.join(labels)}")
        t, values, names = [], [], []
        for system in self.result.systems:
            if recording in (None, system.label):
                for segment, rho in zip(system.segments, system.residuals(self.result.estimate.chi)):
                    t.append(segment.t)
                    values.append(np.where(segment.weight > 0, rho, np.nan).T)
                    names += [system.label] * len(segment.t)
        return frame(arrays(t, values, self.channels) | {"recording": names})

    def predict(self, motion: Any, dq: Any = None, ddq: Any = None, payload: str | None = None) -> Any:
        """Torque of the identified model.

        With q, dq, ddq (N, n), or a mapping of these three: (N, channels) for exactly this motion. With a
        recording (path, data frame, Arrow table, dict with t and q or q1..): positions are filtered and
        differentiated as in the fit, the torque smoothed like them; a table of t and the channels, without
        the ends that the filter makes up. A recording needs no torques, unless effects of the model read
        them. Raises ident.Error.
        """
        with one_family():
            if dq is None and isinstance(motion, dict) and set(motion) == {"q", "dq", "ddq"}:
                motion, dq, ddq = motion["q"], motion["dq"], motion["ddq"]
            if dq is not None:
                return self._torque(motion, dq, ddq, payload)
            return self._recorded(motion, payload)

    def _torque(self, q: Any, dq: Any, ddq: Any, payload: str | None) -> np.ndarray:
        from ident.equations.comparison import modelled_torque
        from ident.signals.filtering import FilteredBlock, smooth_sign

        columns = self.result.columns
        self._check_payload(payload)
        if self._terms:
            raise IdentError(
                "the fit has effects that need a history; predict a recording with t, q and torques"
            )
        n = len(columns.need.joints)
        given = []
        for name, values in (("q", q), ("dq", dq), ("ddq", ddq)):
            array = np.asarray(values, dtype=float)
            if array.ndim != 2 or array.shape[1] != n or not np.isfinite(array).all():
                raise IdentError(f"{name} has shape {array.shape}; give (N, {n}) finite values, rad|m and s")
            given.append(np.ascontiguousarray(array))
        if len({len(array) for array in given}) > 1:
            raise IdentError("q, dq and ddq have different numbers of rows; give arrays of one length")
        rows = len(given[0])
        still, bent = np.zeros(n), self.result.study.turn_over
        q, dq, ddq = given
        sign = smooth_sign(dq, still, None if bent is None else np.array(bent))
        t, all_of_it = np.arange(float(rows)), np.ones((rows, n))
        block = FilteredBlock(t, q, dq, ddq, sign, None, None, still, all_of_it)
        return modelled_torque(columns, self.result.estimate.chi, payload, block)

    def _recorded(self, data: Any, payload: str | None) -> Any:
        from ident.api.study import Recording
        from ident.equations.comparison import low_pass_blocks
        from ident.recordings.opening import open_recording
        from ident.signals.filtering import filter_stream, prepare

        need = self.result.columns.need
        self._check_payload(payload)
        study = self.result.study.with_(trim_rest=False)
        entry = data if isinstance(data, Recording) else Recording(data, payload=payload)
        if not self._terms:  # effects may read the measured torque
            need = replace(need, motor=(), sensor=need.sensor if study.positions == "joint" else ())
        stream = open_recording(study, entry, need)
        bank = prepare(stream, study.filter, study.turn_over)
        t: list[np.ndarray] = []
        values: list[np.ndarray] = []
        for _, stretch in itertools.groupby(filter_stream(stream, bank), key=lambda item: item[0]):
            torques = self._modelled(stream, (block for _, block in stretch), t)
            values += [rows for _, rows in low_pass_blocks(torques, bank.position)]
        return frame(arrays(t, values, self.channels))

    @property
    def _terms(self) -> tuple[Any, ...]:
        """Effects that are part of the fitted model."""
        return tuple(getattr(self.result, "terms", ()))

    def _modelled(self, stream: Any, blocks: Iterable[Any], t: list[np.ndarray]) -> Iterator[np.ndarray]:
        """Torque (N, channels) of the blocks of one stretch; their times go into `t`."""
        from ident.equations import comparison

        columns, chi = self.result.columns, self.result.estimate.chi
        if not self._terms:
            for block in blocks:
                t.append(block.t)
                yield comparison.modelled_torque(columns, chi, stream.payload, block)
            return
        fitted = comparison.Fitted(self.result.model, chi, self._terms)
        for block, _, (torque,) in comparison.fitted_torques(columns, stream, blocks, (fitted,)):
            t.append(block.t)
            yield torque

    def _check_payload(self, payload: str | None) -> None:
        known = [label for label in self.result.columns.sources if label]
        if payload is not None and payload not in known:
            said = f"the payloads are {', '.join(known)}" if known else "the study has no payload"
            raise IdentError(f"payload {payload!r} was not identified; {said}")

    def summary(self) -> str:
        """What the command prints: checks, errors, essential parameters, warnings, what is left."""
        from ident.report.summary import fit_summary

        return fit_summary(self.result)

    def write(self, folder: Path) -> None:
        """All files of `ident fit` into an existing folder."""
        from ident.report.writing import write_fit

        write_fit(self.result, folder)

    def save(self, folder: str | Path, overwrite: bool = False) -> Path:
        """fit.json, tables, plots and report.html, as the command writes them. Raises ident.Error."""
        with one_family():
            inputs = inputs_of(self.result.study)
            with staged(Path(folder), "ident fit", overwrite=overwrite, inputs=inputs) as stage:
                self.write(stage)
        return Path(folder)

    def report(self, path: str | Path, overwrite: bool = False) -> Path:
        """The report as one HTML file that needs no network."""
        from ident.report.fit_result import fit_html

        with one_family():
            write_file(Path(path), fit_html(self.result), overwrite=overwrite)
        return Path(path)

    def __str__(self) -> str:
        return self.summary()

    def __repr__(self) -> str:
        errors = self.result.relative_error
        said = ", ".join(f"{role} {errors[role]['total']:.3g} %" for role in errors)
        model = self.result.columns.model
        return (
            f"Fit({model.robot_name}, model {self.result.study.model}: {self.result.estimate.b} of "
            f"{len(self.parameters)} parameters, error {said})"
        )

    def _repr_html_(self) -> str:
        from ident.report.summary import fit_table

        return fit_table(self.result)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Comparison:
    """The same recordings by several models: the paper's Table II. `fits[model]` is a `Fit`."""

    results: dict[str, FitResult]

    @property
    def fits(self) -> dict[str, Fit]:
        return {model: Fit(result) for model, result in self.results.items()}

    @property
    def warnings(self) -> tuple[str, ...]:
        return tuple(f"model {m}: {text}" for m, result in self.results.items() for text in result.warnings)

    def tables(self) -> list[Titled]:
        """Title, header and rows of what the command prints."""
        from ident.report.files import comparison_table

        return [("parameters", *comparison_table(self.results))]

    def to_frame(self) -> Any:
        ((_, header, rows),) = self.tables()
        return frame({name: [row[k] for row in rows] for k, name in enumerate(header)})

    def summary(self) -> str:
        from ident.report.summary import text_table

        ((_, header, rows),) = self.tables()
        return text_table(header, rows)

    def write(self, folder: Path) -> None:
        from ident.report.writing import write_fits

        write_fits(self.results, folder)

    def save(self, folder: str | Path, overwrite: bool = False) -> Path:
        """A folder a model, their tables side by side and report.html. Raises ident.Error."""
        inputs = inputs_of(next(iter(self.results.values())).study)
        with (
            one_family(),
            staged(Path(folder), "ident fit", overwrite=overwrite, inputs=inputs) as stage,
        ):
            self.write(stage)
        return Path(folder)

    def __str__(self) -> str:
        return self.summary()

    def __repr__(self) -> str:
        return f"Comparison(models {', '.join(self.results)})"


def fit(study: Any, *, progress: Progress = None) -> Fit:
    """Identify a study (`ident.Study` or a path). Raises ident.Error.

    progress: a callback (text, share done or None), True for a bar, False; None: a bar in a notebook.
    """
    with one_family(), watched(progress) as tell:
        return Fit(fit_study(opened(study), progress=tell))


def compare(study: Any, models: Sequence[str] = tuple("ABCD"), *, progress: Progress = None) -> Comparison:
    """Identify a study with several models. Raises ident.Error."""
    letters = checked_models(models)
    with one_family(), watched(progress) as tell:
        return Comparison(fit_models(opened(study), letters, progress=tell))


def checked_models(models: Sequence[str]) -> tuple[str, ...]:
    """Upper-case model letters. Raises IdentError for one that is none of A, B, C, D."""
    from ident.recordings.study import MODELS

    letters = tuple(dict.fromkeys(model.strip().upper() for model in models))
    for letter in letters:
        if letter not in MODELS:
            raise IdentError(f"models: there is no model {letter}; choose from {', '.join(MODELS)}")
    return letters
