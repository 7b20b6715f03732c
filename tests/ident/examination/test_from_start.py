"""Positions that count from the start of each recording, planted in measured ones."""

import pytest
from planted import ON_RECORDINGS, planted, strangers_log, ur10e

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.tables.from_start import from_start

pytestmark = ON_RECORDINGS


@pytest.mark.parametrize(("which", "told"), [("123456", True), ("12345", False), ("", False)])
def test_positions_that_begin_at_zero(tmp_path, which, told):
    """In all recordings, of all joints."""
    taken = lambda c: {k: x - x[0] if k[0] == "q" and k[1:] in which else x for k, x in c.items()}  # noqa: E731
    prepared = prepare_study(planted(tmp_path, taken, ur10e()))
    assert len(list(from_start(prepared.streams))) == told


@pytest.mark.long
def test_which_is_said_beside_what_nothing_tells(tmp_path):
    """Of a UR10e a load, a zero or another robot alone was."""

    def taken(log):
        for table in log.tables.values():
            table |= {f"q{j}": table[f"q{j}"] - table[f"q{j}"][0] for j in range(1, 7)}

    (*others, last) = examine_fit(
        prepare_study(strangers_log(tmp_path, "ur10e", (0, False, False, True), taken))
    )
    assert others and "all positions begin at exactly 0" in last.message
