"""Signals that repeat themselves or another one, planted in a measured recording of a UR10e."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, changed, measured, parted, planted, refused, rows, strangers_log, tables

from ident.equations.prepared import prepare_study
from ident.errors import RecordingError
from ident.examination.examine import examine_fit, examine_tables
from ident.examination.tables.spikes import dropouts, emptied
from ident.examination.undone import unsettled

pytestmark = ON_RECORDINGS


@pytest.mark.parametrize(("signal", "of"), [("i2", "q2"), ("i3", "i2")])
def test_a_torque_that_is_another_signal(tmp_path, signal, of):
    text, checks = refused(planted(tmp_path, lambda c: c | {signal: -0.3 * c[of] + 1}))
    assert checks == {"copied_signal"} and f"{of} and {signal} are the same times a number" in text
    left_out = [
        f"channels: [{', '.join(f'tau_m{j}' for j in range(1, 7) if f'i{j}' != name)}]"
        for name in (of, signal)
    ]
    assert [its in text for its in left_out] == [of[0] == "i", True]  # either may be the copy


@pytest.mark.parametrize("value", [0.0, -5.797])
def test_a_torque_that_dies_on_the_way(tmp_path, value):
    text, checks = refused(
        planted(tmp_path, changed("i2", lambda x: rows(x, slice(len(x) // 2, None), value)))
    )
    assert checks == {"dead_channel"} and "i2 stands still" in text and "channels: [tau_m1, tau_m3" in text
    assert ("at its limit" in text) is (value != 0)


def test_a_torque_that_stands_still_for_a_second_is_warned_of(tmp_path):
    study = planted(tmp_path, changed("i2", lambda x: rows(x, slice(1500, 1600), x[1500])))
    said = [(c.check, c.outcome, c.signals) for c in tables(study)]
    assert set(said) == {("dead_channel", "warned", ("i2",))}


def test_a_torque_that_is_held_for_few_rows(tmp_path):
    """Of a TX40 at 50 Hz 15 of 140 made of 4 % 30, and nothing was said."""
    study = parted(measured("staubli_tx40"), 2.8, 3.9)
    change = changed("tau_m1", lambda x: rows(x, slice(5000, 6500), x[5000]))
    text, checks = refused(planted(tmp_path, lambda c: {k: x[::100] for k, x in change(c).items()}, study))
    assert "tau_m1 stands still at" in text and checks == {"dead_channel"}


def test_a_torque_that_is_held_for_most_of_few_rows(tmp_path):
    """38 values of 110 rows were taken for its resolution."""
    study = measured("staubli_tx40")
    run = study.recordings[0].model_copy(update={"use": "identify", "from_s": 2.8, "to_s": 3.9})
    study = study.with_(recordings=(run,), filter=type(study.filter)())
    change = changed("tau_m6", lambda x: rows(x, slice(318 * 50, None), x[318 * 50]))
    text, checks = refused(planted(tmp_path, lambda c: {k: x[::50] for k, x in change(c).items()}, study))
    assert "tau_m6 stands still at" in text and checks == {"dead_channel"}


@pytest.mark.parametrize("until", [2.4, 2.45, 2.5])
def test_nothing_that_is_held_for_a_time_leaps(tmp_path, until):
    """Of a TX40 at 5 kHz, new every 0.01 s, rows were told to be cut out where a block of the table ended
    behind one change."""
    hold = lambda c: {k: x if k == "t" else x[np.arange(len(x)) // 50 * 50] for k, x in c.items()}  # noqa: E731
    study = planted(tmp_path, hold, parted(measured("staubli_tx40"), 1.3, until))
    assert "position_step" not in {c.check for c in tables(study)}


def test_a_torque_that_dies_in_a_fast_log(tmp_path):
    """At 5 kHz no piece of the table that is looked at was longer than it: of a TX40 nothing was said."""
    change = changed("tau_m3", lambda x: rows(x, slice(7000, 14000), 0.0))
    text, checks = refused(planted(tmp_path, change, measured("staubli_tx40")))
    assert "tau_m3 stands still at 0" in text and checks == {"dead_channel"}


@pytest.mark.parametrize("signal", ["i2", "q2"])
def test_a_signal_that_is_held_over_ten_rows(tmp_path, signal):
    def change(c):
        plain = {k: v for k, v in c.items() if k[:2] != "dq"}
        return plain | {signal: c[signal][np.arange(len(c["t"])) // 10 * 10]}

    said = {(c.check, c.signals) for c in tables(planted(tmp_path, change))}
    assert said == {("held_signal", (signal,))}


@pytest.mark.parametrize(("every", "told"), [(0.03, True), (0.02, False)])
def test_values_that_are_new_so_seldom_that_the_cut_off_shows_it_are_held(tmp_path, every, told):
    """Told from 40 ms on, torques of 25 Hz were in one run of a TX40's three, whose stamps made it a hair
    more."""

    def hold(c):
        begin = c["t"][0] + every * np.floor((c["t"] - c["t"][0]) / every + 1e-6)
        each = np.searchsorted(c["t"], begin - 1e-6)
        return c | {k: x[each] for k, x in c.items() if k.startswith("tau")}

    said = {c.check for c in tables(planted(tmp_path, hold, measured("franka_panda")))}
    assert said == ({"held_signal"} if told else set())


def test_a_torque_without_its_sign(tmp_path):
    said = {(c.check, c.signals) for c in tables(planted(tmp_path, changed("i2", np.abs)))}
    assert said == {("unsigned_torque", ("i2",))}


def test_torques_that_are_all_magnitudes(tmp_path):
    """Most of a Franka's do not come down to zero: two of its positions were told to be exchanged."""
    names = [f"tau_l{j}" for j in range(1, 8)]
    study = planted(tmp_path, lambda c: c | {k: np.abs(c[k]) for k in names}, measured("franka_panda"))
    prepared = prepare_study(study)
    said = [c for c in examine_tables(prepared) if c.recording == study.recordings[0].label]
    assert {c.check for c in said} == {"unsigned_torque"}
    assert sorted(name for c in said for name in c.signals) == names
    several, _ = said
    assert len(several.signals) > 1 and "where the others are right, leave them out" in several.remedy
    assert not set(several.signals) & set(several.remedy.split("channels: ")[1].strip("[]").split(", "))
    assert not examine_fit(prepared)


