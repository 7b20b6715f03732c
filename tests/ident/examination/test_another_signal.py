"""A signal that is another one in one recording alone."""

import re
from contextlib import nullcontext

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from planted import ON_RECORDINGS, asked_of, measured, parted, planted, strangers_log
from small_arm import ARM

import ident
from benchmarks.strangers_faults import weighing
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.one_recording.another_signal import another_signal
from ident.examination.undone import mended_study, undoing
from ident.recordings.study import ColumnMap
from ident.twin import PlannedRun, simulate

CHAIN = """\
name: chain
convention: mdh
gravity: [0, 0, -9.81]
links:
  - {joint: revolute, antecedent: 0, alpha: 0, d: 0, theta: q1, r: 0}
  - {joint: revolute, antecedent: 1, alpha: pi/2, d: 0, theta: q2 + pi/2, r: 0}
  - {joint: revolute, antecedent: 2, alpha: 0, d: 0.184, theta: q3, r: 0}
  - {joint: revolute, antecedent: 3, alpha: -pi/2, d: 0.166, theta: q4, r: 0}
"""
POSITIONS = ("position_sign", "position_zero", "angle_unit", "swapped_signals", "base_orientation")


def said(checks):
    return [(c.check, c.signals, c.recording) for c in checks if c.check in POSITIONS]


def _five_seconds(study):
    short = [r if r.use == "identify" else r.model_copy(update={"to_s": 5.0}) for r in study.recordings]
    return study.with_(recordings=tuple(short), filter=type(study.filter)())


def in_the_long_run(change):
    return lambda columns: columns | (change(columns) if np.ptp(columns["t"]) > 40 else {})


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(("joint", "factor", "check"), [(2, -1.0, "position_sign")])
def test_of_a_measured_robot_one_position_in_the_run_that_is_fitted(tmp_path, joint, factor, check):
    """Turned or in degrees in that run alone: it was told of all recordings, or was unknown."""
    names = [f"{d}q{joint}" for d in ("", "d", "dd")]
    change = in_the_long_run(lambda c: {name: factor * c[name] for name in names if name in c})
    study = planted(tmp_path, change)
    checks = examine_fit(prepare_study(study))
    assert said(checks) == [(check, (f"q{joint}",), "excite_a_50s")]
    turned, other = (entry.columns for entry in mended_study(study, checks).recordings)
    assert not other and turned[f"q{joint}"].sign * turned[f"q{joint}"].scale == pytest.approx(1 / factor)
    assert turned[f"dq{joint}"] == turned[f"q{joint}"].model_copy(update={"column": f"dq{joint}"})


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_of_a_measured_robot_one_torque_turned_in_the_run_that_is_fitted(tmp_path):
    """The run that judges was nothing like what the other said of its motion."""
    study = planted(tmp_path, in_the_long_run(lambda c: {"i2": -c["i2"]}))
    checks = examine_fit(prepare_study(study))
    assert [(c.check, c.signals, c.recording) for c in checks] == [("torque_sign", ("i2",), "excite_a_50s")]
    turned, other = (entry.columns for entry in mended_study(study, checks).recordings)
    assert turned["i2"].sign == -1 and not other


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.long
def test_of_a_measured_robot_the_run_whose_joint_was_homed_anew(tmp_path):
    """20 degrees in the run that is fitted: the run that judges was blamed."""
    study = planted(tmp_path, in_the_long_run(lambda c: {"q2": c["q2"] + np.radians(20.0)}))
    assert said(examine_fit(prepare_study(study))) == [("position_zero", ("q2",), "excite_a_50s")]


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(("joint", "factor"), [(3, 57.29578)])
def test_of_a_measured_robot_one_position_in_all_runs(tmp_path, joint, factor):
    names = [f"{d}q{joint}" for d in ("", "d", "dd")]
    study = planted(tmp_path, lambda c: c | {name: factor * c[name] for name in names if name in c})
    with pytest.raises(ident.Error) if factor > 1 else nullcontext():
        assert not any(recording for _, _, recording in said(examine_fit(prepare_study(study))))


