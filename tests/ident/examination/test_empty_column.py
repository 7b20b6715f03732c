"""A column without any value."""

import numpy as np
import pytest
from small_arm import ARM

import ident


def test_a_position_that_was_never_recorded_is_named(tmp_path):
    (tmp_path / "small.yaml").write_text(ARM)
    t = np.arange(2000) / 200
    columns = {f"{kind}{j}": np.sin(j * t) for kind in ("q", "tau_m") for j in (1, 2, 3)}
    columns |= {"t": t, "q2": np.full(len(t), np.nan)}
    study = ident.Study(
        robot=str(tmp_path / "small.yaml"), recordings=[ident.Recording(columns, use="identify", name="run")]
    )
    with pytest.raises(ident.Error, match=r"q2 is empty"):
        ident.fit(study)
