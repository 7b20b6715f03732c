"""Bad studies and recordings: one sentence that names the offender and the remedy, or a warning with the
reason."""

import numpy as np
import pytest
from recordings import recording, write_parquet, write_study

from ident.errors import IdentError
from ident.estimation.fit import fit_study
from ident.recordings.study import load_study

pytestmark = pytest.mark.unexamined


@pytest.fixture(scope="module")
def good():
    return recording("A", seconds=20)[0]


def fit(folder, table, name="run.parquet", entry=None, **keys):
    write_parquet(folder / name, table)
    return fit_study(
        load_study(write_study(folder, [{"file": name, "use": "identify"} | (entry or {})], **keys))
    )


def refusal(folder, table, **keys):
    with pytest.raises(IdentError) as caught:
        fit(folder, table, **keys)
    text = str(caught.value)
    assert "\n" not in text and "Traceback" not in text
    return text


def changed(columns, name, values):
    return {**columns, name: values}


def found(result, check):
    return [c for c in result.checks if c.check == check]


def test_a_single_nan_is_masked_and_said(tmp_path, good):
    tau = good["tau_m3"].copy()
    tau[1234] = np.nan
    stream = fit(tmp_path, changed(good, "tau_m3", tau)).recordings[0]
    check = found(stream, "missing_values")[0]
    assert check.outcome == "mended" and check.signals == ("tau_m3",) and check.rows == (1235, 1235)


def test_an_infinite_position_is_masked_and_said(tmp_path, good):
    q = good["q2"].copy()
    q[7] = np.inf
    stream = fit(tmp_path, changed(good, "q2", q)).recordings[0]
    assert found(stream, "missing_values")[0].signals == ("q2",)


def test_many_missing_values_are_refused(tmp_path, good):
    tau = good["tau_m3"].copy()
    tau[::15] = np.nan
    text = refusal(tmp_path, changed(good, "tau_m3", tau))
    assert "tau_m3" in text and "5 %" in text and "run.parquet" in text


def test_a_torque_without_any_number_reads_nothing(tmp_path, good):
    text = refusal(tmp_path, changed(good, "tau_m3", np.full(len(good["t"]), np.nan)))
    assert "tau_m3 holds no number in any row: dead or absent; leave it out with channels:" in text


def test_missing_column(tmp_path, good):
    text = refusal(tmp_path, {name: values for name, values in good.items() if name != "q4"})
    assert "q4" in text and "columns:" in text


def test_misspelt_column_is_suggested(tmp_path, good):
    columns = {("tau_mot2" if name == "tau_m2" else name): values for name, values in good.items()}
    assert "tau_mot2" in refusal(tmp_path, columns)


def test_missing_time(tmp_path, good):
    text = refusal(tmp_path, {name: values for name, values in good.items() if name != "t"})
    assert "rate_hz" in text


def test_time_running_backwards(tmp_path, good):
    t = good["t"].copy()
    t[2000:] -= 5.0
    text = refusal(tmp_path, changed(good, "t", t))
    assert "backwards" in text and "2001" in text


def test_time_that_stands_still(tmp_path, good):
    """As do seconds since 1970 in single precision, whose steps are two minutes."""
    t = (1.7e9 + good["t"]).astype(np.float32).astype(float)
    text = refusal(tmp_path, changed(good, "t", t))
    assert "time" in text and "too few digits" in text and "rate_hz" in text


def test_three_samples(tmp_path, good):
    assert "3 samples" in refusal(tmp_path, {name: values[:3] for name, values in good.items()})


def test_empty_window(tmp_path, good):
    """What t is beside it is said: of a window in s and a clock in ms nothing else was to be seen."""
    whole = f"t goes from 0 to {good['t'][-1]:g} in steps of "
    for entry, rows in ({"from": 1000}, "no row"), ({"to": 0.02}, "samples"):
        text = refusal(tmp_path, good, entry=entry)
        assert "from" in text and rows in text and whole in text


def test_text_in_a_number_column(tmp_path, good):
    assert "q5" in refusal(tmp_path, changed(good, "q5", np.array(["far"] * len(good["t"]))))


def test_truncated_parquet(tmp_path, good):
    path = write_parquet(tmp_path / "run.parquet", good)
    path.write_bytes(path.read_bytes()[:5000])
    study = load_study(write_study(tmp_path, [{"file": "run.parquet"}]))
    with pytest.raises(IdentError, match=r"run\.parquet.*truncated"):
        fit_study(study)