@pytest.mark.first_case
@pytest.mark.parametrize(
    "request_", ["position_zero:2:zero=1.5707963,recording=run1", "payload_change:m=2,recording=run1"]
)
def test_a_quarter_turn_in_one_run_is_told_and_a_load_is_none(tmp_path, request_):
    (tmp_path / "small.yaml").write_text(ARM)
    made = simulate(tmp_path / "small.yaml", effects=(request_,), seed=3)
    runs = [ident.Recording(pa.table(dict(r.columns)), r.use, name=r.label) for r in made.recordings]
    checks = ident.fit(ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs)).checks
    zero = request_.startswith("position")
    assert said(checks) == ([("position_zero", ("q2",), "run1")] if zero else [])


@pytest.mark.first_case
@pytest.mark.parametrize(("names", "check"), [(("tau_m2",), "torque_sign"), (("q2",), "position_sign")])
def test_one_signal_turned_in_the_only_fitted_run_which_is_explained_all_the_same(tmp_path, names, check):
    """A fit takes it up, and predicts the run that judges worse than nothing would."""
    (tmp_path / "small.yaml").write_text(ARM)
    plan = (PlannedRun("run1", "identify", 20.0), PlannedRun("run2", "validate", 15.0))
    made = simulate(tmp_path / "small.yaml", runs=plan, seed=4)
    runs = []
    for its in made.recordings:
        turned = {name: -its.columns[name] for name in names} if its.label == "run1" else {}
        runs.append(ident.Recording(pa.table(dict(its.columns) | turned), its.use, name=its.label))
    checks = ident.fit(ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs)).checks
    found = [c for c in checks if c.check in ("torque_sign", "position_sign")]
    assert [(c.check, c.signals, c.recording) for c in found] == [(check, names, "run1")]
    assert "do not tell" not in found[0].message


@pytest.mark.first_case
@pytest.mark.parametrize("turned", ["run1", "run2"])
def test_all_torques_turned_in_one_of_two_runs_of_which_friction_tells_which(tmp_path, turned):
    """They were late in all of a Barrett's, or two of each turned."""
    (tmp_path / "small.yaml").write_text(ARM)
    plan = (PlannedRun("run1", "identify", 15.0), PlannedRun("run2", "validate", 10.0))
    made = simulate(tmp_path / "small.yaml", runs=plan, seed=4)
    runs = [
        ident.Recording(pa.table(_other_torques(r, (-1, -1, -1), (1, 2, 3), turned)), r.use, name=r.label)
        for r in made.recordings
    ]
    study = prepare_study(ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs))
    found = [(c.check, c.recording) for c in examine_fit(study) if "other sign" in c.message]
    assert found == [("torque_sign", turned)]


def _other_torques(its, factors, order, label="run1"):
    """The simulated torques of a run in other places and times numbers."""
    named = {f"tau_m{j}": its.columns[f"tau_m{k}"] * f for j, k, f in zip((1, 2, 3), order, factors)}
    return dict(its.columns) | (named if its.label == label else {})


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("factors", "order", "check", "names"),
    [
        ((1, 1, 1), (1, 3, 2), "swapped_signals", ("tau_m2", "tau_m3")),
        ((1, 1.5, 1), (1, 2, 3), "torque_scale", ("tau_m2",)),
        ((1.3, 1.3, 1.3), (1, 2, 3), "torque_scale", ("tau_m1", "tau_m2", "tau_m3")),
    ],
)
def test_other_torques_in_the_only_fitted_run(tmp_path, factors, order, check, names):
    (tmp_path / "small.yaml").write_text(ARM)
    plan = (PlannedRun("run1", "identify", 20.0), PlannedRun("run2", "validate", 15.0))
    made = simulate(tmp_path / "small.yaml", runs=plan, seed=4)
    runs = [
        ident.Recording(pa.table(_other_torques(r, factors, order)), r.use, name=r.label)
        for r in made.recordings
    ]
    study = ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs)
    told = [c for c in ident.fit(study).checks if c.check in ("swapped_signals", "torque_scale")]
    assert [(c.check, c.signals) for c in told] == [(check, names)]
    assert "a load" not in told[0].message and (told[0].recording == "run1" or "in run1" in told[0].message)
    if check == "torque_scale":  # no more exactly than these recordings tell it
        low, high = map(float, re.search(r"too \w+ \(([\d.]+) to ([\d.]+)\)", told[0].message).groups())
        assert low < max(factors) < high < 1.1 * low and 0 < told[0].spread < 0.03


