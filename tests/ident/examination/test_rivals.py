"""Everyday faults that look like a torque's factor, planted in measured recordings: none is told as one."""

from itertools import product

import numpy as np
import pyarrow.parquet as pq
import pytest
from planted import ON_RECORDINGS, asked_of, measured, parted, planted, strangers_log, ur10e
from scipy.signal import butter, lfilter, lfilter_zi

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.rivals.scales import scales

pytestmark = ON_RECORDINGS


def _said(study):
    return examine_fit(prepare_study(study))


def _half(t):
    return t > 0.5 * (t[0] + t[-1])


@pytest.mark.long
def test_a_square_is_no_factor(tmp_path):
    """3.4 was told of a Franka's first torque."""
    square = lambda c: c | {"tau_l1": c["tau_l1"] * np.abs(c["tau_l1"])}  # noqa: E731
    told = scales(asked_of(planted(tmp_path, square, measured("franka_panda"))))
    assert all("or tau_l1 is recorded as the square of itself" in its.check.message for its in told)


@pytest.mark.long
@pytest.mark.parametrize(
    ("robot", "kind", "c", "k"),
    [
        ("ur10e", "i", 2, 3),
        ("ur10e", "i", 3, 2),
        ("barrett_wam_2dof", "tau_m", 2, 1),
        ("airbot_play", "tau_m", 3, 2),
    ],
)
def test_a_share_of_another_torque_is_no_factor(tmp_path, robot, kind, c, k):
    """It was told as a pair of factors, of an AIRBOT without the share beside it."""
    mixed = lambda x: x | {f"{kind}{c}": x[f"{kind}{c}"] + 0.3 * x[f"{kind}{k}"]}  # noqa: E731
    assert "torque_scale" not in {check.check for check in _said(planted(tmp_path, mixed, measured(robot)))}


def _coarse(c):
    """In steps of a 2000th of what each signal spans in its run."""
    runs = np.digitize(c["t"] - c["t"][0], [6.5, 9.8])
    out = {k: x.astype(float) for k, x in c.items()}
    for k, run in product(set(c) - {"t"}, range(3)):
        step = np.ptp(c[k][runs == run]) / 2000
        out[k][runs == run] = np.round(c[k][runs == run] / step) * step
    return out


@pytest.mark.long
@pytest.mark.parametrize(("share", "recorder"), [(0.25, dict), (0.2, _coarse)])
def test_what_drifts_in_one_run_alone_is_no_factor(tmp_path, share, recorder):
    """A Franka's sixth torque was told to be 1.2 times too large, which explains half as much."""

    def drifts(c):
        t = c["t"] - c["t"][0]
        drift = share * np.std(c["tau_l6"][t < 6.5]) * (t / 6.5) * (t < 6.5)
        return (its := recorder(c)) | {"tau_l6": its["tau_l6"] + drift}

    (check,) = _said(parted(planted(tmp_path, drifts, measured("franka_panda")), 6.5, 9.8))
    assert "tau_l6 of identify drifts by" in check.message and "tau_l6 is" not in check.message[:90]


@pytest.mark.long
def test_a_share_that_looks_like_a_pair_of_factors_is_told_with_them(tmp_path):
    mixed = lambda x: x | {"tau_m2": x["tau_m2"] + 0.3 * x["tau_m3"]}  # noqa: E731
    (check,) = _said(planted(tmp_path, mixed, measured("airbot_play")))
    assert "tau_m2 takes up 0.3" in check.message and "nothing tells by what" in check.message


