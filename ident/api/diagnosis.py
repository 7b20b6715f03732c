"""`ident.diagnose`: what the model lacks, as a value that summarises, saves and draws itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ident.api.fit import Fit
from ident.api.study import Study, inputs_of, opened
from ident.api.tables import of_rows
from ident.errors import IdentError, StudyError, one_family
from ident.output import staged, write_file
from ident.progress import watched

UNITS = {"B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12, "K": 10**3, "M": 10**6, "G": 10**9}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Diagnosis:
    """What the recordings show that the model does not have. `result` is the value of the inner rooms."""

    result: Any
    _documents: list[dict[str, Any]] = field(default_factory=list)

    @property
    def verdict(self) -> str:
        """effect, none or unexplained."""
        return self.document()["verdict"]

    @property
    def findings(self) -> tuple[Any, ...]:
        """Effects, strongest first."""
        return tuple(self.result.findings)

    @property
    def unexplained(self) -> tuple[Any, ...]:
        """Structure that no known effect explains, and what it depends on."""
        return tuple(self.result.unexplained)

    @property
    def checks(self) -> tuple[Any, ...]:
        """What was found in the data before anything was fitted, worst first."""
        return tuple(self.result.checks)

    @property
    def fit(self) -> Fit:
        """The extended model, fitted: a Fit like any other."""
        return Fit(self.result.last)

    @property
    def extended_study(self) -> Study:
        """The study with the effects that were found: `ident.fit` of it gives `.fit` again."""
        return self.fit.study

    def document(self, kept: str | Path | None = None) -> dict[str, Any]:
        """The content of diagnosis.json; kept: the folder that holds it, which its commands then read."""
        from ident.diagnosis.document import diagnosis_document
        from ident.excitation.diagnosed import counting

        if not self._documents:
            self._documents.append(diagnosis_document(self.result))
        return self._documents[0] if kept is None else counting(self._documents[0], Path(kept))

    def to_frame(self) -> Any:
        """One row a parameter of a finding, with its value, std and unit, and what the finding lowers."""
        rows = []
        for found in self.document()["findings"]:
            place = {"effect": found["effect"], "joints": ", ".join(map(str, found["joints"]))}
            drop = {"error_drop_percent": found["evidence"].get("error_drop_percent")}
            for name, item in (found["parameters"] or {"": {}}).items():
                value = item.get("value")
                shown = {"parameter": name, "value": value if not isinstance(value, str) else None}
                rows.append(place | shown | {"std": item.get("std"), "unit": item.get("unit")} | drop)
        names = ("effect", "joints", "parameter", "value", "std", "unit", "error_drop_percent")
        return of_rows(rows) if rows else of_rows([dict.fromkeys(names)])[:0]

    def summary(self) -> str:
        """What the command prints."""
        from ident.report.summary import diagnosis_summary

        return diagnosis_summary(self.document())

    def write(self, folder: Path, kept: Path | None = None) -> None:
        """All files of `ident diagnose` into an existing folder, which will be `kept` elsewhere."""
        from ident.report.diagnosis_files import write_diagnosis

        write_diagnosis(self.result, self.document(kept or folder), folder)

    def save(self, folder: str | Path, overwrite: bool = False) -> Path:
        """diagnosis.json, tables, plots, the extended model and report.html. Raises ident.Error."""
        inputs = inputs_of(self.result.study)
        staging = staged(Path(folder), "ident diagnose", overwrite=overwrite, inputs=inputs)
        with one_family(), staging as stage:
            self.write(stage, Path(folder))
        return Path(folder)

    def report(self, path: str | Path, overwrite: bool = False) -> Path:
        """The report as one HTML file that needs no network."""
        from ident.report.diagnosis_result import diagnosis_html

        with one_family():
            write_file(Path(path), diagnosis_html(self.result), overwrite=overwrite)
        return Path(path)

    def __str__(self) -> str:
        return self.summary()

    def __repr__(self) -> str:
        found = [
            f"{f['effect']}:{','.join(map(str, f['joints']))}".rstrip(":")
            for f in self.document()["findings"]
        ]
        said = ", ".join(found[:6]) + (f" and {len(found) - 6} more" if len(found) > 6 else "")
        left = len(self.unexplained)
        said += f"{', ' if said and left else ''}{left} unexplained" if left else ""
        return f"Diagnosis({self.document()['robot']}, model {self.document()['model']}: {said or 'none'})"

    def _repr_html_(self) -> str:
        from ident.report.summary import diagnosis_table

        return diagnosis_table(self.document())


def diagnose(
    study: Any,
    *,
    alpha: float | None = None,
    progress: Callable[..., Any] | bool | None = None,
    memory: str | int | None = None,
) -> Diagnosis:
    """Find what the model of a study (`ident.Study` or a path) lacks; fit it with what was found.

    alpha: rate of false findings in the whole study (the study's own, 0.01). memory: a limit such as "2GB",
    or bytes. progress as in `ident.fit`. Raises ident.Error."""
    limit = None if memory is None else size_in_bytes(memory)
    if alpha is not None and not (isinstance(alpha, int | float) and 0 < alpha < 1):
        raise IdentError(f"alpha is {alpha!r}; give a rate between 0 and 1, such as 0.01")
    with one_family(), watched(progress) as tell:
        from ident.diagnosis import diagnose_study
        from ident.excitation.offered import with_offers

        asked = opened(study)
        no_simulated_loop(asked)
        return Diagnosis(with_offers(diagnose_study(asked, progress=tell, alpha=alpha, memory=limit)))


def no_simulated_loop(study: Study) -> None:
    """Raises StudyError for an estimator that knows no effects."""
    if study.controller is not None:
        raise StudyError(
            str(study.file),
            "controller",
            "a diagnosis adds effects to the model, which a simulated loop does not know; "
            "leave controller out and write estimator: wls for ident diagnose",
        )


def size_in_bytes(text: str | int) -> int:
    """2GB, 500 MB, 1.5G -> bytes. Raises IdentError."""
    shown = str(text).strip().upper().replace("IB", "B")
    number = shown.rstrip("BKMGT ")
    unit = shown[len(number) :].strip() or "B"
    try:
        value = float(number) * UNITS[unit]
    except (KeyError, ValueError):
        raise IdentError(f"memory {text!r} is no size; write it as 2GB or 500MB") from None
    if not 5e7 <= value < 1e15:
        raise IdentError(
            f"memory {text!r} is {'too little' if value < 5e7 else 'too much'}; give 50MB or more"
        )
    return int(value)