def test_torques_in_whole_units_are_coarse_where_they_are_small(tmp_path):
    said = tables(planted(tmp_path, lambda c: c | {f"i{j}": np.round(c[f"i{j}"]) for j in range(1, 7)}))
    assert {c.check for c in said} == {"coarse_signal"} and any("i6" in c.signals for c in said)


@pytest.mark.parametrize("at_rest", [False, True])
def test_a_torque_of_few_steps_is_coarse_however_seldom_it_changes(tmp_path, at_rest):
    """Of a Franka's second in steps of its deviation 15 % were foretold for 2: it changed 14 times."""

    def change(c):
        steps = np.std(c["tau_l2"]) * np.round(c["tau_l2"] / np.std(c["tau_l2"]))
        return c | {"tau_l2": steps} | ({"q2": 0 * c["q2"], "dq2": 0 * c["dq2"]} if at_rest else {})

    study = parted(planted(tmp_path, change, measured("franka_panda")), 6.0, 8.0)
    (run, *_) = study.recordings
    study = study.with_(recordings=(run.model_copy(update={"from_s": 3.0}),))
    assert ("coarse_signal" in {c.check for c in tables(study)}) is not at_rest


def test_messages_that_were_lost_are_masked(tmp_path):
    lost = np.random.default_rng(0).random(10000) < 0.02

    def change(x):
        return np.where(lost[: len(x)], 0.0, x)

    said = {(c.check, c.outcome, c.signals) for c in tables(planted(tmp_path, changed("i2", change)))}
    assert said == {("missing_values", "mended", ("i2",))}


def test_a_resolution_is_no_dropout():
    t = np.arange(4096) / 100
    for step in (0.05, 0.3, 1.0):
        x = np.round((3 * np.sin(t) + 2 * np.sign(np.cos(t))) / step) * step
        assert not dropouts(x).any()