FRANKA = {
    "a share": (lambda c: c | {"tau_l3": c["tau_l3"] + 0.3 * c["tau_l2"]}, "tau_l3 takes up 0.3 of tau_l2:"),
    "a position's scale": (
        lambda c: {k: v for k, v in c.items() if k != "dq3"} | {"q3": 0.9 * c["q3"]},
        "q3 is about 1.11 times too small:",
    ),
    "another zero": (
        lambda c: c | {"q4": c["q4"] + np.deg2rad(30)},
        "q4 starts from another zero, 0.55 rad off:",
    ),
    "a drift": (
        lambda c: c | {"tau_l2": c["tau_l2"] + 2 * np.std(c["tau_l2"]) * c["t"] / np.ptp(c["t"])},
        "tau_l2 drifts by",
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("fault", FRANKA)
def test_what_validate_alone_tells_is_told_as_what_it_is(tmp_path, fault):
    """Of six seconds: only factors of torques and gravity were asked, so one of these was told."""
    change, words = FRANKA[fault]
    (check,) = _said(parted(planted(tmp_path, change, measured("franka_panda")), 6.5, 9.8))
    assert check.check == "poor_excitation" and words in check.message


@pytest.mark.long
def test_a_position_with_another_one_s_is_told_by_all_recordings(tmp_path):
    """It was said that it would explain what judges."""

    def both(c):
        return c | {"q4": c["q4"] + c["q3"], "dq4": c["dq4"] + c["dq3"]}

    (check,) = _said(parted(planted(tmp_path, both, measured("franka_panda")), 6.5, 9.8))
    assert (check.check, check.signals) == ("coupled_position", ("q4",))
    assert "sum of q4 and q3" in check.message


@pytest.mark.long
def test_a_factor_in_what_judges_is_told_there_with_a_load(tmp_path):
    """It was all that the motions were said not to show."""
    half = lambda c: c | {"tau_l2": np.where(_half(c["t"]), 1.3, 1.0) * c["tau_l2"]}  # noqa: E731
    (check,) = _said(parted(planted(tmp_path, half, measured("franka_panda")), 6.5, 9.8))
    assert (check.check, check.signals, check.recording) == ("torque_scale", ("tau_l2",), "validate")
    assert "tau_l2 is 1.3 times too large" in check.message and "or a load is carried" in check.message


@pytest.mark.long
def test_friction_that_grows_with_the_load_is_told_as_that(tmp_path):
    """Nothing was said of a Franka's second joint; of a simulated one's third that its torque was 1.16 times
    too small in one recording."""
    rubs = lambda c: c | {"tau_l2": c["tau_l2"] + 0.3 * np.abs(c["tau_l2"]) * np.sign(c["dq2"])}  # noqa: E731
    (check,) = _said(planted(tmp_path, rubs, measured("franka_panda")))
    assert check.check == "poor_excitation" and "friction of joint 2 changes with its load" in check.message


def _five_seconds(study):
    """Of what validates, with the default filter."""
    short = [r if r.use == "identify" else r.model_copy(update={"to_s": 5.0}) for r in study.recordings]
    return study.with_(recordings=tuple(short), filter=type(study.filter)())


@pytest.mark.first_case
@pytest.mark.parametrize(
    "change",
    [
        lambda c: c | {"tau_m2": 1.3 * c["tau_m2"]},
        lambda c: c | {"q3": c["q3"] + 0.2},
        lambda c: c | {"q4": c["q4"] + 0.2},
        lambda c: c | {"tau_m5": c["tau_m5"] + 0.3 * c["tau_m4"]},
    ],
    ids=["factor", "zero of 3", "zero of 4", "share"],
)
@pytest.mark.long
def test_a_slow_motion_blames_nothing_of_what_it_cannot_foretell(tmp_path, change):
    """Of a KR 300 'tau_m1 times 40' was told: validate happened to be foretold so. Fitted together the
    recordings do not contradict each other without the fault, and by no signal of them with it."""
    said = _said(_five_seconds(planted(tmp_path, change, measured("kuka_kr300"))))
    assert not any(check.signals or "takes up" in check.message for check in said)


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("c", "k", "size"),
    [
        ("tau_m4", "tau_m3", 0.28),
        pytest.param("tau_m2", "tau_m3", 0.3, marks=pytest.mark.xfail(reason="that a signal is not as told")),
    ],
)
@pytest.mark.long
def test_a_share_that_only_validate_shows_is_no_drift(tmp_path, c, k, size):
    """What takes most of a torque away leaves large errors in shares of the rest, few in N m."""
    mixed = lambda x: x | {c: x[c] + 0.3 * x[k]}  # noqa: E731
    (check,) = _said(_five_seconds(planted(tmp_path, mixed, measured("kuka_kr300"))))
    assert f"why: {c} takes up {size} of {k}: this alone" in check.message


@pytest.mark.long
def test_a_sensor_that_was_tared_anew_between_two_recordings(tmp_path):
    """Another robot, load or signal was told, or that the torque is half as large in one of them."""
    tared = lambda x: x | {"tau_l4": x["tau_l4"] - 11.0 * (x["t"] - x["t"][0] > 7.0)}  # noqa: E731
    (check,) = _said(parted(planted(tmp_path, tared, measured("rokae_xmate3pro")), 7.0, 9.7))
    told = check.message.split("why: ")[1].split(":")[0].split("; ")
    assert {its.replace("identify", "").replace("validate", "").split(", ")[0] for its in told} == {
        "tau_l4 of  starts from another zero"
    }


@pytest.mark.long
def test_a_share_of_a_large_torque_in_a_small_one_is_no_drift(tmp_path):
    """A rokae's first sensor carries next to nothing, its second one gravity."""
    mixed = lambda x: x | {"tau_l1": x["tau_l1"] + 0.3 * x["tau_l2"]}  # noqa: E731
    (check,) = _said(parted(planted(tmp_path, mixed, measured("rokae_xmate3pro")), 7.0, 9.7))
    assert "tau_l1 takes up 0.3 of tau_l2" in check.message and "drifts" not in check.message


@pytest.mark.parametrize(("joint", "zero"), [(2, 0.2)])
@pytest.mark.long
def test_a_zero_that_only_validate_shows_is_no_other_signal(tmp_path, joint, zero):
    moved = lambda x: x | {f"q{joint}": x[f"q{joint}"] + zero}  # noqa: E731
    (check,) = _said(parted(planted(tmp_path, moved, measured("rokae_xmate3pro")), 7.0, 9.7))
    assert f"why: q{joint} starts from another zero, {'-' if zero < 0 else ''}0." in check.message


def test_a_position_turned_is_not_all_torques_and_the_other_position(tmp_path):
    turned = lambda c: {k: v for k, v in c.items() if k != "dq2"} | {"q2": -c["q2"]}  # noqa: E731
    study = planted(tmp_path, turned, measured("barrett_wam_2dof"))
    assert [(c.check, c.signals) for c in _said(study)] == [("position_sign", ("q2",))]


def test_the_largest_lag_that_is_tried_is_not_told(tmp_path):
    """A torque that grows by a third within both recordings was a second late in one."""
    grows = lambda c: c | {"tau_m2": np.where(_half(c["t"]), 1.3, 1.0) * c["tau_m2"]}  # noqa: E731
    study = planted(tmp_path, grows, measured("barrett_wam_2dof"))
    whole, judging = study.recordings[:2]
    short = judging.model_copy(update={"from_s": 0.0, "to_s": 2.2, "use": "validate"})
    study = study.with_(recordings=(whole.model_copy(update={"from_s": None, "to_s": None}), short))
    assert "channel_delay" not in {c.check for c in _said(study)}


@pytest.mark.long
def test_an_axis_is_not_told_by_one_torque_alone():
    """An LWR4+ as it is had a turned link 6, which only its last torque, hardly any, seemed to show."""
    study = measured("kuka_lwr4plus")
    assert "joint_axis" not in {c.check for c in _said(_lwr4plus(study))}


def _kr300(folder, **change):
    """traj_a.parquet fitted and five seconds of traj_b.parquet, each changed."""
    study = measured("kuka_kr300")
    for entry in study.recordings:
        one = entry.model_copy(update={"use": "identify"})
        planted(folder, change.get(entry.label, lambda c: c), study.with_(recordings=(one,)))
    return _five_seconds(study.with_(folder=str(folder)))


@pytest.mark.long
def test_a_factor_of_one_recording_is_told_beside_one_of_a_part_of_it(tmp_path):
    """Of a KR 300 "from about 1.62 s on" alone was told."""
    (check,) = _said(_kr300(tmp_path, traj_a=lambda c: c | {"tau_m3": 0.7 * c["tau_m3"]}))
    assert "tau_m3 of traj_a is 0.72 times as large or a load is carried in one of the two" in check.message


@pytest.mark.long
def test_another_robot_s_run_is_no_torque_s_factor(tmp_path):
    """Of a KR 300 the sixth torque was 0.0134 times too large in a UR10e's run, whose others are 40 to 150
    times too small as well."""
    entry = ur10e().recordings[0]
    table = pq.read_table(ur10e().recording_path(entry))
    of_ur = {name: table[name].to_numpy() for name in table.column_names}
    motor = {f"tau_m{j}": 11.0 * of_ur[f"i{j}"] for j in range(1, 7)}
    (check,) = _said(_kr300(tmp_path, traj_b=lambda c: {k: v for k, v in of_ur.items() if k in c} | motor))
    assert check.check == "unrelated_torque" and check.open and "another robot or load" in check.message


@pytest.mark.long
def test_a_position_that_is_too_large_is_told_beside_a_share_of_another_torque(tmp_path):
    """A TX40's fifth drive is coupled with its sixth one."""
    larger = lambda c: c | {"q5": 2.5 * c["q5"]}  # noqa: E731
    (check,) = _said(parted(planted(tmp_path, larger, measured("staubli_tx40")), 2.8, 4.9))
    assert "q5 is about 2.66 times too large" in check.message and "something else" in check.message


def _lwr4plus(study):
    """One trajectory and a part of another one fitted, a second of its rounds judged."""
    a, b = {r.file: r for r in study.recordings}.values()
    runs = [
        a.model_copy(update={"use": "identify", "name": "a", "from_s": 1.0, "to_s": 24.0}),
        b.model_copy(update={"use": "identify", "name": "b", "from_s": None, "to_s": 14.0}),
        b.model_copy(update={"use": "validate", "name": "c", "from_s": 14.0, "to_s": None}),
    ]
    return study.with_(recordings=tuple(runs), filter=type(study.filter)())


@pytest.mark.long
def test_positions_that_are_smoothed_are_no_torque_that_is_early(tmp_path):
    """Of all positions of an LWR4+ 0.11 s late the fourth torque, the most exact one, was told as early."""

    def smoothed(c):
        b, a = butter(2, 2.0 * 2.0 * np.median(np.diff(c["t"])))
        q = {f"q{j}": c[f"q{j}"] for j in range(1, 8)}
        late = {name: lfilter(b, a, x, zi=lfilter_zi(b, a) * x[0])[0] for name, x in q.items()}
        return {k: v for k, v in c.items() if not k.startswith("dq")} | late

    (check,) = _said(_lwr4plus(planted(tmp_path, smoothed, measured("kuka_lwr4plus"))))
    assert "all torques are recorded about 0.1 s before" in check.message


@pytest.mark.long
def test_clipped_torques_are_in_no_other_order(tmp_path):
    """Of an LWR4+ with all torques clipped joints 5 and 7 were told as exchanged. That what is left of them
    does not show which way is down may be said."""

    def clipped(c):
        most = {f"tau_l{j}": 0.6 * np.abs(c[f"tau_l{j}"]).max() for j in range(1, 8)}
        return c | {k: np.clip(c[k], -m, m) for k, m in most.items()}

    said = _said(_lwr4plus(planted(tmp_path, clipped, measured("kuka_lwr4plus"))))
    assert all("how the base is mounted" in check.message for check in said)


@pytest.mark.long
def test_half_of_the_torques_late(tmp_path):
    """Of a KR 300 all of them were, or the fifth."""
    late = lambda c: c | {f"tau_m{j}": np.roll(c[f"tau_m{j}"], 25) for j in (4, 5, 6)}  # noqa: E731
    (check,) = _said(_five_seconds(planted(tmp_path, late, measured("kuka_kr300"))))
    assert check.check == "channel_delay" and "tau_m4, tau_m5, tau_m6 are recorded about" in check.message


@pytest.mark.long
def test_half_of_the_torques_in_another_unit_are_no_factor_of_one_behind_them(tmp_path):
    """Of a UR10e with its first three torques in kgf m the fourth was ten times too large."""
    unit = lambda c: c | {f"i{j}": 0.102 * c[f"i{j}"] for j in (1, 2, 3)}  # noqa: E731
    (check,) = _said(planted(tmp_path, unit))
    assert (check.check, check.signals) == ("torque_scale", ("i4", "i5", "i6"))
    low, high = (float(x) for x in check.message.split("(")[1].split(")")[0].split(" to "))
    assert low < 1 / 0.102 < high and check.remedy.startswith("write ")


@pytest.mark.long
def test_a_torque_that_leaps_is_told_as_that(tmp_path):
    """Of a KR 300 'tau_m2 takes up 0.66 of tau_m3' was told."""
    leaps = lambda c: c | {"tau_m2": c["tau_m2"] + _half(c["t"]) * np.std(c["tau_m2"])}  # noqa: E731
    (check,) = _said(_kr300(tmp_path, traj_a=leaps))
    assert "why: tau_m2 of traj_a is off by 1.4e+03 N m from about 4.98 s on" in check.message


@pytest.mark.long
def test_zeros_of_the_torques_of_one_recording_are_no_position_s(tmp_path):
    """Of a KR 300 with tared torques in one recording q2 started 3.1 rad off."""
    tared = lambda c: c | {f"tau_m{j}": c[f"tau_m{j}"] - c[f"tau_m{j}"][0] for j in range(1, 7)}  # noqa: E731
    assert "position_zero" not in {check.check for check in _said(_kr300(tmp_path, traj_a=tared))}


@pytest.mark.long
def test_a_magnitude_is_not_told_as_turned(tmp_path):
    """Of a KR 300 with the magnitude of a torque in one recording it had the other sign in the other."""
    size = lambda c: c | {"tau_m2": np.abs(c["tau_m2"])}  # noqa: E731
    assert "torque_sign" not in {check.check for check in _said(_kr300(tmp_path, traj_a=size))}


@pytest.mark.long
def test_a_torque_in_per_cent_is_told_alone_with_the_factors_that_the_others_allow(tmp_path):
    """The first two torques of a UR10e in another unit than the others are rejected beside it."""
    (check,) = _said(planted(tmp_path, lambda c: c | {"i2": 0.37 * c["i2"]}))
    low, high = (float(x) for x in check.message.split("(")[1].split(")")[0].split(" to "))
    assert check.remedy.startswith("columns: {i2: {scale: 2.7") and low < 1 / 0.37 < high


@pytest.mark.long
def test_a_position_that_loses_counts(tmp_path):
    """Of an LWR4+'s third it was told to be swapped with the sixth."""

    def change(log):
        for table in log.tables.values():
            table["q3"] = table["q3"] + 0.3 * (table["t"] - table["t"][0]) / np.ptp(table["t"])

    study = strangers_log(tmp_path, "kuka_lwr4plus", (0, False, False, False), change)
    (told, *_) = examine_fit(prepare_study(study))
    assert "or q3 drifts by 0.7" in told.message
