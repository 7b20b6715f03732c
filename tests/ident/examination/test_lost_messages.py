"""Messages that were lost for some rows: their fields are zero, or hold what came before."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from planted import ON_RECORDINGS, measured, parted, planted, refused, strangers_log, tables

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit, examine_tables

pytestmark = ON_RECORDINGS


def _lost(columns, first, values):
    """20 rows from each of these on, of all signals."""
    out = {name: x.copy() for name, x in columns.items()}
    for name, x in out.items():
        for k in first if name != "t" else ():
            x[k : k + 20] = values(x, k)
    return out


def _said(prepared):
    """Checks and what came of them, but for the clock of a robot as it is."""
    said = [*examine_tables(prepared), *examine_fit(prepared)]
    return {(c.check, c.outcome) for c in said if c.check != "time_stamps"}


@pytest.mark.long
def test_zeros_in_all_signals(tmp_path):
    """A load of 4.6 kg was told, and a torque that the others contradict."""
    zeros = lambda c: _lost(c, range(900, len(c["t"]) - 900, 700), lambda x, k: 0.0)  # noqa: E731
    prepared = prepare_study(planted(tmp_path, zeros, measured("kuka_lwr4plus")))
    assert _said(prepared) == {("missing_values", "mended")}
    clean = prepare_study(measured("kuka_lwr4plus"))
    for lost, whole in zip(prepared.streams, clean.streams):
        assert np.allclose(lost.survey.lowest, whole.survey.lowest, rtol=0.02, atol=0.02)


@pytest.mark.long
@pytest.mark.parametrize(
    ("robot", "lost"),
    [pytest.param("kuka_lwr4plus", ("q4",), marks=pytest.mark.long), ("airbot_play", "tau_m")],
)
def test_zeros_in_some_signals(tmp_path, robot, lost):
    """The fourth position was told to be the sixth; of torques nothing was said."""

    def change(c):
        gone = _lost(c, range(900, len(c["t"]) - 900, 700), lambda x, k: 0.0)
        return c | {name: gone[name] for name in c if name.startswith(lost)}

    prepared = prepare_study(planted(tmp_path, change, measured(robot)))
    assert _said(prepared) == {("missing_values", "mended")}


@pytest.mark.long
def test_what_came_before_is_held(tmp_path):
    """Of 20 ms at 1 kHz it was told that an encoder slips."""
    held = lambda c: _lost(c, (3000, 5000, 8000), lambda x, k: x[k - 1])  # noqa: E731
    study = parted(planted(tmp_path, held, measured("franka_panda")), 6.5, 9.8)
    prepared = prepare_study(study)
    said = [*examine_tables(prepared), *examine_fit(prepared)]
    assert {(c.check, c.outcome) for c in said} == {("frozen", "mended")}


def test_the_last_message_is_written_on_to_the_end(tmp_path):
    """Nothing was said of a TX40's, of whose fit four times as much was left."""

    def held(c):
        last = len(c["t"]) - 200
        return {k: x if k == "t" else np.append(x[:last], np.full(200, x[last])) for k, x in c.items()}

    study = parted(planted(tmp_path, held, measured("franka_panda")), 6.5, 13.0)
    ((check, outcome, rows),) = {
        (c.check, c.outcome, c.rows) for c in examine_tables(prepare_study(study)) if c.check != "spike"
    }
    assert (check, outcome) == ("frozen", "mended") and rows[1] - rows[0] in (198, 199)


@pytest.mark.parametrize("gone", [3, 0])
def test_rows_that_are_gone_though_the_stamps_go_on(tmp_path, gone):
    """Of two rows of a Franka at 50 Hz nothing was said, and errors of 2 to 3 % were 5 to 12; of a Barrett
    without eight, which was told, that for a time a load, a contact or a hand was there."""

    def cut(c):
        return {
            k: x[: len(x) - gone] if k == "t" else np.delete(x, slice(700, 700 + gone)) for k, x in c.items()
        }

    as_it_is = prepare_study(measured("kuka_kr300"))
    prepared = prepare_study(planted(tmp_path, cut, measured("kuka_kr300")))
    told = [c for c in examine_tables(prepared) if c.check == "lost_rows"]
    assert [(c.rows, c.outcome) for c in told] == [((701, 701), "mended")] * 2 * bool(gone)
    assert all("3 rows are missing there" in c.message for c in told)
    ends = [[s.survey.segments[-1].end for s in its.streams] for its in (prepared, as_it_is)]
    assert np.allclose(*ends, atol=1e-3)  # the rows behind are where they were