def test_a_torque_that_is_new_now_and_then_passes_zero():
    """Of an AIRBOT's, new every fourth row, those rows were a logger's marks for no value."""
    t = np.arange(4000) / 200
    q, tau = np.sin(t), np.round(4 * np.cos(3 * t) + 0.05 * np.sin(900 * t), 2)[np.arange(4000) // 4 * 4]
    tau[1600:1604] = 0.0  # between -0.6 and 0.6
    tau[1596:1600], tau[1604:1608] = -0.08, 0.08
    assert not emptied(np.stack([q, tau], axis=1), 1, np.zeros(2)).any()


def test_a_torque_that_passes_zero_where_its_joint_turns_is_no_mark():
    """Dry friction turns over within a few rows, one of which may read zero in coarse steps."""
    t = np.arange(8000) / 500
    turns, goes = 0.5 * np.sin(2 * t), np.sin(0.7 * t)
    tau = np.round(0.05 * np.sin(t) + 0.3 * np.tanh(np.cos(2 * t) / 0.02), 3)
    at = 393  # t = pi/4
    tau[at - 1 : at + 2] = 0.036, 0.0, -0.035
    signals = np.stack([turns, goes, tau], axis=1)
    assert not emptied(signals, 2, np.zeros(3)).any()
    signals[at + 1, 2] = 0.037  # to zero and back again
    assert emptied(signals, 2, np.zeros(3))[at, 2]


def test_a_joint_at_rest_at_zero_beside_one_whose_messages_are_lost():
    t = np.arange(4000) / 200
    still, moves = np.where(t < 5, 0.0, np.sin(t - 5)), 1 + 0.5 * np.sin(t)
    moves[[300, 700, 1500]] = 0.0
    lost = emptied(np.stack([still, moves], axis=1), 2, np.zeros(2))
    assert lost[:, 1].sum() == 3 and not lost[:, 0].any()


def test_rows_out_of_order_are_said_to_be(tmp_path):
    order = np.random.default_rng(0).permutation(20000)
    study = planted(tmp_path, lambda c: {k: v[order[order < len(v)]] for k, v in c.items()})
    with pytest.raises(Exception, match="time runs backwards"):
        prepare_study(study)


def _plain(c):
    return {k: v for k, v in c.items() if k[:2] != "dq"}


ORDERS = {
    "q2 twice as large": (lambda c: _plain(c) | {"q2": 2 * c["q2"]}, "angle_unit", "q2"),
    "the controller's alphabetical order": (
        lambda c: _plain(c) | {f"{k}{a}": c[f"{k}{b}"] for k in "qi" for a, b in ((1, 3), (3, 1))},
        "swapped_signals",
        "3, 2, 1, 4, 5, 6",
    ),
    "all moved by one": (
        lambda c: _plain(c) | {f"{k}{a}": c[f"{k}{a % 6 + 1}"] for k in "qi" for a in range(1, 7)},
        "swapped_signals",
        "6, 1, 2, 3, 4, 5",
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("defect", ORDERS)
def test_positions_and_torques_of_other_joints(tmp_path, defect):
    change, check, words = ORDERS[defect]
    said = examine_fit(prepare_study(planted(tmp_path, change)))
    assert said[0].check == check and words in said[0].message


@pytest.mark.long
def test_one_joint_in_degrees_is_that_joint_alone(tmp_path):
    study = planted(tmp_path, lambda c: _plain(c) | {"q2": np.degrees(c["q2"])})
    with pytest.raises(Exception, match="q2 is in degrees") as caught:
        examine_fit(prepare_study(study))
    assert "q1" not in str(caught.value)


@pytest.mark.long
@pytest.mark.parametrize(("size", "told"), [(0.0, False), (0.01, True)])
def test_a_position_whose_acceleration_is_mostly_noise(tmp_path, size, told):
    """Of a UR10e's first one a contact was told, which the fifth current was to feel for four seconds."""

    def noisy(log):
        for table in log.tables.values():
            table["q1"] = table["q1"] + size * log.rng.standard_normal(len(table["t"]))

    prepared = prepare_study(strangers_log(tmp_path, "ur10e", (0, False, True, False), noisy))
    found = examine_tables(prepared)
    assert [c.signals for c in found] == [("q1",)] * (3 * told)
    assert unsettled(found) == found  # no effect is told as if that were a motion
    assert not told or examine_fit(prepared) == ()


def test_torques_that_stand_still_at_once_are_told_at_once(tmp_path):
    """The first of a Barrett's two was to be left out, and then the second."""

    def off(log):
        for table in log.tables.values():
            kept = np.arange(len(table["t"])) < 0.7 * len(table["t"])
            table |= {name: kept * x for name, x in table.items() if name[:3] == "tau"}

    text, checks = refused(strangers_log(tmp_path, "barrett_wam_2dof", (100, False, False, False), off))
    assert checks == {"dead_channel"} and "tau_m1, tau_m2 stand still at 0" in text
    assert text.endswith("leave the stretch out with from: and to:")


def test_torques_of_joints_that_hardly_move_stand_still_with_the_others(tmp_path):
    """Of a Franka's seven, each held for 0.16 s now and then, five were to be left out."""

    def held(log):
        table = log.tables["run3"]
        rows = np.arange(len(table["t"]))
        last = rows - np.maximum(rows % 80 - 64, 0)
        log.tables["run3"] = {k: x[last] if k[:3] == "tau" else x for k, x in table.items()}

    text, checks = refused(strangers_log(tmp_path, "franka_panda", (100, False, False, True), held))
    assert checks == {"dead_channel"} and "so does every torque, of joints that hardly move, too" in text
    assert text.endswith("leave the stretch out with from: and to:")


@pytest.mark.parametrize(
    ("robot", "kinds", "words"),
    [
        ("ur10e", ("q", "d", "i"), "every signal"),
        ("airbot_play", ("tau",), "all torques"),
        ("kuka_lwr4plus", ("q",), "all positions"),
    ],
)
def test_rows_that_repeat_the_one_before_some_at_a_time(tmp_path, robot, kinds, words):
    """Of a UR10e at 50 Hz it was told that its clock is 6 times too slow, or lengths 40 times too large; of
    an AIRBOT's torques alone nothing was."""

    def change(log):
        for name, table in log.tables.items():
            last = np.arange(len(table["t"])) - np.maximum(np.arange(len(table["t"])) % 40 - 32, 0)
            log.tables[name] = {key: x[last] if key.startswith(kinds) else x for key, x in table.items()}

    text, checks = refused(strangers_log(tmp_path, robot, (50, True, False, False), change))
    assert "frozen" in checks and f"repeat the one before in {words}, for 0.16 s at a time" in text


def test_torques_that_stand_for_long_at_the_start_are_no_lost_messages(tmp_path):
    """As those that are recorded late begin."""

    def change(log):
        for name, table in log.tables.items():
            first = np.maximum(np.arange(len(table["t"])), 75)
            log.tables[name] = {k: x[first] if k.startswith("tau") else x for k, x in table.items()}

    text, _ = refused(strangers_log(tmp_path, "kuka_lwr4plus", (50, False, False, False), change))
    assert "stand still at" in text and "messages" not in text


def test_where_a_position_turns_is_no_spike(tmp_path):
    """Of a clean KR 300 at 50 Hz samples of five positions were spikes at the ends of its moves: off the
    median of five, as any extremum is, and where their neighbours foretell them."""
    study = strangers_log(tmp_path, "kuka_kr300", (50, False, False, False), lambda log: None)
    spikes = {name for check in tables(study) if check.check == "spike" for name in check.signals}
    assert not {name for name in spikes if name[0] == "q"}


@pytest.mark.parametrize("robot", ["rokae_xmate3pro", "kuka_lwr4plus"])
def test_few_rows_that_repeat_the_one_before_are_no_encoder_that_slipped(tmp_path, robot):
    """Eight rows in 160 that hold all signals: the position was told to leap and stay, as an encoder's."""

    def change(log):
        for table in log.tables.values():
            rows = np.arange(len(table["t"]))
            kept = np.where(rows % 160 < 8, rows - rows % 160, rows)
            table |= {k: x[kept] for k, x in table.items() if k != "t"}

    with pytest.raises(RecordingError, match=r"every signal stands still in rows .* the last one written on"):
        prepare_study(strangers_log(tmp_path, robot, (0, False, False, False), change))