def test_no_such_file_and_unknown_ending(tmp_path):
    for name, words in (("nothing.parquet", "no such file"), ("run.xlsx", "CSV")):
        if name == "run.xlsx":
            (tmp_path / name).write_bytes(b"x")
        with pytest.raises(IdentError, match=words):
            fit_study(load_study(write_study(tmp_path, [{"file": name}])))


def csv_of(columns, separator=",", decimal=".", rows=400):
    lines = [separator.join(columns)]
    table = np.column_stack([values[:rows] for values in columns.values()])
    lines += [separator.join(f"{x:.6f}".replace(".", decimal) for x in row) for row in table]
    return "\n".join(lines) + "\n"


def test_decimal_comma_between_commas(tmp_path, good):
    (tmp_path / "run.csv").write_text(csv_of(good, ",", ","))
    with pytest.raises(IdentError, match="decimal comma"):
        fit_study(load_study(write_study(tmp_path, [{"file": "run.csv"}])))


@pytest.mark.parametrize(("separator", "told"), [(";", {}), ("\t", {}), (";", {"decimal": ","})])
def test_decimal_comma_is_read(tmp_path, good, separator, told):
    (tmp_path / "run.csv").write_text(csv_of(good, separator, ",", rows=4000))
    result = fit_study(load_study(write_study(tmp_path, [{"file": "run.csv", **told}])))
    assert result.relative_error["identify"]["total"] < 5


def test_csv_without_header_needs_indices(tmp_path, good):
    (tmp_path / "run.csv").write_text(csv_of(good).split("\n", 1)[1])
    with pytest.raises(IdentError, match="no header"):
        fit_study(load_study(write_study(tmp_path, [{"file": "run.csv"}])))


def test_index_beyond_the_table(tmp_path, good):
    assert "99" in refusal(tmp_path, good, columns={"q1": {"column": 99}})


def test_wrong_number_of_gains(tmp_path, good):
    assert "drive_gains" in refusal(tmp_path, good, drive_gains=[1.0, 2.0])


def test_currents_without_gains(tmp_path, good):
    columns = {name.replace("tau_m", "i"): values for name, values in good.items()}
    assert "drive_gains" in refusal(tmp_path, columns)


def test_standstill(tmp_path, good):
    still = {
        name: (values if name == "t" else np.full_like(values, values[0])) for name, values in good.items()
    }
    assert "moving" in refusal(tmp_path, still) or "motion" in refusal(tmp_path, still)


@pytest.mark.long
def test_degrees_are_refused(tmp_path, good, examined):
    columns = {
        name: (np.degrees(values) if name.startswith("q") else values) for name, values in good.items()
    }
    text = refusal(tmp_path, columns)
    assert "degrees" in text and "0.0174533" in text


def test_newton_millimetres_are_suspected(tmp_path, good):
    columns = {name: (values * 1000 if name.startswith("tau") else values) for name, values in good.items()}
    result = fit(tmp_path, columns)
    assert any("N mm" in warning and "0.001" in warning for warning in result.warnings)


def test_constant_joint_is_said(tmp_path, good):
    result = fit(tmp_path, changed(good, "q6", np.full_like(good["q6"], 0.3)))
    assert any("joint 6 never moves" in warning for warning in result.warnings)
    assert "Fcm6R" not in result.reduction.essential


@pytest.mark.long
def test_swapped_joints_are_suspected(tmp_path, good, examined):
    columns = {**good, "tau_m2": good["tau_m4"], "tau_m4": good["tau_m2"]}
    result = fit(tmp_path, columns)
    assert any("2 and 4" in warning and "swapped" in warning for warning in result.warnings)


@pytest.mark.long
def test_swapped_positions_are_suspected(tmp_path, good, examined):
    columns = {**good, "q3": good["q5"], "q5": good["q3"]}
    result = fit(tmp_path, columns)
    assert any("3 and 5" in warning and "swapped" in warning for warning in result.warnings)


@pytest.mark.long
def test_reversed_sign_is_suspected(tmp_path, good, examined):
    result = fit(tmp_path, changed(good, "tau_m2", -good["tau_m2"]))
    assert any("joint 2" in warning and "sign" in warning for warning in result.warnings)


def test_model_that_the_recording_cannot_serve(tmp_path, good):
    assert "tau_l1" in refusal(tmp_path, good, model="C")
