"""Which of several recordings contradicts the others, and what is said where they do not tell."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, asked_of, measured, parted, planted, strangers_log
from recordings import motion, recording, true_chi, write_parquet, write_study

import generated
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.fits.hypothesis import Asked
from ident.examination.fits.quick import Assignment, Normal, quick_of
from ident.examination.fits.samples import take
from ident.examination.fits.unexplained import _contradiction, contradicting, odd_one, unexplained
from ident.recordings.study import load_study

USES = {"a": "identify", "b": "identify", "c": "validate"}


def _asked(folder, odd, runs="abc", times=1.0):
    """Runs of one robot, of which one is another's."""
    model = generated.load("kuka_lwr4p", "A")
    for seed, name in enumerate(runs):
        columns, _ = recording(seed=seed)
        if name == odd:
            tau = times * np.asarray(model.torque(*motion(30.0, 200.0, seed)[1:], true_chi(model, 5)))
            columns |= {channel: tau[:, k] for k, channel in enumerate(model.channels)}
        write_parquet(folder / f"{name}.parquet", columns)
    study = load_study(write_study(folder, [{"file": f"{name}.parquet", "use": USES[name]} for name in runs]))
    its = prepare_study(study)
    samples = [s for use in ("identify", "validate") for s in take(its.streams, its.banks, its.columns, use)]
    quick = quick_of(its.columns, samples)
    return Asked(quick, quick.plain(), quick.fit(quick.plain()), {}, False, np.ones(7))


@pytest.mark.parametrize("odd", ["a", "b", "c", None])
def test_the_run_that_contradicts_the_others_is_blamed_and_not_what_judges(tmp_path, odd):
    """A push on a fitted run was said to be another robot in the judged one."""
    asked = _asked(tmp_path, odd)
    found = odd_one(asked.quick.samples, asked.how)
    assert (None if found is None else found.label) == odd
    if odd is not None:
        assert _contradiction(asked, ("tau_m1",), "").recording == odd


def test_of_two_runs_neither_is_blamed(tmp_path):
    asked = _asked(tmp_path, "c", "ac")
    assert odd_one(asked.quick.samples, asked.how) is None
    check = _contradiction(asked, ("tau_m1",), "")
    assert check.recording == "" and "in one of a and c" in check.message


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("zero", [0.0, 2.0])
def test_one_torque_from_another_zero_in_the_run_that_judges(tmp_path, zero):
    """Of a Franka it was foretold to 66 %, not 9 %, and nothing was said."""
    change = lambda c: c | {"tau_l1": c["tau_l1"] + zero * (c["t"] > c["t"][0] + 6.5)}  # noqa: E731
    study = planted(tmp_path, change, measured("franka_panda"))
    said = examine_fit(prepare_study(parted(study, 6.5, 9.8)))
    assert [check.signals for check in said] == [("tau_l1",)] * bool(zero)
    assert all("tau_l1 of validate starts from another zero" in check.message for check in said)
    assert all(check.recording == "validate" for check in said)


def test_torques_that_each_recording_explains_are_no_other_robot_s(tmp_path):
    """Of an AIRBOT with 5 kg in one of two fitted runs another robot's signals or its file were told."""
    asked = _asked(tmp_path, "b", times=-1.0)
    assert np.median(asked.fit.error) > 0.5
    (told,) = unexplained(asked)
    assert told.recording == "b" and "without this recording all others agree" in told.message


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_torque_that_overflows(tmp_path):
    """Of an LWR4+'s second 92 % were left, by itself 38, and nothing was said."""

    def change(log):
        most = 0.8 * np.abs(log.tables["run1"]["tau_l2"]).max()
        for table in log.tables.values():
            table["tau_l2"] = (table["tau_l2"] + most) % (2 * most) - most

    study = strangers_log(tmp_path, "kuka_lwr4plus", (0, False, True, False), change)
    (told,) = contradicting(asked_of(study))
    assert "tau_l2" in told.signals


def test_of_a_torque_that_is_taken_away_whole_nothing_is_left():
    """Rounding left less than nothing of a rokae's, and its error was no number."""
    made = [
        Normal(np.zeros((1, 1, 1)), np.zeros((1, 1, 1)), np.array([[yy]]), np.ones(1)) for yy in (-1e-9, 4)
    ]
    assert made[0].size_beside(made[1], Assignment.plain(1)) == [0.0]


@pytest.mark.long
def test_a_position_behind_noise_has_no_other_unit(tmp_path):
    """Of a Franka's first one in one of two fitted runs 10 times too large was told, or degrees."""

    def noisy(log):
        q = log.tables["run2"]["q1"]
        log.tables["run2"]["q1"] = q + 0.01 * log.rng.standard_normal(len(q))

    study = strangers_log(tmp_path, "franka_panda", (100, False, False, True), noisy)
    (check, *_) = examine_fit(prepare_study(study))
    assert (check.check, check.signals, check.recording) == ("noisy_position", ("q1",), "run2")
    assert "scale" not in check.remedy
