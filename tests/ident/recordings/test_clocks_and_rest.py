"""Stamps that a clock's own are, rounded; joints whose encoder moves and which do not."""

import re

import numpy as np
import pytest
from planted import ON_RECORDINGS, planted
from recordings import motion, recording, write_parquet, write_study
from small_arm import ARM

import generated
from ident.equations.prepared import prepare_study
from ident.errors import RecordingError
from ident.estimation.fit import fit_study
from ident.examination.tables.clock import Grid, goes_on, rounded_stamps, time_stamps, uniform_clock
from ident.examination.tables.of_table import more_joints
from ident.recordings.counted_from_zero import from_zero
from ident.recordings.study import load_study

K = np.arange(6000)
GAPPED = [0, 1, 3, 4, 6, 7, 9, 10, 20, 21, 23, 24, 26, 27, 29, 30]


def stamps_told(t):
    grid = Grid()
    for part in np.array_split(t, 3):
        grid.take(np.diff(part))
    clock = uniform_clock(lambda: [t])
    return rounded_stamps("run", clock, grid, len(t)) if grid.rounded else None


@pytest.mark.parametrize("period", [0.0105, 0.0098, 0.0121])
def test_a_clock_behind_rounded_stamps(period):
    check = stamps_told(np.round(K * period, 2))
    assert check is not None and check.outcome == "mended" and f"{1 / period:.6g} Hz" in check.message


@pytest.mark.parametrize(
    ("seconds", "begin", "told"), [(1.1, 2.8, False), (1.4, 1.4, True), (1.4, 0.0, False)]
)
def test_a_rate_of_stamps_in_few_whole_seconds(seconds, begin, told):
    """50 Hz of a TX40 were told to be 39.6: where its stamps pass a whole second twice they tell it, and once
    they do not."""
    t = np.round(begin + 0.02 * np.arange(50 * seconds))
    clock = uniform_clock(lambda: [t])
    assert clock.rates is not None and clock.rates[0] <= 50.0 * (1 + 1e-9) <= clock.rates[1] * (1 + 2e-9)
    check = time_stamps("run", clock, len(t) - 2, len(t))
    assert check.outcome == ("mended" if told else "refused")
    assert "(50 to 52)" in check.message if told else "rate_hz" in check.remedy


@pytest.mark.parametrize("begin", [0.05, 0.2, 0.45, 0.6, 0.9])
def test_a_clock_of_few_whole_seconds_can_have_its_stamps(begin):
    """Of a rokae in whole seconds, which come to 99 to 101 Hz, 107 were told and used, and its velocities, or
    the clock, to be 7 % off: the line through them was told in the place of one that they can be of."""
    t = np.round(begin + 0.01 * np.arange(690))
    clock = uniform_clock(lambda: [t[:200], t[200:]])
    assert clock.rates[0] <= clock.rate_hz <= clock.rates[1] and clock.worst_s <= 0.5 * (1 + 1e-9)
    assert clock.rates == pytest.approx((100.0, 100.0), rel=0.05)  # to which a logger keeps it


def test_no_clock_is_read_into_what_lost_rows_or_jitters():
    rng = np.random.default_rng(0)
    assert stamps_told(0.01 * np.delete(K, rng.choice(K[1:-1], 300, replace=False))) is None
    assert stamps_told(0.01 * K + rng.uniform(-0.002, 0.002, len(K))) is None
    assert stamps_told(0.01 * K) is None


def test_lost_rows_of_a_long_log_do_not_ask_for_all_stamps_again():
    """All stamps at once are as long as the log; what a pass has seen is enough to know better."""
    rng = np.random.default_rng(0)
    k = np.delete(np.arange(400_000), rng.choice(np.arange(1, 399_999), 100, replace=False))
    for t, rounded in ((0.001 * k, False), (np.round(0.00105 * np.arange(400_000), 3), True)):
        grid = Grid()
        for part in np.array_split(np.diff(t), 100):
            grid.take(part)
        assert grid.other >= 100 and grid.rounded is rounded


