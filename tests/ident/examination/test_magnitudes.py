"""A torque that is recorded without its sign."""

from dataclasses import replace

import numpy as np
import pytest
from planted import ON_RECORDINGS, asked_of, measured, parted, planted, strangers_log

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.fits.hypothesis import CLEARLY
from ident.examination.fits.stretches import all_rows
from ident.examination.one_recording.changed import unsigned
from ident.examination.torques.magnitudes import magnitudes
from ident.examination.torques.turned import one_turned

pytestmark = ON_RECORDINGS


def test_a_magnitude_is_told_and_no_torque_of_one_sign(tmp_path):
    """Of a Franka's third torque, that passes zero five times in what is fitted, the other sign was told. Its
    first torques are of one sign for most of the time, and nothing is said of them."""
    study = parted(measured("franka_panda"), 6.5, 9.8)
    assert list(magnitudes(asked_of(study))) == []
    asked = asked_of(planted(tmp_path, lambda c: c | {"tau_l3": np.abs(c["tau_l3"])}, study))
    (told,) = magnitudes(asked)
    assert told.check.signals == ("tau_l3",) and "without its sign" in told.check.message
    assert told.gain > max((h.gain for h in one_turned(asked)), default=0.0)


def test_a_magnitude_of_one_recording(tmp_path):
    """Of its second torque in the run that is fitted the other sign was told."""
    fitted = lambda c: np.where(c["t"] < c["t"][0] + 6.5, np.abs(c["tau_l2"]), c["tau_l2"])  # noqa: E731
    study = parted(measured("franka_panda"), 6.5, 9.8)
    asked = asked_of(planted(tmp_path, lambda c: c | {"tau_l2": fitted(c)}, study))
    whole = all_rows(asked.quick)
    one, *others = whole.samples
    turned = whole.of([replace(one, Y=one.Y * [1, -1, 1, 1, 1, 1, 1]), *others])
    (told,) = (its for its in unsigned(asked, whole, ["identify", "validate"]) if its.signals == ("tau_l2",))
    assert told.recording == "identify"
    assert told.explained.fit.gain_over(turned.fit(asked.how)) > CLEARLY


@pytest.mark.long
def test_of_a_torque_that_is_mostly_friction_the_magnitude_is_told_beside_the_sign(tmp_path):
    """A KR 300's fourth had the other sign, and the line that turns it leaves as much."""

    def change(log):
        for table in log.tables.values():
            table["tau_m4"] = abs(table["tau_m4"])

    study = strangers_log(tmp_path, "kuka_kr300", (0, False, True, False), change)
    (told,) = examine_fit(prepare_study(study))
    assert told.check == "torque_sign" and "or tau_m4 is recorded without its sign" in told.message
