"""The equations of a study: blocks of any size give the same rows, and fine columns land on those rows."""

import numpy as np
import pytest
from recordings import recording, write_parquet, write_study

from ident.equations.build import build
from ident.equations.fine import TAIL, FineKeeper
from ident.equations.prepared import prepare_study
from ident.recordings.study import load_study


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    columns, _ = recording("A", seconds=40, rate=1000)
    keep = np.ones(len(columns["t"]), bool)
    keep[17000:18500] = False  # two stretches
    write_parquet(folder / "run.parquet", {name: values[keep] for name, values in columns.items()})
    return prepare_study(load_study(write_study(folder, [{"file": "run.parquet"}])))


@pytest.mark.parametrize("cutoff", [0.8, 3.0, 20.0])
def test_fine_columns_are_the_rows(prepared, cutoff):
    """A column that the equations have themselves, made at the fine rate and decimated, is that column."""
    least = max(200.0, 25 * cutoff)
    keeper = FineKeeper(prepared.columns, cutoff, prepared.study.filter.order, least_hz=least)
    (system,) = build(prepared, cutoff, observer=keeper)
    fine = keeper.segments([system])
    assert len(fine) == len(system.segments) == 2
    names = list(prepared.columns.parameters)
    for segment, rows in zip(fine, system.segments):
        assert segment.rate_hz >= min(1000, least)
        for joint, kind, signal in (
            (1, "Fcm2", segment.sign_dq),
            (4, "Fvm5", segment.dq),
            (6, "Iam7", segment.ddq),
        ):
            column = next(k for k, name in enumerate(names) if name.removesuffix("R") == kind)
            want = system.dense(rows, joint, len(names))[:, column]
            found = segment.decimate(signal[:, joint : joint + 1], joint)[:, 0]
            limit = 5e-3 if kind == "Fcm2" else 2e-3  # a reversal is known to one fine sample
            assert np.linalg.norm(found - want) < limit * np.linalg.norm(want)
        found = segment.decimate(segment.measured[:, :2], 1)[:, 1]
        assert np.linalg.norm(found - rows.Y[1]) < 0.01 * np.linalg.norm(rows.Y[1])


def test_fine_columns_at_the_full_rate_are_the_rows_but_for_the_response_s_tail(prepared):
    keeper = FineKeeper(prepared.columns, 2.0, prepared.study.filter.order, least_hz=1000)
    (system,) = build(prepared, 2.0, observer=keeper)
    for segment, rows in zip(keeper.segments([system]), system.segments):
        found, limit = segment.decimate(segment.measured[:, 3:4], 3)[:, 0], TAIL * np.abs(rows.Y[3]).max()
        assert np.abs(found - rows.Y[3]).max() < limit


def test_fine_torques_are_those_recorded(prepared):
    """Not means over the fine step, which smear the steps of dry friction: a delay was lost by that."""
    keeper, t, Y = FineKeeper(prepared.columns, 2.0, prepared.study.filter.order), [], []

    def observer(stream, index, block):
        keeper(stream, index, block)
        t.append(block.t.copy())
        Y.append(prepared.columns.torque(block).copy())

    (system,) = build(prepared, 2.0, observer=observer)
    t, Y = np.concatenate(t), np.concatenate(Y)
    for segment in keeper.segments([system]):
        assert segment.rate_hz < 1000
        assert np.array_equal(segment.measured, Y[np.searchsorted(t, segment.t)])


def test_roles_and_excerpts(prepared):
    assert build(prepared, 2.0, roles=("validate",)) == ()
    (some,) = build(prepared, 2.0, excerpt_s=5.0)
    (whole,) = build(prepared, 2.0)
    assert some.samples < whole.samples
    rows = min(len(some.segments[0].t) - 5, 20)
    assert np.allclose(some.segments[0].Y[:, :rows], whole.segments[0].Y[:, :rows], rtol=1e-3, atol=0.1)