@pytest.mark.long
@pytest.mark.parametrize(
    "request_", ["payload_change:link=2,m=2,recording=run1", "payload_change:m=2,recording=run2"]
)
def test_a_load_is_no_factor_of_a_torque(tmp_path, request_):
    (tmp_path / "small.yaml").write_text(ARM)
    plan = (PlannedRun("run1", "identify", 20.0), PlannedRun("run2", "validate", 15.0))
    made = simulate(tmp_path / "small.yaml", effects=(request_,), runs=plan, seed=4)
    runs = [ident.Recording(pa.table(dict(r.columns)), r.use, name=r.label) for r in made.recordings]
    checks = ident.fit(ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs)).checks
    assert not {"torque_scale", "swapped_signals", "torque_sign"} & {c.check for c in checks}


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("pair", [(2, 3)])
@pytest.mark.long
def test_of_a_measured_robot_two_torques_swapped_in_the_run_that_is_fitted(tmp_path, pair):
    """Of a TX40 one was told to change its sign within the run, of the other pair nothing was said."""
    a, b = (f"tau_m{j}" for j in pair)

    def swap(c):
        first = c["t"] - c["t"][0] < 2.8
        return {a: np.where(first, c[b], c[a]), b: np.where(first, c[a], c[b])}

    study = planted(tmp_path, lambda c: c | swap(c), measured("staubli_tx40"))
    (entry,) = {r.file: r for r in study.recordings}.values()
    runs = [
        entry.model_copy(update={"use": use, "name": use, "from_s": begin, "to_s": end})
        for use, begin, end in (("identify", None, 2.8), ("validate", 2.8, 3.9))
    ]
    study = study.with_(recordings=tuple(runs), filter=type(study.filter)())
    told = [(c.check, c.signals, c.recording) for c in examine_fit(prepare_study(study))]
    assert told == [("swapped_signals", (a, b), "identify")]


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize(("robot", "signal", "factor"), [("ur10e", "i3", 0.7)])
def test_of_a_measured_robot_one_torque_scaled_in_the_run_that_is_fitted(tmp_path, robot, signal, factor):
    """It was twice as large, or a load was carried, or it was so from nine seconds on."""
    study = planted(tmp_path, in_the_long_run(lambda c: {signal: factor * c[signal]}))
    checks = examine_fit(prepare_study(study))
    assert [(c.check, c.signals, c.recording) for c in checks] == [
        ("torque_scale", (signal,), "excite_a_50s")
    ]
    scaled, other = (entry.columns for entry in mended_study(study, checks).recordings)
    assert scaled[signal].scale == pytest.approx(1 / factor, rel=0.02) and not other


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("changed", "check", "names"),
    [
        (lambda c: {k: -c[k] for k in ("q2", "tau_m2")}, "position_sign", ("q2", "tau_m2")),
        (
            lambda c: {
                k: c[b] for k, b in zip(("q2", "q3", "tau_m2", "tau_m3"), ("q3", "q2", "tau_m3", "tau_m2"))
            },
            "swapped_signals",
            ("q2", "q3", "tau_m2", "tau_m3"),
        ),
        (
            lambda c: {f"tau_m{j}": np.interp(c["t"] - 0.1, c["t"], c[f"tau_m{j}"]) for j in (1, 2, 3)},
            "channel_delay",
            ("tau_m1", "tau_m2", "tau_m3"),
        ),
        (lambda c: {f"q{j}": np.rad2deg(c[f"q{j}"]) for j in (1, 2, 3)}, "angle_unit", ("q1", "q2", "q3")),
    ],
)
def test_joints_and_clocks_of_one_recording(tmp_path, changed, check, names):
    """Of a Franka whose second joint turned the other way in one recording q3 was told from another zero; of
    a TX40 with all positions of one in degrees it was said that they look it, and 1219 % were left."""
    (tmp_path / "small.yaml").write_text(ARM)
    plan = (PlannedRun("run1", "identify", 20.0), PlannedRun("run2", "validate", 15.0))
    made = simulate(tmp_path / "small.yaml", runs=plan, seed=4)
    runs = []
    for its in made.recordings:
        c = {k: np.asarray(x) for k, x in its.columns.items() if k[0] != "d"}
        other = changed(c) if its.label == "run2" else {}
        runs.append(ident.Recording(pa.table(c | other), its.use, name=its.label))
    told = ident.fit(ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs)).checks
    assert [(c.check, c.signals, c.recording) for c in told if c.check == check] == [(check, names, "run2")]


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_position_that_was_not_recorded_is_no_other_one(tmp_path):
    """Of an LWR4+ whose fourth one stands still the fourth and the seventh were told to be exchanged."""
    stands = lambda c: c | {"q4": 0 * c["q4"] + c["q4"][0], "dq4": 0 * c["q4"]}  # noqa: E731
    study = planted(tmp_path, stands, measured("kuka_lwr4plus"))
    signals = [s for c in examine_fit(prepare_study(study)) for s in c.signals]
    assert set(signals) <= {"q4"}


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_position_that_one_recording_lacks_is_no_other_one(tmp_path):
    """Of an LWR4+ whose fourth one stands still in the fitted run the fourth and the last looked swapped."""
    stands = lambda c: c | {"q4": 0 * c["q4"], "dq4": 0 * c["q4"]}  # noqa: E731
    study = measured("kuka_lwr4plus")
    b, a = study.recordings
    file = planted(tmp_path, stands, study).recording_path(a)
    fitted = a.model_copy(
        update={"file": str(file), "use": "identify", "name": "a", "from_s": 1.0, "to_s": 24.0}
    )
    judged = b.model_copy(update={"use": "validate", "from_s": 14.0, "to_s": 19.0})
    study = study.with_(recordings=(fitted, judged), filter=type(study.filter)())
    (told,) = another_signal(asked_of(study), ())
    assert (told.check, told.signals, told.recording) == ("dead_channel", ("q4",), "a")
    assert "swapped" not in told.message and told.message.count("not recorded") == 1


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_torque_zeroed_at_the_start_of_each_run_is_not_without_gravity(tmp_path):
    """Of a TX40's that was told of the run that judges."""

    def change(c):
        later = c["t"] > 2.8
        return c | {"tau_m2": c["tau_m2"] - np.where(later, c["tau_m2"][later][0], c["tau_m2"][0])}

    study = parted(planted(tmp_path, change, measured("staubli_tx40")), 2.8, 3.9)
    assert "gravity_compensated" not in {c.check for c in another_signal(asked_of(study), ())}


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.long
def test_of_a_measured_robot_one_position_turned_beside_a_torque_that_is_mostly_noise(tmp_path):
    """Nothing was said of an LWR4+: its last torque is foretold a little better, too, and not explained."""
    study = measured("kuka_lwr4plus")
    plain = {e.use: e for e in study.recordings}
    turned = {name: ColumnMap(column=name, sign=-1) for name in ("q3", "dq3")}
    entries = plain["identify"], plain["validate"].model_copy(update={"columns": turned})
    checks = examine_fit(prepare_study(study.with_(recordings=entries)))
    assert said(checks) == [("position_sign", ("q3",), plain["validate"].label)]


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_torque_turned_in_one_of_two_runs_which_other_torques_fit_together_worse_anyway(tmp_path):
    """Of a KR 300 nothing was said: its other five torques, which nothing is wrong with, hid it."""
    study = _five_seconds(measured("kuka_kr300"))
    (first,) = (r for r in study.recordings if r.use == "identify")
    its = pq.read_table(study.recording_path(first))["tau_m6"].to_numpy()
    change = lambda c: c | {"tau_m6": -its} if np.array_equal(c["tau_m6"], its) else c  # noqa: E731
    (told,) = examine_fit(prepare_study(planted(tmp_path, change, study)))
    assert f"tau_m6 has the other sign in {first.label}" in told.message and told.signals == ("tau_m6",)
    assert ", these recordings do not tell which" in told.message


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.long
def test_another_zero_that_a_load_explains_as_well_is_said_with_it(tmp_path):
    """Of an AIRBOT's fifth position nothing was said, and a diagnosis found 4 g on its link."""
    study = measured("airbot_play")
    zero = {"q5": ColumnMap(column="q5", offset=-0.39)}
    kept = [e for e in study.recordings if "identify_c" not in e.file]
    entries = tuple(e.model_copy(update={"columns": zero} if e.use == "validate" else {}) for e in kept)
    told = examine_fit(prepare_study(study.with_(recordings=entries, filter=type(study.filter)())))
    assert any("q5 starts from another zero" in c.message and "a load is carried" in c.message for c in told)


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_what_one_recording_explains_better_is_not_told_of_all(tmp_path):
    """Of an LWR4+ whose fourth position starts from another zero in the run that judges two were told to look
    swapped in all."""
    study = measured("kuka_lwr4plus")
    run = next(r for r in study.recordings if r.file.startswith("traj_a"))
    runs = [
        run.model_copy(update={"use": use, "name": use, "from_s": begin, "to_s": end})
        for use, begin, end in (("identify", None, 15.5), ("validate", 15.5, 20.3))
    ]
    study = study.with_(recordings=tuple(runs), filter=type(study.filter)())
    change = lambda c: c | {"q4": c["q4"] + np.radians(10) * (c["t"] > c["t"][0] + 15.5)}  # noqa: E731
    checks = examine_fit(prepare_study(planted(tmp_path, change, study)))
    assert all(c.check != "swapped_signals" for c in checks)


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_torque_turned_in_one_of_three_short_runs(tmp_path):
    """Of a KR 300 nothing was said: fits of four seconds each take more of its other torques, too."""

    def change(log):
        log.tables["run1"]["tau_m1"] = -log.tables["run1"]["tau_m1"]

    study = strangers_log(tmp_path, "kuka_kr300", (100, False, True, True), change)
    (told,) = examine_fit(prepare_study(study))
    assert (told.check, told.signals, told.recording) == ("torque_sign", ("tau_m1",), "run1")


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.long
def test_one_of_several_turned_positions_has_no_other_unit(tmp_path):
    """Of a rokae with every second one turned in the run that judges the first was 10 times too small."""

    def turned(log):
        for j in (1, 3, 5, 7):
            log.tables["run2"][f"q{j}"] = -log.tables["run2"][f"q{j}"]

    study = strangers_log(tmp_path, "rokae_xmate3pro", (0, False, False, False), turned)
    assert not list(another_signal(asked_of(study), ()))


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_torques_without_their_averages_do_feel_gravity(tmp_path):
    """Of a Barrett's both, in all recordings, it was told that they do not in the one that judges."""

    def centred(log):
        for table in log.tables.values():
            table |= {name: x - np.mean(x) for name, x in table.items() if name[:3] == "tau"}

    study = strangers_log(tmp_path, "barrett_wam_2dof", (0, False, False, False), centred)
    assert not list(another_signal(asked_of(study), ()))


