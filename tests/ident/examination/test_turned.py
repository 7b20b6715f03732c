"""A joint's torque or position with the other sign, planted in measured recordings: the right one of the two
is named, or both where the recordings do not tell."""

import pyarrow.parquet as pq
import pytest
from planted import ON_RECORDINGS, asked_of, measured, parted, planted

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.torques.signs import all_signs
from ident.examination.torques.turned import all_turned
from ident.examination.undone import mended_study

pytestmark = ON_RECORDINGS


def _turned(folder, robot, name):
    """The robot's study with a signal turned in all recordings, of a position with its rate."""
    names = {name, f"d{name}", f"dd{name}"}
    study = measured(robot)
    return planted(folder, lambda c: {k: -v if k in names else v for k, v in c.items()}, study)


def _five_seconds(study):
    short = [r if r.use == "identify" else r.model_copy(update={"to_s": 5.0}) for r in study.recordings]
    return study.with_(recordings=tuple(short), filter=type(study.filter)())


@pytest.mark.first_case
@pytest.mark.parametrize("joint", [2, 5])
@pytest.mark.parametrize(("signal", "check"), [("tau_m", "torque_sign"), ("q", "position_sign")])
@pytest.mark.long
def test_what_a_joint_shares_with_others_tells_its_torque_from_its_position(tmp_path, joint, signal, check):
    """A KR 300 is slow: its own friction alone says that a sign is wrong, and fits either."""
    study = _five_seconds(_turned(tmp_path, "kuka_kr300", f"{signal}{joint}"))
    (said,) = examine_fit(prepare_study(study))
    assert (said.check, said.signals) == (
        check,
        (f"{signal}{joint}",),
    ) and "not tell which" not in said.message


@pytest.mark.long
@pytest.mark.parametrize("signal", ["q6"])
def test_where_a_joint_shares_nothing_both_are_named(tmp_path, signal):
    study = _five_seconds(_turned(tmp_path, "kuka_kr300", signal))
    (said,) = examine_fit(prepare_study(study))
    assert "tau_m6 has the other sign, or q6 has the other sign" in said.message
    assert "columns: {tau_m6: {sign: -1}}  # or columns: {q6: {sign: -1}, dq6: {sign: -1}}" in said.remedy
    assert examine_fit(prepare_study(mended_study(study, [said]))) == ()


@pytest.mark.long
@pytest.mark.parametrize(("signal", "check"), [("q1", "position_sign")])
def test_a_first_position_turned_is_not_its_torque(tmp_path, signal, check):
    (said,) = examine_fit(prepare_study(_turned(tmp_path, "airbot_play", signal)))
    assert (said.check, said.signals) == (check, (signal,))


@pytest.mark.long
def test_a_joint_that_turns_the_other_way(tmp_path):
    """Half a turn in the row behind it explains as much, and was told."""
    change = lambda c: c | {name: -c[name] for name in ("q2", "dq2", "i2") if name in c}  # noqa: E731
    turned = planted(tmp_path, change, measured("ur10e"))
    study = turned.with_(filter=type(turned.filter)())
    (said,) = examine_fit(prepare_study(study))
    assert (said.check, said.signals) == ("position_sign", ("q2", "i2"))
    assert "the axis of joint 2 (link 2) points the other way" in said.message
    assert examine_fit(prepare_study(mended_study(study, [said]))) == ()


@pytest.mark.long
def test_a_position_turned_is_not_two_exchanged_ones(tmp_path):
    """Joints of an LWR4+ follow one signal; its last torque, hardly any, refused the right answer."""
    study = _turned(tmp_path, "kuka_lwr4plus", "q4")
    a, b = sorted({r.file: r for r in study.recordings}.values(), key=lambda r: r.file)
    runs = [
        a.model_copy(update={"use": "identify", "name": "a", "from_s": 1.0, "to_s": 24.0}),
        b.model_copy(update={"use": "identify", "name": "b", "from_s": None, "to_s": 14.0}),
        b.model_copy(update={"use": "validate", "name": "c", "from_s": 14.0, "to_s": 19.0}),
    ]
    study = study.with_(recordings=tuple(runs), filter=type(study.filter)())
    (said,) = examine_fit(prepare_study(study))
    assert (said.check, said.signals) == ("position_sign", ("q4",))


