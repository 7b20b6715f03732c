"""Numbers that are none: a logger's largest one and infinities, where positions, torques or stamps stand."""

import numpy as np
import pytest
from small_arm import ARM

import ident

pytestmark = pytest.mark.unexamined


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("infinite")
    (folder / "small.yaml").write_text(ARM)
    return ident.simulate(folder / "small.yaml", duration=12, rate_hz=100, noise=1.0, seed=3)


def study_of(made, change):
    first, *others = made.study.recordings
    table = {name: np.array(x, dtype=float) for name, x in made.recordings[first.name].items()}
    change(table)
    return made.study.with_(recordings=(ident.Recording(table, use=first.use, name="changed"), *others))


@pytest.mark.parametrize("column", ["q1", "tau_m2"])
@pytest.mark.parametrize("number", [np.inf, -np.inf, 1e308])
def test_some_are_left_out_in_silence(made, column, number):
    """(Of infinities NumPy's own warnings were printed.)"""

    def change(table):
        table[column][300:305] = number

    fit = ident.fit(study_of(made, change))
    plain = ident.fit(made.study)
    assert fit.result.full.chi == pytest.approx(plain.result.full.chi, abs=5 * plain.result.full.std.max())


def test_of_stamps_they_are_refused(made):
    def change(table):
        table["t"][300:305] = np.inf

    with pytest.raises(ident.Error, match=r"changed: time runs backwards"):
        ident.fit(study_of(made, change))
