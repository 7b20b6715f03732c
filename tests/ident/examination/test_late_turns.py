"""Friction that comes late where joints turn round is no torque that is recorded late."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, asked_of, measured, parted, planted, strangers_log
from recordings import motion, write_parquet, write_study
from small_arm import ARM

import generated
from benchmarks.false_findings import make
from ident.equations.prepared import prepare_study
from ident.examination.asking import asked_of as asked_of_all
from ident.examination.examine import examine_fit
from ident.examination.fits.stretches import Explained, all_rows
from ident.examination.one_recording.changed_in_one import torques_in_one
from ident.examination.torques.delays import FITTED_S, delays
from ident.examination.undone import unsettled
from ident.recordings.study import load_study
from modelgen.effects import catalogue
from modelgen.effects.states import integrate_dahl

RATE, TRAVEL, STEP = 250.0, 8e-5, 2e-5  # Hz; rad over which dry friction gives way; rad


def said(folder, top, late):
    """Checks of two runs of an arm no faster than `top` [rad/s], of Dahl's friction, whose torques are
    recorded so many samples late."""
    (folder / "robot.yaml").write_text(ARM)
    model = generated.load(str(folder / "robot.yaml"), "A")
    rng = np.random.default_rng(4)
    chi = 0.1 * rng.normal(size=len(model.parameters))
    for k, name in enumerate(model.parameters):
        if name.startswith(("Fv", "Fc", "Iam")):
            chi[k] = 1.0
    for k in range(2):
        t, q, dq, ddq = motion(60, RATE, k, 3, 0.5)
        small = top / np.abs(dq).max(axis=0)
        q, dq, ddq = small * q, small * dq, small * ddq
        z = np.stack([integrate_dahl(x, {"width": TRAVEL}, 0.0) for x in q.T], axis=1)
        tau = np.asarray(model.torque(q, dq, ddq, chi, sign=z)) + 0.01 * rng.normal(size=(len(t), 3))
        tau = np.concatenate([tau[:1].repeat(late, axis=0), tau[: len(t) - late]])
        columns = {"t": t} | {f"q{j + 1}": STEP * np.rint(q[:, j] / STEP) for j in range(3)}
        write_parquet(folder / f"run{k}.parquet", columns | {f"tau_m{j + 1}": tau[:, j] for j in range(3)})
    entries = [{"file": "run0.parquet"}, {"file": "run1.parquet", "use": "validate"}]
    study = load_study(write_study(folder, entries, robot="robot.yaml"))
    return {c.check: c for c in examine_fit(prepare_study(study))}


@pytest.mark.first_case
@pytest.mark.parametrize("top", [0.005, 0.01, 0.02])
def test_presliding_is_no_delay(tmp_path, top):
    assert "channel_delay" not in said(tmp_path, top, 0)


@pytest.mark.first_case
@pytest.mark.parametrize("seed", [96, 441, 3208, 3179])
def test_slow_turns_of_joints_in_coarse_steps_and_starts_from_rest(tmp_path, seed):
    """Clean arms of the rate's benchmark, of which all torques were told to be 0.05 or 0.02 s early, 0.03 s
    late, and of one that starts from rest the last to be 0.02 s late."""
    make(seed, tmp_path)
    said = {c.check for c in examine_fit(prepare_study(load_study(tmp_path / "study.yaml")))}
    assert "channel_delay" not in said


def test_a_delay_is_one(tmp_path):
    check = said(tmp_path, 1.0, 25)["channel_delay"]
    assert "ident diagnose fits the delay" in check.remedy and not check.open


def test_a_delay_that_a_diagnosis_does_not_fit_stands_in_all_that_is_told(tmp_path):
    """Of a Barrett whose torques are 0.3 s late it was told that the diagnosis fits it, and that nothing
    known explains what is left."""
    (bound,) = catalogue()["time_delay"].linear
    assert (bound.low, bound.high) == (-FITTED_S, FITTED_S)
    check = said(tmp_path, 1.0, 38)["channel_delay"]
    assert "stamps by -0.15 s" in check.remedy and unsettled([check]) == (check,)


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(
    ("rate", "words", "fallen"),
    [(1.01, "1 % too slow:", "25 to 7 %"), (0.995, "0.5 % too fast, or all torques are ", "18 to 7 %")],
)
def test_torques_by_a_clock_of_another_rate(tmp_path, rate, words, fallen):
    """They were told to be 0.3 s before the positions, which left 17 % of 25; or a first joint to be late,
    and two others to have a hysteresis."""

    def change(c):
        t = c["t"] - c["t"][0]
        return c | {k: np.interp(rate * t, t, x) for k, x in c.items() if k.startswith("i")}

    told = max(delays(asked_of(planted(tmp_path, change))), key=lambda h: h.gain)
    assert len(told.check.signals) == 6 and f"clock of the torques runs about {words}" in told.check.message
    assert f"from {fallen}" in told.check.message


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_late_torque_is_not_those_that_gain_by_themselves(tmp_path):
    """Beside a rokae's third torque, 0.04 s late, the last ones, which gain by a delay as they are, were."""

    def late(c):
        return c | {"tau_l3": np.interp(c["t"] - 0.04, c["t"], c["tau_l3"])}

    study = parted(planted(tmp_path, late, measured("rokae_xmate3pro")), 7.0, 9.7)
    told = [h.check for h in delays(asked_of(study))]
    assert [c.signals for c in told] == [("tau_l3",)] and ", or tau" not in told[0].message


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_torque_of_a_fast_arm_that_is_a_little_late(tmp_path):
    """Of a TX40's second one, 0.03 s, 12 % were left for 4, and nothing was said."""

    def change(log):
        for table in log.tables.values():
            table["tau_m2"] = np.interp(table["t"] - 0.03, table["t"], table["tau_m2"])

    study = strangers_log(tmp_path, "staubli_tx40", (100, False, False, False), change)
    (told,) = examine_fit(prepare_study(study))
    assert told.check == "channel_delay" and told.message.startswith("tau_m2 is recorded about 0.03 s after")


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(("late", "words"), [(0.015, "about 0.015 s"), (0.017, "about 0.02 s")])
def test_torques_that_are_late_in_the_run_that_judges(tmp_path, late, words):
    """Of a TX40's behind a filter of 0.02 s nothing was said, and 24 % were left for 11; nor of 0.015 s, half
    a sample from those that were tried."""

    def change(log):
        run = log.tables["run2"]
        for name in [name for name in run if name.startswith("tau")]:
            run[name] = np.interp(run["t"] - late, run["t"], run[name])

    study = strangers_log(tmp_path, "staubli_tx40", (100, False, True, False), change)
    asked = asked_of_all(prepare_study(study))
    before = Explained.by(all_rows(asked.quick), asked.how)
    every = [its for its in torques_in_one(asked, before.quick, before) if its.check == "channel_delay"]
    told = [its for its in every if its.explained.fit.gain_over(before.fit) > its.least]
    assert [(its.recording, len(its.signals)) for its in told] == [("run2", 6)]
    assert words in told[0].words and "after the positions or smoothed as much" in told[0].words


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.filterwarnings("error")
def test_of_fewer_rows_than_parameters_errors_are_none(tmp_path):
    """Of a TX40's first second and a half, at 100 Hz, a warning of NumPy's was all that was said of it."""

    def change(log):
        log.study["recordings"] = log.study["recordings"][:1]
        log.tables = {"run1": log.tables["run1"]}
        for table in log.tables.values():
            t = table["t"]
            rows = np.searchsorted(t, t[0] + 0.01 * np.floor((t - t[0]) / 0.01)).clip(max=len(t) - 1)
            table |= {k: x[rows] for k, x in table.items() if k[:3] == "tau"}

    examine_fit(prepare_study(strangers_log(tmp_path, "staubli_tx40", (100, False, False, True), change)))
