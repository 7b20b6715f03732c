"""What may stand in the place of what was found is named with it, though nothing had asked for it then."""

import pytest
from planted import with_fault

import ident


@pytest.mark.long
def test_a_spring_where_joints_move_alike(tmp_path):
    """Of an LWR4+'s third joint: a coupling to the second came before it, which moves as it does, then a
    crosstalk of its sensor, and the spring had never been asked."""
    path = with_fault("kuka_lwr4plus", "a spring on joint 3", tmp_path)
    document = ident.diagnose(ident.load(path)).document()
    told = [f for f in document["findings"] if 3 in f["joints"]]
    assert all("spring" in {f["effect"], *(a["effect"] for a in f["alternatives"])} for f in told)
