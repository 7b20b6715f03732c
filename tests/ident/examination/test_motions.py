"""What is wrong with positions where torques are wrong, too: every torque by itself says it."""

import numpy as np
import pyarrow as pa
import pytest
from planted import ON_RECORDINGS, asked_of, changed, measured, parted, planted, strangers_log
from small_arm import ARM

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.fits.quick import quick_of
from ident.examination.fits.samples import take
from ident.examination.fits.stretches import ByItself, all_rows
from ident.examination.fits.unexplained import contradicting, unexplained
from ident.examination.positions.motions import by_themselves, moved_positions
from ident.twin import PlannedRun, simulate


def _turned(c, *names):
    each = {x for name in names for x in (name, f"d{name}") if x in c}
    return c | {name: -c[name] for name in each}


def test_a_torque_by_itself_is_explained_whatever_its_sign_and_factor_are(tmp_path):
    (tmp_path / "small.yaml").write_text(ARM)
    runs = simulate(tmp_path / "small.yaml", runs=(PlannedRun("run1", "identify", 15.0),), seed=2).recordings
    errors = []
    for factor in (1.0, -30.0):
        c = dict(runs[0].columns)
        run = ident.Recording(pa.table(c | {"tau_m2": factor * c["tau_m2"]}), "identify", name="run1")
        made = prepare_study(ident.Study(robot=str(tmp_path / "small.yaml"), recordings=[run]))
        whole = all_rows(quick_of(made.columns, take(made.streams, made.banks, made.columns, "identify")))
        its, together = ByItself.by(whole, whole.plain()), whole.fit(whole.plain())
        assert (its.fit.error <= together.error * 1.001).all()
        errors.append(its.fit.error)
        squares = sum(its.stretches).sum(axis=0)
        assert np.allclose(np.sqrt(np.array(squares) / whole.identify.rows), its.fit.error, rtol=1e-6)
    assert np.allclose(*errors, rtol=1e-6)


def _told(study):
    asked = asked_of(study)
    return [h.check for h in moved_positions(asked, by_themselves(asked))]


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_torque_turned_beside_another_joint_s_position(tmp_path):
    """A row of the robot file was told, which left 42 % of a torque."""
    study = planted(tmp_path, lambda c: _turned(c, "i2", "q3"))
    checks = examine_fit(prepare_study(study.with_(filter=type(study.filter)())))
    assert {(c.check, c.signals) for c in checks} == {("torque_sign", ("i2",)), ("position_sign", ("q3",))}


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_joint_that_turns_the_other_way_in_a_fit_that_is_not_bad(tmp_path):
    """Of a Barrett's second, of whose torque 19 % were left for 3, it was said that gravity may point up."""

    def change(log):
        for table in log.tables.values():
            table["q2"], table["tau_m2"] = -table["q2"], -table["tau_m2"]

    study = strangers_log(tmp_path, "barrett_wam_2dof", (100, False, False, True), change)
    (told,) = examine_fit(prepare_study(study))
    assert (told.check, told.signals) == ("position_sign", ("q2", "tau_m2"))


@pytest.mark.first_case
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(
    ("robot", "change", "check", "signals"),
    [
        ("ur10e", ("q2", "q3"), "position_sign", ("q2", "q3")),  # the fourth alone is nearly their image
        ("airbot_play", ("q3", "tau_m2"), "position_sign", ("q3",)),
        ("franka_panda", ("tau_l3",), "position_zero", ("q2",)),
        ("kuka_lwr4plus", ("tau_l2",), "", ()),
        ("rokae_xmate3pro", ("tau_l5",), "", ()),
    ],
)
def test_positions_beside_turned_torques(tmp_path, robot, change, check, signals):
    zero = 0.5 if check == "position_zero" else 0.0
    study = planted(
        tmp_path, lambda c: _turned(c, *change) | {"q2": _turned(c, *change)["q2"] + zero}, measured(robot)
    )
    told = _told(study)
    assert [(c.check, c.signals) for c in told] == ([(check, signals)] if check else [])
    assert all("not tell" not in c.message for c in told)
    assert not zero or "about 0.5" in told[0].message


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(("robot", "planted_so"), [("airbot_play", True), ("airbot_play", False)])
def test_torques_that_contradict_each_other_by_no_known_fault_are_said_to(tmp_path, robot, planted_so):
    """Half of the torques in kgf m: nothing was said."""
    change = lambda c: c | {f"tau_m{j}": 0.102 * c[f"tau_m{j}"] for j in (1, 2, 3) if planted_so}  # noqa: E731
    asked = asked_of(planted(tmp_path, change, measured(robot)))
    assert [c.check for c in contradicting(asked)] == ["unrelated_torque"] * planted_so


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("band", [0.3, 0.0])
def test_a_torque_that_the_others_contradict_need_not_be_foretold_by_itself(tmp_path, band):
    """Of a dead band in a Franka's second torque nothing was said, and a diagnosis found noise."""

    def dead(x):
        return np.sign(x) * np.maximum(np.abs(x) - band * np.std(x), 0.0)

    asked = asked_of(planted(tmp_path, changed("tau_l2", dead), measured("franka_panda")))
    assert [c.signals for c in contradicting(asked)] == [("tau_l2",)] * bool(band)


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_torque_that_is_explained_by_itself_is_not_noise(tmp_path):
    """Of a Franka with a joint turned and its fifth torque in another unit the sixth was to be left out."""
    names = ("q3", "dq3", "tau_l3")
    change = lambda c: _turned(c, *names) | {"tau_l5": 0.1 * c["tau_l5"]}  # noqa: E731
    asked = asked_of(parted(planted(tmp_path, change, measured("franka_panda")), 6.5, 9.8))
    assert asked.fit.error[5] > 0.5 > asked.alone[5]
    assert list(unexplained(asked)) == []


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_file_whose_axes_are_turned_is_another_robot_s():
    """Of a rokae with a Franka's file two positions were told to be turned, and of their torques nothing."""
    study = parted(measured("rokae_xmate3pro"), 7.0, 9.7).with_(robot="franka_panda", robust=None)
    (check,) = examine_fit(prepare_study(study))
    assert check.check == "wrong_robot" and "the table of rokae_xmate3pro explains" in check.message
