"""What may stand in the place of what was found is named with it, though nothing had asked for it then."""

import pytest

import ident
from benchmarks.planted_faults import BASES, DATA, FAULTS, planted


@pytest.mark.long
@pytest.mark.skipif(
    not (DATA / "kuka_lwr4plus").is_dir(), reason="the recordings of measured robots are not here"
)
def test_a_spring_where_joints_move_alike(tmp_path):
    """Of an LWR4+'s third joint: a coupling to the second came before it, which moves as it does, then a
    crosstalk of its sensor, and the spring had never been asked."""
    (base,) = (b for b in BASES if b.robot == "kuka_lwr4plus")
    (fault,) = (f for f in FAULTS if f.name == "a spring on joint 3")
    document = ident.diagnose(ident.load(planted(base, fault, tmp_path))).document()
    told = [f for f in document["findings"] if 3 in f["joints"]]
    assert all("spring" in {f["effect"], *(a["effect"] for a in f["alternatives"])} for f in told)
