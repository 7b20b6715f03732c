"""Rows that wait on disk are the rows that were made, and the fit from them is the fit."""

import pickle

import numpy as np
import pytest
from recordings import recording, write_parquet, write_study

from ident.equations import build, observation
from ident.equations.spilled import SpilledRows, Spool, joined
from ident.estimation.fit import fit_study
from ident.recordings.study import load_study

pytestmark = pytest.mark.unexamined


def test_what_is_read_is_what_was_written():
    rng = np.random.default_rng(0)
    whole = rng.normal(size=(5, 40)).astype(np.float32)
    spool = Spool()
    spool.append(rng.normal(size=(3, 7)))
    rows = joined([spool.append(whole[:, :15]), spool.append(whole[:, 15:])])
    some = np.array([True, False, True, True, False])
    assert np.array_equal(rows[:], whole)
    assert np.array_equal(rows[some], whole[some])
    assert np.array_equal(rows[some, 13:17], whole[some, 13:17])
    assert np.array_equal(np.vstack([rows, whole]), np.vstack([whole, whole]))
    assert np.array_equal(pickle.loads(pickle.dumps(rows)), whole)


def test_a_fit_from_disk_in_pieces_is_the_fit(tmp_path, monkeypatch):
    write_parquet(tmp_path / "run.parquet", recording("A", seconds=40)[0])
    study = load_study(write_study(tmp_path, [{"file": "run.parquet"}], robust="huber"))
    usual = fit_study(study)
    monkeypatch.setattr(build, "SPILL", 0)
    monkeypatch.setattr(observation, "PIECE", 100)
    spilled = fit_study(study)
    assert isinstance(spilled.systems[0].segments[0].values, SpilledRows)
    assert np.allclose(spilled.estimate.chi, usual.estimate.chi, rtol=1e-5, atol=1e-5 * usual.std)
    assert np.allclose(spilled.std, usual.std, rtol=0.05)  # correlation across the seams counts for nothing
    for mine, its in zip(spilled.noises, usual.noises):
        assert np.allclose(mine.autocorrelation, its.autocorrelation, atol=1e-4)
    found, wanted = (each.relative_error["identify"]["total"] for each in (spilled, usual))
    assert abs(found - wanted) < 1e-5 * wanted
