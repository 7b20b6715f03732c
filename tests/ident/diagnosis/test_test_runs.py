"""A test run decides nothing: the rows that a diagnosis looks at are the same without it."""

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
import yaml

from ident.diagnosis.opening import opened
from ident.equations.prepared import prepare_study
from ident.recordings.study import load_study

pytestmark = pytest.mark.unexamined


def test_a_test_run_is_not_looked_at(arm):
    file = arm().file
    folder, study = file.parent, yaml.safe_load(file.read_text())
    table = pq.read_table(folder / study["recordings"][1]["file"])
    for name in ("q1", "q2", "q3"):  # it goes further than the others
        further = pc.multiply(table[name], 1.5)
        if name == "q1":  # and in steps, behind which lower filters are asked for
            further = pc.multiply(pc.round(pc.divide(further, 0.02)), 0.02)
        table = table.set_column(table.column_names.index(name), name, further)
    pq.write_table(table, folder / "further.parquet")
    study["recordings"].insert(0, {"file": "further.parquet", "use": "test"})
    other = folder / "with_a_test_run.yaml"
    other.write_text(yaml.safe_dump(study))
    alone, beside = (opened(prepare_study(load_study(its))) for its in (file, other))
    assert (alone.layout.travel, alone.cutoff_hz) == (beside.layout.travel, beside.cutoff_hz)
    for name in ("t", "recording", "Y", "use", "fitted", "judged"):
        assert np.array_equal(getattr(alone.state.rows, name), getattr(beside.state.rows, name))
