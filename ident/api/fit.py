"""`ident.fit`: the identified parameters as a value that predicts, summarises, saves and draws itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ident.api.study import Study, inputs_of, opened
from ident.api.tables import arrays, frame
from ident.errors import IdentError, one_family
from ident.estimation.fit import FitResult, fit_study, interval_factor
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
        return self.result.checks

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
        the ends that the filter makes up. A recording needs no torques. Raises ident.Error.
        """
        from ident.api import prediction

        with one_family():
            if dq is None and isinstance(motion, dict) and set(motion) == {"q", "dq", "ddq"}:
                motion, dq, ddq = motion["q"], motion["dq"], motion["ddq"]
            if dq is not None:
                return prediction.of_motion(self.result, motion, dq, ddq, payload)
            return prediction.of_recording(self.result, motion, payload)

    def summary(self) -> str:
        """What the command prints: checks, errors, essential parameters, warnings, what is left."""
        from ident.report.summary import fit_summary

        return fit_summary(self.result)

    def write(self, folder: Path) -> None:
        """All files of `ident fit` into an existing folder."""
        from ident.report.fit_result import write_fit

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


def fit(study: Any, *, progress: Progress = None) -> Fit:
    """Identify a study (`ident.Study` or a path). Raises ident.Error.

    progress: a callback (text, share done or None), True for a bar, False; None: a bar in a notebook.
    """
    with one_family(), watched(progress) as tell:
        return Fit(fit_study(opened(study), progress=tell))
