"""A recording under two names."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from small_arm import ARM

import ident
from ident.recordings.opening import _once
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
    checks = ident.fit(ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs)).checks
    told = [c.recording for c in checks if c.check == "same_rows"]
    assert told == (["run2"] if copied else [])


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
