"""The picture beside a finding."""

import numpy as np

from ident.diagnosis.telling.pictures import Picture


def test_it_names_itself_in_a_line():
    x = np.linspace(0.0, 1.0, 2000)
    assert repr(Picture("tau_m1", "q1", "rad", x, x, x)).endswith(
        "Picture(channel='tau_m1', against='q1', unit='rad')"
    )
