"""Everyday faults that look like a torque's factor, planted in measured recordings: none is told as one."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, measured, parted, planted

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit

pytestmark = ON_RECORDINGS


def _said(study):
    return examine_fit(prepare_study(study))


def _half(t):
    return t > 0.5 * (t[0] + t[-1])


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


def test_a_share_that_looks_like_a_pair_of_factors_is_told_with_them(tmp_path):
    mixed = lambda x: x | {"tau_m2": x["tau_m2"] + 0.3 * x["tau_m3"]}  # noqa: E731
    (check,) = _said(planted(tmp_path, mixed, measured("airbot_play")))
    assert "or tau_m2 takes up 0.3" in check.message and "do not tell which" in check.message


FRANKA = {
    "a share": (lambda c: c | {"tau_l3": c["tau_l3"] + 0.3 * c["tau_l2"]}, "tau_l3 takes up 0.3 of tau_l2:"),
    "a position's scale": (
        lambda c: {k: v for k, v in c.items() if k != "dq3"} | {"q3": 0.9 * c["q3"]},
        "q3 is 1.11 times too small:",
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


@pytest.mark.parametrize("fault", FRANKA)
def test_what_validate_alone_tells_is_told_as_what_it_is(tmp_path, fault):
    """Of six seconds: only factors of torques and gravity were asked, so one of these was told."""
    change, words = FRANKA[fault]
    (check,) = _said(parted(planted(tmp_path, change, measured("franka_panda")), 6.5, 9.8))
    assert check.check == "poor_excitation" and words in check.message


def test_a_factor_in_what_judges_is_told_there_with_a_load(tmp_path):
    """It was all that the motions were said not to show."""
    half = lambda c: c | {"tau_l2": np.where(_half(c["t"]), 1.3, 1.0) * c["tau_l2"]}  # noqa: E731
    (check,) = _said(parted(planted(tmp_path, half, measured("franka_panda")), 6.5, 9.8))
    assert (check.check, check.signals, check.recording) == ("torque_scale", ("tau_l2",), "validate")
    assert "tau_l2 is 1.3" in check.message and "times too large, or a load is carried" in check.message


def _five_seconds(study):
    """Of what validates, with the default filter."""
    short = [r if r.use == "identify" else r.model_copy(update={"to_s": 5.0}) for r in study.recordings]
    return study.with_(recordings=tuple(short), filter=type(study.filter)())


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
def test_a_slow_motion_blames_nothing_of_what_it_cannot_foretell(tmp_path, change):
    """Of a KR 300 'tau_m1 times 40' was told: validate happened to be foretold so. Fitted together the
    recordings do not contradict each other, with the fault in them or without."""
    assert _said(_five_seconds(planted(tmp_path, change, measured("kuka_kr300")))) == ()


@pytest.mark.parametrize(("c", "k", "size"), [("tau_m4", "tau_m3", 0.28), ("tau_m2", "tau_m3", 0.3)])
def test_a_share_that_only_validate_shows_is_no_drift(tmp_path, c, k, size):
    """What takes most of a torque away leaves large errors in shares of the rest, few in N m."""
    mixed = lambda x: x | {c: x[c] + 0.3 * x[k]}  # noqa: E731
    (check,) = _said(_five_seconds(planted(tmp_path, mixed, measured("kuka_kr300"))))
    assert f"why: {c} takes up {size} of {k}: this alone" in check.message


def test_a_share_of_a_large_torque_in_a_small_one_is_no_drift(tmp_path):
    """A rokae's first sensor carries next to nothing, its second one gravity."""
    mixed = lambda x: x | {"tau_l1": x["tau_l1"] + 0.3 * x["tau_l2"]}  # noqa: E731
    (check,) = _said(parted(planted(tmp_path, mixed, measured("rokae_xmate3pro")), 7.0, 9.7))
    assert "tau_l1 takes up 0.3 of tau_l2" in check.message and "drifts" not in check.message


@pytest.mark.parametrize(("joint", "zero"), [(2, 0.2), (3, -0.5), (5, -0.5)])
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


def test_an_axis_is_not_told_by_one_torque_alone():
    """An LWR4+ as it is had a turned link 6, which only its last torque, hardly any, seemed to show."""
    study = measured("kuka_lwr4plus")
    a, b = {r.file: r for r in study.recordings}.values()
    runs = [
        a.model_copy(update={"use": "identify", "name": "a", "from_s": 1.0, "to_s": 24.0}),
        b.model_copy(update={"use": "identify", "name": "b", "from_s": None, "to_s": 14.0}),
        b.model_copy(update={"use": "validate", "name": "c", "from_s": 14.0, "to_s": None}),
    ]
    study = study.with_(recordings=tuple(runs), filter=type(study.filter)())
    assert "joint_axis" not in {c.check for c in _said(study)}
