"""Which rows are fitted, which judge; the equations are the fit's own."""

from dataclasses import dataclass

import numpy as np
import pytest

from ident.diagnosis.rows.rows import rows_of
from ident.equations.observation import DecimatedSegment, RecordingSystem


def system(label, role, seconds, hop=0.05, weight=1.0):
    """One channel, one column, the values 1, 2, ... times the weight."""
    M = round(seconds / hop)
    values = np.arange(1.0, M + 1)[None, :] * weight
    segment = DecimatedSegment(hop * np.arange(M), values, 3.0 * values, np.full((1, M), weight))

    @dataclass
    class System:
        label: str
        role: str
        payload: None
        channel: np.ndarray
        column: np.ndarray
        factors: tuple
        segments: tuple

    return System(label, role, None, np.zeros(1, int), np.zeros(1, int), (None,), (segment,))


def test_validate_runs_judge_and_test_runs_do_nothing():
    rows = rows_of([system("a", "identify", 10), system("b", "validate", 5), system("c", "test", 5)], 1)
    assert rows.held_apart and rows.names == ("a", "b", "c")
    assert np.array_equal(rows.fitted, rows.recording == 0)
    assert np.array_equal(rows.judged, rows.recording == 1)


def test_of_several_identify_runs_the_shorter_ones_judge():
    rows = rows_of([system("a", "identify", 10), system("b", "identify", 6), system("c", "identify", 30)], 1)
    assert rows.held_apart
    assert np.array_equal(rows.fitted, rows.recording == 2)
    assert np.array_equal(rows.judged, rows.recording != 2)


def test_stretches_of_the_only_run_judge():
    rows = rows_of([system("a", "identify", 60)], 1)
    assert not rows.held_apart
    assert np.array_equal(rows.fitted, ~rows.judged)
    assert 0.4 < rows.judged.mean() < 0.6
    assert np.sum(np.diff(rows.judged.astype(int)) != 0) == 11  # twelve stretches of five seconds


@pytest.mark.parametrize("weight, used", [(1.0, True), (0.6, True), (0.4, False)])
def test_rows_are_divided_by_the_share_that_counts(weight, used):
    rows = rows_of([system("a", "identify", 10, weight=weight), system("b", "validate", 10)], 1)
    mine = rows.recording == 0
    assert np.all(rows.use[0, mine] == used)
    if used:
        places, values = rows.base[0]
        assert np.allclose(rows.Y[0, mine], 3.0 * np.arange(1, 201))
        assert np.allclose(values[mine, 0], np.arange(1, 201)) and list(places) == [0]
    assert rows.hop == pytest.approx(0.05) and rows.channels == 1


def test_system_has_what_is_read():
    assert {"label", "role", "payload", "channel", "column", "factors", "segments"} <= set(
        RecordingSystem.__dataclass_fields__
    )