@pytest.mark.parametrize(("set_on", "seen"), [(3.0, True), (0.0, False)])
def test_a_clock_that_was_set_is_told_from_rows_that_are_lost(set_on, seen):
    """Eight stamps of a drawn motion on either side of a gap of ten rows; of the others every third is gone,
    and none of a motion without them has set its clock."""
    t = 0.01 * np.array([0, 1, 3, 4, 6, 7, 9, 10, 11, 12, 14, 15, 17, 18, 20, 21] if seen else GAPPED)
    rng = np.random.default_rng(2)
    q = np.sin(3 * t[:, None] + [0.3, 1.9]) + 2e-4 * rng.normal(size=(16, 2))
    stamps = t + set_on * (np.arange(16) > 7)
    assert goes_on((q[:8], q[8:]), (stamps[:8], stamps[8:]), 0.01) is seen


class TestOnRecordings:
    pytestmark = ON_RECORDINGS

    @pytest.mark.parametrize("robust", [pytest.param(None, marks=pytest.mark.long), "huber"])
    def test_the_noise_of_a_resting_encoder_is_no_motion(self, tmp_path, robust):
        """Of a UR10e whose first joint rests, a micrometre of noise took the error to 72,000 %: parameters
        that only moving it shows were fitted to it."""

        def change(c):
            q1 = 0.4 + 1e-6 * np.random.default_rng(1).normal(size=len(c["t"]))
            return {**c, "q1": q1, "i1": 0 * q1} | ({"dq1": 0 * q1} if "dq1" in c else {})

        fit = fit_study(planted(tmp_path, change).with_(robust=robust))
        assert fit.full_rate_error["validate"]["total"] < 10
        assert any(check.check == "resting_joint" for check in fit.checks)

    def test_a_joint_that_rests_is_no_switch_where_its_encoder_flickers(self, tmp_path):
        """By its one step, as in the first three seconds of a UR10e: its log was refused."""

        def change(c):
            flicker = 1e-4 * (np.arange(len(c["t"])) % 7 == 0)
            return {**c, "q1": 0.4 + flicker} | ({"dq1": 0 * c["dq1"]} if "dq1" in c else {})

        told = prepare_study(planted(tmp_path, change)).streams[0].checks
        assert [(c.check, c.signals) for c in told] == [("resting_joint", ("q1",))]

    def test_no_clock_is_set_in_a_log_that_lacks_rows(self, tmp_path):
        """Of two fifths that an AIRBOT's and a UR10e's lacked the clock leapt in sixty places."""
        keep = np.random.default_rng(3).random(20_000) > 0.4
        study = planted(tmp_path, lambda c: {name: x[keep[: len(x)]] for name, x in c.items()})
        assert [s.checks for s in prepare_study(study).streams] == [(), ()]

    def test_rounded_stamps_harm_nothing(self, tmp_path):
        """At 95.2 Hz, rounded to 10 ms: it was taken for 100 Hz with rows missing."""

        def change(c):
            return {**c, "t": np.round(0.0105 * np.arange(len(c["t"])), 2)}

        fit = fit_study(planted(tmp_path, change))
        assert [s.rate_hz for s in fit.recordings] == pytest.approx([1 / 0.0105] * 2, rel=1e-4)
        assert {c.check for c in fit.checks if c.outcome == "mended"} == {"time_stamps"}

    def test_stamps_in_whole_seconds_are_no_milliseconds(self, tmp_path):
        """Of a Franka's, in one recording, t was to be taken times 0.001, or no stretch was long enough."""
        study = planted(tmp_path, lambda c: {**c, "t": np.floor(0.0105 * np.arange(len(c["t"])))})
        streams = prepare_study(study).streams
        assert [s.rate_hz for s in streams] == pytest.approx([1 / 0.0105] * 2, rel=0.02)
        assert [check.check for s in streams for check in s.checks if check.outcome == "mended"] == [
            "time_stamps"
        ] * 2


