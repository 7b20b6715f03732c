"""Long recordings are looked at in stretches: few enough rows, spread evenly, and what stands out."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from ident.diagnosis.rows.stretches import EDGE, cut_out, cuts
from ident.equations.observation import DecimatedSegment, RecordingSystem

HOP = 0.04


def system(minutes, role="identify", label="run"):
    m = round(60 * minutes / HOP)
    t = np.arange(m) * HOP
    part = DecimatedSegment(t, np.tile(t, (3, 1)), np.zeros((2, m)), np.ones((2, m)))
    return RecordingSystem(label, role, None, np.zeros(3, int), np.arange(3), (), (part,), m)


def noise(systems, seed=0):
    rng = np.random.default_rng(seed)
    return [[rng.normal(size=part.Y.shape) for part in s.segments] for s in systems]


def rows_of(chosen):
    return sum(cut.stop - cut.start for cut in chosen)


def test_short_recordings_are_looked_at_whole():
    systems = [system(1), system(1, "validate")]
    chosen = cuts(systems, 7000, lambda: (_ for _ in ()).throw(AssertionError))
    assert rows_of(chosen) == 3000 and all(cut.start == 0 for cut in chosen)


def test_an_hour_and_a_hundred_runs_leave_as_many_rows():
    for systems in ([system(60), system(60, "validate")], [system(1) for _ in range(100)]):
        sides = len({s.role for s in systems})
        chosen = cuts(systems, 7000, lambda systems=systems: noise(systems))
        assert 0.9 * 7000 * sides <= rows_of(chosen) <= 7000 * sides
        for a, b in pairwise(chosen):
            assert (a.system, a.segment) != (b.system, b.segment) or a.stop <= b.start


def test_what_happens_once_in_an_hour_is_looked_at():
    systems = [system(60)]
    rho = noise(systems)
    rho[0][0][1, 33000:33075] += 4.0  # three seconds
    chosen = cuts(systems, 7000, lambda: rho)
    assert any(cut.start <= 33000 and cut.stop >= 33075 for cut in chosen)
    assert rows_of(chosen) <= 7000


def test_a_reversals_few_rows_are_nothing_unusual():
    systems = [system(60)]
    rho = noise(systems)
    rho[0][0][0, ::700] += 30.0
    plain = cuts(systems, 7000, lambda: noise(systems))
    assert cuts(systems, 7000, lambda: rho) == plain


def test_rows_at_a_cut_do_not_count():
    whole = system(60)
    chosen = cuts([whole], 3000, lambda: noise([whole]))
    part = cut_out(whole, chosen).segments[0]
    assert not part.used[:, :EDGE].any() and not part.used[:, -EDGE:].any() and part.used[:, EDGE:-EDGE].all()
    assert np.array_equal(part.values[0], part.t)


def test_less_room_is_fewer_rows_or_refused(monkeypatch):
    from ident.diagnosis.rows import room

    def free(amount):
        monkeypatch.setattr(room, "_free", lambda: amount)
        monkeypatch.setattr(room, "_resident", lambda: 3e8)

    stream = SimpleNamespace(rate_hz=1000.0, survey=SimpleNamespace(rows=3_600_000))
    monkeypatch.setattr(room, "bytes_a_row", lambda prepared, cutoff: 42e3)
    prepared = SimpleNamespace(streams=[stream, stream])
    free(16e9)
    assert room.room_for(prepared, 10.0, None).rows == room.MOST
    less = room.room_for(prepared, 10.0, 8e8)
    assert room.LEAST <= less.rows < room.MOST and less.library < room.LIBRARY
    with pytest.raises(room.MemoryLimitError, match=r"--memory 0.5GB .* needs 0\.6"):
        room.room_for(prepared, 10.0, 5e8)
