"""`ident.compare`: the same recordings by several models, the paper's Table II."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ident.api.fit import Fit, Progress, Titled
from ident.api.study import inputs_of, opened
from ident.api.tables import frame
from ident.errors import IdentError, one_family
from ident.estimation.fit import FitResult, fit_models
from ident.output import staged
from ident.progress import watched


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
        from ident.report.fit_result import write_fits

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
