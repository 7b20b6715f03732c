"""A term that a study leaves out though its torques ask for it."""

import pytest
from planted import ON_RECORDINGS, measured, parted, planted

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit

pytestmark = ON_RECORDINGS


@pytest.mark.long
@pytest.mark.parametrize("term", ["viscous_friction", "offset:1"])
def test_of_a_tx40(tmp_path, term):
    """25 % were left without viscous friction for 4, and a fit said nothing; an offset says no more."""
    study = parted(measured("staubli_tx40"), 2.8, 3.9).with_(without=(term,))
    study = planted(tmp_path, lambda c: {k: x[::50] for k, x in c.items()}, study)
    said = [c.message.split(", and")[0] for c in examine_fit(prepare_study(study))]
    assert said == (["the study leaves out viscous friction"] if term == "viscous_friction" else [])