@pytest.mark.first_case
@pytest.mark.parametrize(("robot", "name"), [("barrett_wam_2dof", "tau_m2"), ("airbot_play", "tau_m1")])
def test_a_run_turned_all_along_has_no_torque_that_turns_on_the_way(tmp_path, robot, name):
    study = measured(robot)
    fitted = [study.recording_path(r) for r in study.recordings if r.use == "identify"]
    length = pq.read_metadata(fitted[-1]).num_rows
    turned = planted(tmp_path, lambda c: c | {name: -c[name]} if len(c["t"]) == length else c, study)
    said = examine_fit(prepare_study(turned))
    assert said and not any("changes its sign" in check.message for check in said)


@pytest.mark.parametrize("what", ["tau", "q"])
def test_all_torques_or_all_positions(tmp_path, what):
    """Friction and inertia say either, gravity which (of a Franka's positions all torques were told)."""
    study = parted(measured("franka_panda"), 6.5, 9.8)
    change = lambda c: {k: -v if k.lstrip("d").startswith(what) else v for k, v in c.items()}  # noqa: E731
    asked = asked_of(planted(tmp_path, change, study))
    torques = all_signs(asked)
    told = all_turned(asked, torques)
    assert {name.rstrip("1234567") for name in told.check.signals} == {"tau_l" if what == "tau" else "q"}
    assert "not tell which" not in told.check.message and len(told.check.signals) == 7


@pytest.mark.long
def test_all_positions_turned_foretell_what_all_torques_turned_do_not(tmp_path):
    """Of an AIRBOT's positions all torques were told, and with them two whole joints."""
    study = measured("airbot_play")
    change = lambda c: {k: -v if k[0] == "q" else v for k, v in c.items() if k[0] != "d"}  # noqa: E731
    runs = [next(r for r in study.recordings if r.use == use) for use in ("identify", "validate")]
    turned = planted(tmp_path, change, study.with_(recordings=tuple(runs), filter=type(study.filter)()))
    (said,) = examine_fit(prepare_study(turned))
    assert said.check == "position_sign" and said.signals == tuple(f"q{j}" for j in range(1, 7))


@pytest.mark.long
def test_all_positions_turned_in_a_run_that_foretells_no_other(tmp_path):
    """An LWR4+'s first run, explained to 29 %, foretells the second worse than nothing as it is: of turned
    positions nothing was said."""
    change = lambda c: {k: -v if k.lstrip("d")[0] == "q" else v for k, v in c.items()}  # noqa: E731
    study = measured("kuka_lwr4plus")
    a, b = sorted({r.file: r for r in study.recordings}.values(), key=lambda r: r.file)
    runs = (
        a.model_copy(update={"use": "identify", "from_s": 1.0, "to_s": None}),
        b.model_copy(update={"use": "validate", "from_s": 12.55, "to_s": 18.3}),
    )
    turned = planted(tmp_path, change, study.with_(recordings=runs, filter=type(study.filter)()))
    (said,) = examine_fit(prepare_study(turned))
    assert said.check == "torque_sign" and len(said.signals) == 7
    assert "all torques have the other sign, or all positions have the other sign" in said.message


@pytest.mark.long
def test_two_torques_turned_where_the_last_ones_may_have_any_sign(tmp_path):
    """Of an LWR4+ the fourth was told, which was not turned."""
    study = measured("kuka_lwr4plus")
    turned = ("tau_l1", "tau_l3")
    change = lambda c: {k: -v if k in turned else v for k, v in c.items() if k[0] != "d"}  # noqa: E731
    a, b = sorted({r.file: r for r in study.recordings}.values(), key=lambda r: r.file)
    runs = (
        a.model_copy(update={"use": "identify", "name": "a", "from_s": 1.0, "to_s": 16.0}),
        b.model_copy(update={"use": "validate", "name": "b", "from_s": 14.0, "to_s": 19.0}),
    )
    study = planted(tmp_path, change, study.with_(recordings=runs, filter=type(study.filter)()))
    (said,) = examine_fit(prepare_study(study))
    assert (said.check, said.signals) == ("torque_sign", turned)
    assert "than tau_l2, tau_l4:" in said.message