@pytest.mark.parametrize("braked", [False, True])
def test_a_joint_that_rests_keeps_its_load(tmp_path, braked):
    """Its rows were left out with those of friction that is anything, and its gravity torque with them: 97 %
    of it were told as error. A brake's torque is none of the load, and harms no other joint."""
    (tmp_path / "robot.yaml").write_text(ARM)
    model = generated.load(str(tmp_path / "robot.yaml"), "A")
    rng = np.random.default_rng(0)
    chi = 0.3 * rng.normal(size=len(model.parameters))
    for k, name in enumerate(model.parameters):
        if name.startswith(("Fv", "Fc", "Iam")):
            chi[k] = 1.0
    entries = []
    for seed, use in enumerate(("identify", "validate")):
        t, q, dq, ddq = motion(15, 200, seed, 3, 2.0)
        q[:, 2], dq[:, 2], ddq[:, 2] = 0.3, 0.0, 0.0
        tau = np.asarray(model.torque(q, dq, ddq, chi, sign=np.sign(dq))) + 0.02 * rng.normal(size=q.shape)
        tau[:, 2] = 0.02 * rng.normal(size=len(t)) if braked else tau[:, 2] + 0.3  # static friction
        q = q + 1e-6 * rng.normal(size=q.shape)
        columns = {"t": t} | {f"q{j + 1}": q[:, j] for j in range(3)}
        write_parquet(tmp_path / f"{use}.parquet", columns | {f"tau_m{j + 1}": tau[:, j] for j in range(3)})
        entries.append({"file": f"{use}.parquet", "use": use})
    fit = fit_study(load_study(write_study(tmp_path, entries, robot="robot.yaml")))
    told = fit.full_rate_error["validate"]
    assert max(told["tau_m1"], told["tau_m2"]) < 1.0
    assert braked or told["tau_m3"] < 1.0
    assert not {"Fvm3", "Fcm3"} & set(np.array(fit.estimate.parameters)[fit.estimate.active])


def test_joints_that_the_robot_does_not_have(tmp_path):
    """A UR10e's log was fitted as that of an arm of three joints without a word; a tool is none."""
    extra = {"q4": np.sin(K[:10]), "tau_m4": np.cos(K[:10]), "q5": K[:10]}
    names = ["t", *(f"{s}{j}" for s in ("q", "tau_m") for j in (1, 2, 3))]
    (check,) = more_joints("run", [*names, *extra], ("1", "2", "3"))
    assert check.outcome == "warned" and "of joint 4 are recorded" in check.message
    assert not more_joints("run", [*names, "q4", "q5"], ("1", "2", "3"))
    assert not more_joints("run", [*names, *extra], ("left1", "left2"))


def test_joints_that_are_counted_from_0(tmp_path):
    """Of an AIRBOT's log, with a gripper as joint 6, it was told that alpha and d belong a row lower; where
    the last joint is missing it was to be mapped alone."""
    names = ["t", *(f"{s}{j}" for s in ("q", "dq", "tau_m") for j in (0, 1, 2))]
    line = "columns: {q1: q0, q2: q1, q3: q2, dq1: dq0, dq2: dq1, dq3: dq2, tau_m1: tau_m0, tau_m2: tau_m1, "
    (check,) = more_joints("run", [*names, "q3", "dq3", "tau_m3"], ("1", "2", "3"))
    assert check.check == "joint_numbers" and line in check.remedy
    assert from_zero(names, (1, 2, 3)) and not from_zero(names, (1, 2, 3, 4)) and not from_zero(names, (2, 3))
    columns, _ = recording(seconds=2.0)
    shifted = {re.sub(r"\d+$", lambda m: str(int(m[0]) - 1), name): x for name, x in columns.items()}
    write_parquet(tmp_path / "run.parquet", shifted)
    with pytest.raises(RecordingError, match=r"joints are counted from 0; write columns: \{q1: q0, q2: q1"):
        prepare_study(load_study(write_study(tmp_path, [{"file": "run.parquet"}])))
