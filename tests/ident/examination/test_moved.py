"""The torques of a recording along another motion: the study's own columns follow it, too."""

import numpy as np
import pytest
import yaml
from planted import ON_RECORDINGS, measured

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.fits.samples import take
from modelgen.geometry.names import ParameterName


class TestOnRecordings:
    pytestmark = ON_RECORDINGS

    def test_coupled_drives_turn_with_a_joint(self):
        """A TX40's sixth motor turns with q5 + q6: it loads joint 5 by the sixth's motion and joint 6 by the
        fifth's, and of a fifth that is turned it loads joint 6 the other way."""
        prepared = prepare_study(measured("staubli_tx40"))
        columns = prepared.columns
        sample = take(prepared.streams, prepared.banks, columns, "identify")[0]
        turned = np.where(np.arange(len(columns.need.joints)) == 4, -1.0, 1.0)
        moved = sample.moved(columns, factor=turned)
        kinds = [ParameterName.of(name).kind for name in columns.parameters]
        for kind in ("Iac", "Fvc"):
            k = kinds.index(kind)
            assert np.allclose(moved.W[4, :, k], sample.W[4, :, k]) and np.abs(sample.W[5, :, k]).max() > 0
            assert np.allclose(moved.W[5, :, k], -sample.W[5, :, k])
        assert np.allclose(sample.moved(columns).W, sample.W)


@pytest.mark.long
def test_a_small_factor_of_a_position_may_be_an_eccentric_encoder(tmp_path):
    """Over a part of a turn they are alike: q1 was told to be 1.02 times too large, and nothing else."""
    kinds = ["revolute", "revolute", "prismatic", "prismatic", "revolute", "prismatic"]
    after, alpha = (0, 0, 2, 2, 3, 5), ("0", "pi", "pi", "-pi/3", "1.234", "pi/2")
    d, theta = (0, 0, -0.3, 0, 0, 0), ("q1", "q2 + 0.7", "0", "0", "q5", "-pi/2")
    r = (0.25, 0, "q3", "q4 - 0.3", 0, "q6 + 0.4")
    names = ("joint", "antecedent", "alpha", "d", "theta", "r")
    links = [dict(zip(names, row)) for row in zip(kinds, after, alpha, d, theta, r)]
    robot = {"name": "tree", "convention": "mdh", "gravity": [0, -9.81, 0], "links": links}
    (tmp_path / "tree.yaml").write_text(yaml.safe_dump(robot))
    effect = "encoder_eccentricity:1:e=0.02"
    run = ident.simulate(tmp_path / "tree.yaml", "B", [effect], duration=20, rate_hz=200, noise=1.0, seed=22)
    (told,) = [c for c in examine_fit(prepare_study(run.study)) if c.check == "angle_unit"]
    assert "q1 is about 1.02 times too large, or q1 is off by 0.022 rad once a turn" in told.message
