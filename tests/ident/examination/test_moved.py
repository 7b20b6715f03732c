"""The torques of a recording along another motion: the study's own columns follow it, too."""

import numpy as np
from planted import ON_RECORDINGS, measured

from ident.equations.prepared import prepare_study
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
