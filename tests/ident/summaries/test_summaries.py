"""Fits from summaries are the fits from rows; sums are the same bits in any order."""

import itertools

import numpy as np
import pytest
from recordings import recording, write_parquet, write_study

from ident.estimation.fit import fit_study
from ident.recordings.study import load_study
from ident.summaries import make
from ident.summaries.file import read, together, written
from ident.summaries.solve import fit_window, recursive
from ident.summaries.window import SummaryError, leave_one_out, merged

pytestmark = pytest.mark.unexamined


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("summaries")
    for k in (1, 2):
        write_parquet(folder / f"{k}.parquet", recording("A", seconds=40, seed=k)[0])
    entries = [{"file": "1.parquet"}, {"file": "2.parquet"}]
    study = load_study(write_study(folder, entries, reduction=False))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(make, "WINDOW_S", 8.0)
        return study, make.summarise(study)


def test_the_fit_of_all_windows_is_the_fit_of_the_rows(made):
    study, summary = made
    assert len(summary.windows) >= 8
    mine = fit_window(merged(summary.windows), summary.header.parameters)
    its = fit_study(study)
    assert np.allclose(mine.estimate.chi, its.full.chi, rtol=1e-9, atol=1e-9)
    assert np.allclose(mine.estimate.covariance, its.full.covariance, rtol=1e-6)
    ratio = mine.std / its.std
    assert 0.6 < np.median(ratio) < 1.6
    assert np.allclose(mine.error_percent[0], its.relative_error["identify"]["tau_m1"], rtol=0.2)


def test_any_order_gives_the_same_bits_and_a_file_keeps_them(made):
    _, summary = made
    kept = read(written(summary), "a file")
    assert kept.header == summary.header
    assert written(kept) == written(summary)
    rng = np.random.default_rng(0)
    first = merged(summary.windows)
    for _ in range(3):
        mixed = [kept.windows[k] for k in rng.permutation(len(kept.windows))]
        for a, b in zip(merged(mixed).factors, first.factors):
            assert a.rows == b.rows and a.R.tobytes() == b.R.tobytes()


def test_leaving_one_out_is_the_sum_of_the_others(made):
    _, summary = made
    names = summary.header.parameters
    for window, others in itertools.islice(leave_one_out(summary.windows), 3):
        direct = merged([each for each in summary.windows if each.key != window.key])
        assert others.rows == direct.rows
        found, wanted = fit_window(others, names).estimate, fit_window(direct, names).estimate
        assert np.allclose(found.chi, wanted.chi, rtol=1e-8, atol=1e-8)


def test_recursive_least_squares_ends_at_the_fit_and_forgets(made):
    _, summary = made
    names = summary.header.parameters
    everything = fit_window(merged(summary.windows), names).estimate
    *_, (_, last) = recursive(summary.windows, names)
    assert np.allclose(last.estimate.chi, everything.chi, rtol=1e-8, atol=1e-8)
    *_, (_, faded) = recursive(summary.windows, names, 0.5)
    assert np.median(faded.estimate.std / everything.std) > 1.3


def test_what_cannot_be_added_is_told(made):
    study, summary = made
    with pytest.raises(SummaryError, match="there twice"):
        merged([summary.windows[0], summary.windows[0]])
    other = make.summarise(study.with_(filter={"position_cutoff_hz": 10, "decimation_cutoff_hz": 1}))
    with pytest.raises(SummaryError, match=r"a and b cannot be added: their cutoff hz differ"):
        together([summary, other], ["a", "b"])
    with pytest.raises(SummaryError, match=r"x\.ident\.parquet is no summary"):
        read(b"nothing", "x.ident.parquet")
