"""A recording under two names."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
import yaml
from recordings import write_parquet
from small_arm import ARM

import ident
from ident.recordings.opening import _once
from ident.report.fit_report import left_over, verdict
from ident.twin import PlannedRun, simulate

PLAN = (PlannedRun("run1", "identify", 20.0), PlannedRun("run2", "validate", 20.0))


@pytest.mark.first_case
@pytest.mark.parametrize("copied", [True, False])
def test_what_judges_is_a_copy_of_what_is_fitted(tmp_path, copied):
    """With another zero of its time; run2 itself is as long and of the same motions' kind."""
    (tmp_path / "small.yaml").write_text(ARM)
    first, other = (
        dict(its.columns) for its in simulate(tmp_path / "small.yaml", runs=PLAN, seed=3).recordings
    )
    other = first | {"t": first["t"] + 100.0} if copied else other
    runs = [
        ident.Recording(pa.table(c), use, name=name)
        for c, use, name in ((first, "identify", "run1"), (other, "validate", "run2"))
    ]
    fit = ident.fit(ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs))
    told = [c.recording for c in fit.checks if c.check == "same_rows"]
    assert told == (["run2"] if copied else [])
    said = "rows were fitted, too" if copied else "were not fitted"
    assert said in left_over(fit.document()) and said in verdict(fit.document())


@pytest.mark.parametrize("roles", [("identify", "test"), ("test", "identify"), ("validate", "test")])
def test_a_window_that_judges_on_rows_of_another_role(tmp_path, roles):
    """Of a UR10e's one file for all roles it was said, beside the warning, that 4.8 % are left on runs that
    were used for nothing else."""
    (tmp_path / "small.yaml").write_text(ARM)
    for its in simulate(tmp_path / "small.yaml", runs=PLAN, seed=3).recordings:
        write_parquet(tmp_path / f"{its.label}.parquet", dict(its.columns))
    given = [{"file": "run1.parquet", "use": "identify", "name": "fitted"}] if "identify" not in roles else []
    given += [{"file": "run2.parquet", "use": use, "name": f"its_{use}"} for use in roles]
    study = {"robot": "small.yaml", "recordings": given}
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(study))
    fit = ident.fit(ident.load(tmp_path / "study.yaml"))
    assert [c.recording for c in fit.checks if c.check == "same_rows"] == ["its_test"]
    assert "on runs whose rows were used before" in left_over(fit.document())


@dataclass(frozen=True)
class Stream:
    label: str
    role: str
    highest: float
    payload: str | None = None
    checks: tuple = ()

    @property
    def file(self):
        return self.label

    @property
    def survey(self):
        return SimpleNamespace(rows=300, lowest=np.zeros(3), highest=np.full(3, self.highest))


def test_a_copy_of_what_is_fitted_is_left_out():
    """Its rows would count twice: of three seconds of a Franka's, given twice, a fit of more parameters than
    they show was made, and 64 % were left. What judges, or carries a load, stays."""
    given = [
        Stream("run1", "identify", 1.0),
        Stream("again", "identify", 1.0),
        Stream("other", "identify", 2.0),
        Stream("third", "identify", 1.0),
        Stream("loaded", "identify", 1.0, payload="L"),
        Stream("judge", "validate", 2.0),
    ]
    kept = _once(given)
    assert [its.label for its in kept] == ["run1", "other", "loaded", "judge"]
    told = [(c.check, c.recording, c.outcome) for c in kept[0].checks]
    assert told == [("same_rows", "again", "mended"), ("same_rows", "third", "mended")]