def test_a_torque_is_no_other_one_where_only_others_are_explained_better(tmp_path):
    """Of an arm whose third joint a coupling to the second one moves it was told to be 1.72 times too small
    in one of two runs: what the coupling leaves is another share of another motion."""
    robot = tmp_path / "chain.yaml"
    robot.write_text(CHAIN)
    effect = {"effect": "joint_coupling", "joint": 3, "Fv": -0.06, "Ia": -0.05}
    study = ident.simulate(robot, "A", effects=[effect], duration=30, rate_hz=100, noise=1.0, seed=3).study
    assert not list(another_signal(asked_of(study), ()))


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_of_a_measured_robot_a_run_of_a_second_whose_joint_was_homed_elsewhere(tmp_path):
    """Each torque is explained well enough, and no torque looks another one: one robot for all leaves twice
    what one for each does. Of a TX40's second joint, a quarter turn off, nothing was said."""

    def homed(log):
        log.tables["run2"]["q2"] = log.tables["run2"]["q2"] + np.pi / 2

    study = strangers_log(tmp_path, "staubli_tx40", (0, False, False, True), homed)
    assert said(examine_fit(prepare_study(study))) == [("position_zero", ("q2",), "run2")]


def test_a_torque_far_too_large_in_one_run_is_no_other_friction_there(tmp_path):
    """What is left of the other runs is little beside a torque of a thousand times theirs, whatever is taken
    of it."""
    (tmp_path / "small.yaml").write_text(ARM)
    plan = [PlannedRun(f"run{k}", "identify" if k < 4 else "validate", 10.0) for k in (1, 2, 3, 4)]
    runs = []
    for k, run in enumerate(simulate(tmp_path / "small.yaml", runs=tuple(plan), seed=4).recordings):
        tau = run.columns["tau_m1"]
        noisy = tau + 2 * np.std(tau) * np.random.default_rng(1 + k).normal(size=len(tau))
        columns = dict(run.columns) | {"tau_m1": (1000 if k == 2 else 1) * noisy}
        runs.append(ident.Recording(pa.table(columns), run.use, name=run.label))
    asked = asked_of(ident.Study(robot=str(tmp_path / "small.yaml"), recordings=runs))
    (told,) = another_signal(asked, ())
    assert (told.check, told.recording) == ("torque_scale", "run3") and "friction" not in told.message


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_of_a_measured_robot_a_torque_far_too_large_in_one_of_four_runs(tmp_path):
    """Of an LWR4+'s first one, most of which is noise, nothing was said but that it is beyond its limit."""

    def large(log):
        log.tables["run3"]["tau_l1"] = 1000 * log.tables["run3"]["tau_l1"]

    study = strangers_log(tmp_path, "kuka_lwr4plus", (0, False, False, True), large)
    (told,) = examine_fit(prepare_study(study))
    assert (told.check, told.signals, told.recording) == ("torque_scale", ("tau_l1",), "run3")


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_what_two_other_torques_gain_hides_no_torque_of_one_run(tmp_path):
    """Of an LWR4+ one of whose runs had its fifth torque 3 times too large nothing was said: the last two,
    mostly noise, gain more where they are swapped, whatever the fifth one is."""

    def large(log):
        log.tables["run2"]["tau_l5"] = 3 * log.tables["run2"]["tau_l5"]

    study = strangers_log(tmp_path, "kuka_lwr4plus", (0, False, False, True), large)
    (told,) = examine_fit(prepare_study(study))
    assert told.recording == "run2" and re.search(r"tau_l5 is (2\.[6-9]|3)\S* times too large", told.message)


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("hit", [("run1", "run2"), ("run1",)])
def test_what_friction_says_of_all_recordings_is_not_hidden_by_one(tmp_path, hit):
    """Of a Franka at 50 Hz with its last torque turned it was told that its second position is noisy in one
    of two runs; turned in one alone it is that one's."""

    def turned(log):
        for name in hit:
            log.tables[name]["tau_l7"] = -log.tables[name]["tau_l7"]

    study = strangers_log(tmp_path, "franka_panda", (50, False, False, False), turned)
    (told, *_) = examine_fit(prepare_study(study))
    assert (told.check, told.signals) == ("torque_sign", ("tau_l7",))


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_all_torques_of_one_recording_turned_beside_a_load_in_another_one(tmp_path):
    """Of an AIRBOT a contact or another robot was told there, and loads of 1.3 and 1.8 kg in the others."""

    def change(log):
        log.hit = ["run3"]
        weighing(log, lambda table, g: np.tile(g, (len(table["t"]), 1)), 0.5, tool=True)
        log.tables["run1"] |= {f"tau_m{j}": -log.tables["run1"][f"tau_m{j}"] for j in range(1, 7)}

    study = strangers_log(tmp_path, "airbot_play", (50, False, False, False), change)
    (told,) = examine_fit(prepare_study(study))
    assert (told.check, told.recording) == ("torque_sign", "run1") and "over run1, run2" in told.message
    assert undoing(told) is not None


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_fault_behind_another_one_of_the_same_recording(tmp_path):
    """Of an AIRBOT it was told that it is the one or the other, of an LWR4+ the first alone."""

    def change(log):
        table = log.tables["run1"]
        table["tau_m2"], table["tau_m3"] = -table["tau_m2"], 3 * table["tau_m3"]

    study = strangers_log(tmp_path, "airbot_play", (100, False, False, False), change)
    told = examine_fit(prepare_study(study))
    assert [(c.recording, c.check, c.signals) for c in told] == [
        ("run1", "torque_sign", ("tau_m2",)),
        ("run1", "torque_scale", ("tau_m3",)),
    ]
    assert (
        undoing(told[0]) is not None
        and 0.9 < float(re.findall(r"is ([0-9.]+) times", told[1].message)[0]) / 3 < 1.1
    )
