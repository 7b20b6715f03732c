"""The clock of one recording beside another's: in ms, or at another rate; planted in a measured recording."""

import re
from importlib.resources import files

import numpy as np
import pytest
import yaml
from planted import ON_RECORDINGS, measured, parted, planted, refused, strangers_log, ur10e

from ident.equations.prepared import prepare_study
from ident.examination.asking import asked_of
from ident.examination.examine import examine_fit
from ident.examination.fits.quick import Normal
from ident.examination.one_recording.another_clock import Timed
from ident.examination.undone import unsettled
from ident.recordings.study import ColumnMap

pytestmark = ON_RECORDINGS


def _run_at(factor, role):
    """Four seconds of a TX40's 5 kHz, the stamps of those of one role times a factor."""
    study, out = parted(measured("staubli_tx40"), 2.8, 3.9), []
    for entry in study.recordings:
        if entry.use == role:
            ends = {key: x and factor * x for key in ("from_s", "to_s") for x in (getattr(entry, key),)}
            clock = {"t": ColumnMap(column="t", scale=factor)}
            entry = entry.model_copy(update={**ends, "columns": clock})
        out.append(entry)
    return study.with_(recordings=tuple(out))


@pytest.mark.parametrize("role", ["identify", "validate"])
def test_a_recording_in_ms_beside_one_in_s(role):
    """5 samples a second are slow, and no more: another robot or another load was told of what judges."""
    message, checks = refused(_run_at(1000.0, role))
    assert checks == {"time_unit"} and "t looks recorded in ms" in message


@pytest.mark.long
@pytest.mark.parametrize(("role", "factor"), [("validate", 2.0), ("identify", 1.25)])
def test_a_recording_whose_clock_runs_at_another_rate(role, factor):
    (said,) = examine_fit(prepare_study(_run_at(factor, role)))
    assert (said.check, said.signals, said.recording) == ("clock_rate", ("t",), role)
    told = float(said.message.split("t is ")[1].split()[0])
    assert told == pytest.approx(factor, rel=0.05) and "too large" in said.message


@pytest.mark.long
def test_clocks_that_agree():
    assert not examine_fit(prepare_study(_run_at(1.0, "validate")))


@pytest.mark.long
@pytest.mark.parametrize(("factor", "told"), [(2.0, True), (1.0, False)])
def test_the_clock_of_all_recordings(tmp_path, factor, told):
    """Of a Franka whose clock ran at half of its rate nothing was said: 16 % foretold for 2 %."""
    half = lambda c: {k: x / factor if k == "t" else x for k, x in c.items() if k[:2] != "dq"}  # noqa: E731
    study = planted(tmp_path, half, measured("franka_panda"))
    checks = examine_fit(prepare_study(parted(study, 6.5 / factor, 9.8 / factor)))
    assert [(c.check, c.signals) for c in checks] == ([("clock_rate", ("t",))] if told else [])
    if told:
        said = float(checks[0].message.split("t is ")[1].split()[0])
        assert said == pytest.approx(factor, rel=0.03) and "too small" in checks[0].message
        assert unsettled(checks) == checks


@pytest.mark.long
def test_two_rows_of_a_table_exchanged_are_no_clock(tmp_path):
    """Of a Franka, beside what is turned so, a clock of a third was told."""
    robot = yaml.safe_load(files("modelgen").joinpath("robots/franka_panda.yaml").read_text("utf-8"))
    for key in ("alpha", "r"):
        two, three = robot["links"][1:3]
        two[key], three[key] = three[key], two[key]
    (tmp_path / "rows.yaml").write_text(yaml.safe_dump(robot))
    (entry, *_) = measured("franka_panda").recordings
    study = parted(measured("franka_panda").with_(recordings=(entry,)), 7.8, 10.4)
    study = planted(tmp_path, lambda c: {k: x for k, x in c.items() if k[:2] != "dq"}, study)
    checks = examine_fit(prepare_study(study.with_(robot=str(tmp_path / "rows.yaml"))))
    assert "clock_rate" not in {c.check for c in checks}


@pytest.mark.first_case
@pytest.mark.parametrize(("factor", "told"), [(2.0, True), (0.5, True), (1.0, False)])
@pytest.mark.long
def test_a_clock_by_which_little_more_is_explained(tmp_path, factor, told):
    """Of a UR10e's nothing was said: 7 % were left for 5, and inertias came out four times too large."""
    study = ur10e()
    study = study.with_(filter=type(study.filter)())
    other = lambda c: {k: factor * x if k == "t" else x for k, x in c.items() if k[:2] != "dq"}  # noqa: E731
    checks = examine_fit(prepare_study(planted(tmp_path, other, study)))
    assert [(c.check, c.signals) for c in checks] == ([("clock_rate", ("t",))] if told else [])
    if told:
        least, most = map(float, re.search(r"clock, ([\d.]+) to ([\d.]+) by", checks[0].message).groups())
        assert least < max(factor, 1 / factor) < most and "robot file's lengths are" in checks[0].message


@pytest.mark.long
@pytest.mark.parametrize("rates", [True, False])
def test_a_position_behind_noise_is_no_clock(tmp_path, rates):
    """Of an LWR4+'s third one it was told that t may be 17.6 times too small."""

    def noisy(log):
        q = log.tables["run1"]["q3"]
        log.tables["run1"]["q3"] = q + 0.03 * log.rng.standard_normal(len(q))

    study = strangers_log(tmp_path, "kuka_lwr4plus", (0, False, rates, True), noisy)
    checks = examine_fit(prepare_study(study))
    assert "noisy_position" in {c.check for c in checks} and "its clock" not in str(checks)


def test_sums_along_any_clock_are_those_of_the_rows_so_timed():
    """A KR 300's, forty times as slow and as fast."""
    asked = asked_of(prepare_study(measured("kuka_kr300")))
    quick, s = asked.quick, asked.quick.samples[0]
    timed = Timed.of(quick.columns, s)
    for rate in (1 / 40, 0.3, 1.0, 40.0):
        rows, made = Normal.of(s.timed(quick.columns, rate)), timed.at(rate)
        size = np.sqrt(np.einsum("cii->ci", rows.G))
        size = np.where(size > 1e-9 * size.max(), size, np.inf)[:, :, None]
        assert np.abs((rows.G - made.G) / size / size.swapaxes(1, 2)).max() < 1e-9
        assert np.allclose(rows.v, made.v, rtol=1e-9, atol=1e-12 * np.abs(rows.v).max())
