"""What an examination holds in memory."""

import tracemalloc

import pytest
from recordings import recording, write_parquet, write_study

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.fits.samples import take
from ident.recordings.study import load_study


@pytest.mark.long
def test_hypotheses_that_explain_nothing_are_not_kept(tmp_path):
    """Each has equations of its own; of four recordings of an AIRBOT 700 MB were held."""
    for k in range(3):
        columns, _ = recording("A", seconds=20, seed=k)
        if k == 1:
            columns["q3"] = columns["q3"] + 0.3
        write_parquet(tmp_path / f"{k}.parquet", columns)
    prepared = prepare_study(load_study(write_study(tmp_path, [{"file": f"{k}.parquet"} for k in range(3)])))
    own = sum(s.W.nbytes for s in take(prepared.streams, prepared.banks, prepared.columns, "identify"))
    tracemalloc.start()
    told = examine_fit(prepared)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert [check.check for check in told] == ["position_zero"]
    assert peak < 80 * own, peak / own
