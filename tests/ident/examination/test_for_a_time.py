"""A robot that is pushed for a while, beside what one stretch alone shows."""

from dataclasses import replace

import numpy as np
import pytest
from planted import ON_RECORDINGS, asked_of, measured, planted, strangers_log, ur10e

from benchmarks.strangers_faults import weighing
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.rivals.for_a_time import Stretches, for_a_time
from ident.examination.rivals.recordings_apart import halves_apart

pytestmark = ON_RECORDINGS


def _pushed(c):
    """Ten of fifty seconds, in which all torques are another 1.5 of their sizes."""
    t = c["t"] - c["t"][0] - 26.0
    for j in range(1, 7):
        c = c | {f"i{j}": c[f"i{j}"] + 1.5 * np.std(c[f"i{j}"]) * np.exp(-((t / 4) ** 2)) * np.cos(4 * t + j)}
    return c


@pytest.mark.long
def test_a_robot_that_is_pushed_for_a_while(tmp_path):
    """Of a UR10e's torques 17 % were left for 5, and nothing was said."""
    fitted, judged = ur10e().recordings
    path = planted(tmp_path, _pushed, ur10e().with_(recordings=(fitted,))).recording_path(fitted)
    study = ur10e().with_(recordings=(fitted.model_copy(update={"file": str(path)}), judged))
    (told,) = examine_fit(prepare_study(study))
    assert told.check == "unrelated_torque" and told.recording == fitted.label
    assert "i3" in told.signals and "for that time" in told.message
    assert 15.0 < float(told.message.split()[1]) < 26.0


@pytest.mark.long
def test_a_torque_that_other_runs_explain_is_no_noise(tmp_path):
    """Of an AIRBOT that was touched in one run nothing of the first torque was explained: noise, or another
    signal."""

    def change(log):
        log.hit = ["run1"]

        def force(table, g):
            at = (np.arange(len(table["t"])) / len(table["t"]) - 0.4) * 10
            return np.outer(np.sin(np.pi * at) * ((at > 0) & (at < 1)), [18.0, 18.0, 15.0])

        weighing(log, force, 1.0, tool=True)

    study = strangers_log(tmp_path, "airbot_play", (0, False, True, False), change)
    (told,) = examine_fit(prepare_study(study))
    assert told.recording == "run1" and told.message.startswith("from 8.51 to 12.6 s tau_m1, tau_m2, tau_m3 ")


def test_a_robot_as_it_is_and_a_joint_that_moves_for_a_while_only():
    asked = asked_of(ur10e())
    assert not list(for_a_time(asked))
    its = Stretches.of(asked)
    assert its.moves_elsewhere([3])
    thin = [replace(s.thin, dq=s.dq * (np.arange(6) != 2)) for s in its.samples]
    still = [s if k == 3 else replace(s, thin=thin[k]) for k, s in enumerate(its.samples)]
    assert not replace(its, samples=tuple(still)).moves_elsewhere([3])


def test_two_torques_exchanged_in_half_of_a_recording(tmp_path):
    """Of a UR10e's 46 % were left for 5, and nothing was said."""

    def change(log):
        table = log.tables["run1"]
        later, i2, i3 = table["t"] > np.median(table["t"]), table["i2"], table["i3"]
        table["i2"], table["i3"] = np.where(later, i3, i2), np.where(later, i2, i3)

    (told,) = halves_apart(asked_of(strangers_log(tmp_path, "ur10e", (50, False, True, False), change)))
    assert told.signals == ("tau_m2", "tau_m3") and told.recording == "run1"
    assert told.message.startswith("in the second half of run1 ")
    assert not list(halves_apart(asked_of(ur10e())))


def test_a_joint_that_rests_in_a_recording_has_friction_of_any_size():
    """A clean AIRBOT's last torque was to be another signal in the second half of one."""
    assert not list(halves_apart(asked_of(measured("airbot_play"))))


@pytest.mark.long
def test_a_half_that_goes_with_the_other_is_not_alone(tmp_path):
    """Of a TX40 whose last torques were 1.7 times too large in all of a run the other half was to be used."""

    def change(log):
        log.tables["run3"] |= {f"tau_m{j}": 1.7 * log.tables["run3"][f"tau_m{j}"] for j in (4, 5, 6)}

    study = strangers_log(tmp_path, "staubli_tx40", (0, False, False, True), change)
    for check in halves_apart(asked_of(study)):
        assert "the other half goes with it: a load" in check.message and "other half" not in check.remedy


def test_a_half_that_may_go_with_the_other(tmp_path):
    """Of a KR 300 with its last torque in the fifth one in all of a run the other half was to be used."""

    def change(log):
        table = log.tables["run2"]
        table["tau_m5"] = table["tau_m5"] - table["tau_m6"]

    (told,) = halves_apart(asked_of(strangers_log(tmp_path, "kuka_kr300", (100, False, True, False), change)))
    assert told.signals == ("tau_m5",) and "do not tell whether the other half" in told.message
    assert "from:" not in told.remedy
