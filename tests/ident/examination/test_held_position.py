"""A position that was held for a while, beside one that leaps."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, strangers_log
from small_arm import ARM

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit, examine_tables
from ident.examination.undone import undoing


def _study(folder, columns):
    (folder / "small.yaml").write_text(ARM)
    return ident.Study(
        robot=str(folder / "small.yaml"), recordings=[ident.Recording(columns, use="identify", name="run")]
    )


@pytest.mark.parametrize(("held", "joints"), [(160, (2,)), (15, (2,)), (160, (1, 2, 3)), (0, ())])
def test_rows_in_which_a_position_was_held_are_named(tmp_path, held, joints):
    """It was said to have slipped in the row behind them, where they were few or all positions were held."""
    t = np.arange(3000) / 40
    columns = {"t": t} | {f"{kind}{j}": np.sin(j * t) for kind in ("q", "tau_m") for j in (1, 2, 3)}
    if held:
        for j in joints:
            columns[f"q{j}"][1450 - held : 1450] = columns[f"q{j}"][1450 - held]
    else:
        columns["q2"][1450:] += 0.7
    with pytest.raises(ident.Error) as caught:
        ident.fit(_study(tmp_path, columns))
    said = f"stands still in rows {1451 - held} to 1450" if held else "in row 1451 and stays there"
    assert said in str(caught.value)


def _motion(t, step=1e-4):
    """In an encoder's steps; the first joint so slow that it does not change from row to row."""
    angle = {f"q{j}": np.round(np.sin(j**2 * t / 20) / step) * step for j in (1, 2, 3)}
    return {"t": t, **angle} | {f"tau_m{j}": np.sin(j * t) for j in (1, 2, 3)}


def test_a_log_that_was_cut_while_a_position_did_not_change(tmp_path):
    """Of an AIRBOT's it was told to have been held for two rows, in which it went 0.3 rad."""
    columns = _motion(np.arange(6000) / 1000 + 27)
    (still,) = np.nonzero(np.diff(columns["q1"][2000:3000]) == 0)
    at = 2000 + int(still[0]) + 2
    kept = np.r_[0:at, at + 1500 : 6000]
    cut = {name: x[kept] for name, x in columns.items()} | {"t": columns["t"][: len(kept)]}
    with pytest.raises(ident.Error) as caught:
        ident.fit(_study(tmp_path, cut))
    assert f"q1, q2, q3 leap in row {at + 1}, q1 by " in str(caught.value)
    assert "rows were cut out, or recordings were put together" in str(caught.value)


@pytest.mark.long
def test_what_a_position_goes_over_a_gap_is_no_leap(tmp_path):
    """Of a rokae's log that lacked rows a position was refused for a step of 0.4 mrad beside a gap."""
    columns = _motion(np.arange(4000) / 1000, step=1e-9)
    kept = np.r_[0:200, 600, 601, 1000:4000]
    ident.fit(_study(tmp_path, {name: x[kept] for name, x in columns.items()}))


@pytest.mark.parametrize("slips", [False, True])
def test_a_position_of_a_slower_bus_does_not_leap_with_each_message(tmp_path, slips):
    """A rokae's fourth, new at 10 Hz in a log of 1 kHz, was told to have slipped."""
    columns = _motion(np.arange(20000) / 1000, step=1e-9)
    columns["q3"] = columns["q3"][np.arange(20000) // 100 * 100] + slips * (np.arange(20000) >= 12000)
    study = _study(tmp_path, columns)
    if slips:
        with pytest.raises(ident.Error, match="q3 leaps by 1"):
            ident.fit(study)
    else:
        checks = examine_tables(prepare_study(study))
        assert [(c.check, c.signals) for c in checks if c.signals == ("q3",)] == [("held_signal", ("q3",))]


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_position_that_is_one_number_throughout_may_not_be_recorded(tmp_path):
    """Of a Barrett without its first one its second torque was told to have the other sign, and turned."""

    def change(log):
        for table in log.tables.values():
            table["q1"], table["dq1"] = 0 * table["q1"], 0 * table["q1"]

    study = strangers_log(tmp_path, "barrett_wam_2dof", (50, False, True, True), change)
    (told, *_) = examine_fit(prepare_study(study))
    assert told.check == "dead_channel" and told.signals == ("q1",) and undoing(told) is None
    assert told.message.startswith("q1 is not recorded, though the joint moves, or tau_m2 has the other sign")


@pytest.mark.parametrize(
    ("held", "step", "lag", "said"),
    [(14, 1e-5, 0, True), (0, 1e-5, 0, False), (0, 0.02, 0, False), (0, 1e-5, 3, False)],
)
def test_a_short_hold_that_its_velocity_shows(tmp_path, held, step, lag, said):
    """Its leap is no larger than what the joint goes in a row elsewhere. Coarse steps, and a velocity that is
    filtered while its joint comes to rest, are none: nothing makes up for what the velocity went by."""
    t = np.arange(1500) / 50
    pace = np.where(t < 20, 0.3, np.where(t < 22, 3.0, 0.0))  # far faster than where it is held, then rest
    q = np.sin(np.cumsum(pace) / 50)
    dq = np.roll(np.gradient(q, t), lag)
    q = np.round(q / step) * step
    q[320 - held : 320] = q[320 - held]
    columns = {"t": t, "q1": np.sin(0.7 * t), "q3": np.cos(1.3 * t), "q2": q, "dq2": dq}
    study = _study(tmp_path, columns | {f"tau_m{j}": np.sin(j * t) for j in (1, 2, 3)})
    told = [c for c in examine_tables(prepare_study(study)) if "stands still at" in c.message]
    assert [c.signals for c in told] == ([("q2",)] if said else [])
    assert all("rows 307 to 320" in c.message for c in told)


@pytest.mark.parametrize("early", [0, 1])
def test_a_joint_that_stops_and_goes_on_at_once_was_not_held(tmp_path, early):
    """Of an AIRBOT whose brakes were shut for two seconds q4 stood still "while dq4 goes on", which read 0,
    of a UR10e's but for the last row."""
    t = np.arange(1500) / 50
    pace = np.where((t > 10) & (t < 12), 0.0, 0.8)
    q, dq = np.sin(np.cumsum(pace) / 50), np.roll(pace, -early) * np.cos(np.cumsum(pace) / 50)
    columns = {"t": t, "q1": np.sin(0.7 * t), "q3": np.cos(1.3 * t), "q2": q, "dq2": dq}
    study = _study(tmp_path, columns | {f"tau_m{j}": np.sin(j * t) for j in (1, 2, 3)})
    assert not [c for c in examine_tables(prepare_study(study)) if "stands still at" in c.message]