@pytest.mark.parametrize("late", [1, 3])
def test_no_row_is_gone_where_some_come_late_and_are_made_up_for(tmp_path, late):
    """Of a Franka at 100 Hz whose signals were new every 0.01 s a row was told to be missing, three behind
    one that repeats the one before it."""

    def held(c):
        rows = np.arange(len(c["t"]))
        from_row = np.where((rows >= 700) & (rows < 700 + late), rows - 1, rows)
        return {k: x if k == "t" else x[from_row] for k, x in c.items()}

    told = tables(planted(tmp_path, held, measured("kuka_kr300")))
    assert not [c for c in told if c.check == "lost_rows"]


def test_no_row_is_gone_where_a_joint_stands_still_but_for_single_steps():
    """Of a rokae as it is five rows were told to be missing within 50."""
    study = measured("rokae_xmate3pro")
    (entry, *_) = study.recordings
    runs = [entry.model_copy(update={"use": "identify", "from_s": None, "to_s": to}) for to in (7.0, 12.0)]
    for run in runs:
        assert not [c for c in tables(study.with_(recordings=(run,))) if c.check == "lost_rows"]


@pytest.mark.parametrize(("at", "every"), [(16640, 1), (315, 50)])
def test_a_log_that_is_frozen_from_a_row_on_has_lost_none_before_it(tmp_path, at, every):
    """Behind the first rows of a long log all positions were said to go on by two rows at once."""

    def stopped(c):
        its = {k: x[::every] for k, x in c.items()}
        return {k: x if k == "t" else np.where(np.arange(len(x)) < at, x, x[at]) for k, x in its.items()}

    study = planted(tmp_path, stopped, measured("staubli_tx40"))
    run = study.recordings[0].model_copy(update={"use": "identify", "from_s": 2.8, "to_s": 3.9})
    study = study.with_(recordings=(run,), filter=type(study.filter)())
    if every > 1:
        with pytest.raises(ident.Error, match="holds only 36 samples beside 74 that are frozen"):
            prepare_study(study)
    else:
        assert {c.check for c in tables(study)} == {"frozen"}


def test_a_run_that_is_too_short_beside_what_has_no_value(tmp_path):
    """Of 74 rows of a Kinova, 50 of them zeros, it was told that 24 are too few, and to record longer."""

    def ended(log):
        for name, table in log.tables.items():
            rows = np.arange(len(table["t"])) < 24
            log.tables[name] = {k: x if k == "t" else np.where(rows, x, 0.0) for k, x in table.items()}

    study = strangers_log(tmp_path, "kinova_gen3_joint7_friction", (50, False, False, True), ended)
    with pytest.raises(ident.Error, match="only 24 samples beside 50 in which a position has no value"):
        prepare_study(study)


@pytest.mark.parametrize("role", ["validate", "identify"])
def test_a_run_that_is_frozen_throughout(tmp_path, role):
    """Its joints were told never to move, and its error of 37 % stood beside the fit's."""
    study = planted(tmp_path, lambda c: c)
    (entry,) = (e for e in study.recordings if e.use == role)
    path = study.recording_path(entry)
    read = pq.read_table(path)
    frozen = {k: read[k].to_numpy() for k in read.column_names}
    frozen = {k: x if k == "t" else np.full(len(x), x[700]) for k, x in frozen.items()}
    pq.write_table(pa.table(frozen), path)
    if role == "identify":
        text, checks = refused(study)
        assert checks == {"frozen"} and "all 5457 rows are the same" in text
        return
    prepared = prepare_study(study)
    (check,) = examine_tables(prepared)
    assert (check.check, check.outcome, check.recording) == ("frozen", "mended", entry.label)
    assert [stream.role for stream in prepared.streams] == ["identify"]
