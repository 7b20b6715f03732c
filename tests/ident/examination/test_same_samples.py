"""A recording under two names."""

import pyarrow as pa
import pytest
from small_arm import ARM

import ident
from ident.twin import PlannedRun, simulate

PLAN = (PlannedRun("run1", "identify", 20.0), PlannedRun("run2", "validate", 20.0))


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
