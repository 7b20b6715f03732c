"""`fit_study` on small twins: the truth comes back, whatever the file format, the time stamps or the
options."""

import json

import h5py
import numpy as np
import pytest
import scipy.io
from recordings import ROBOT, motion, recording, true_chi, write_parquet, write_study

import generated
from ident.equations.build import build
from ident.equations.observation import stack
from ident.equations.prepared import prepare_study
from ident.errors import StudyError
from ident.estimation.fit import drive_gains, fit_models, fit_study
from ident.recordings.study import load_study
from ident.report.files import comparison_table, error_table, fit_document, parameter_table, write_into

pytestmark = pytest.mark.unexamined


def run(folder, entries, **keys):
    return fit_study(load_study(write_study(folder, entries, **keys)))


def inside(result, truth, share=0.85):
    """Share of essential parameters within 1.96 standard deviations of the truth."""
    k = np.flatnonzero(result.estimate.active)
    error = np.array([result.estimate.chi[i] - truth[result.columns.parameters[i]] for i in k])
    return np.mean(np.abs(error) < 1.96 * result.std[k]) >= share


@pytest.fixture(scope="module")
def table():
    return recording("A", seconds=40)


@pytest.fixture(scope="module")
def reference(tmp_path_factory, table):
    folder = tmp_path_factory.mktemp("reference")
    write_parquet(folder / "run.parquet", table[0])
    return run(folder, [{"file": "run.parquet"}])


def test_truth_comes_back(reference, table):
    assert inside(reference, table[1])
    assert reference.relative_error["identify"]["total"] < 3
    assert 1 < reference.durbin_watson < 3
    assert reference.normality.p_value > 1e-3


def same(result, reference, rtol=1e-9):
    assert result.columns.parameters == reference.columns.parameters
    assert np.allclose(result.full.chi, reference.full.chi, rtol=rtol, atol=rtol)


@pytest.mark.parametrize(
    "kind", ["csv", "csv_semicolon", "npz", "npz_2d", "mat", "hdf5", "hdf5_2d", "csv_bare", "blanks"]
)
def test_every_format_reads_the_same(tmp_path, table, reference, kind):
    columns = table[0]
    entry = {"file": "run.csv"}
    names = list(columns)
    matrix = np.column_stack(list(columns.values()))
    keys = {}
    if kind in ("csv", "csv_semicolon", "csv_bare", "blanks"):
        mark = {"csv_semicolon": ";", "blanks": " "}.get(kind, ",")
        header = "" if kind == "csv_bare" else mark.join(names)
        np.savetxt(tmp_path / "run.csv", matrix, delimiter=mark, header=header, comments="", fmt="%.17g")
        if kind == "csv_bare":
            text = (tmp_path / "run.csv").read_text().lstrip("\n")
            (tmp_path / "run.csv").write_text(text)
            keys["columns"] = {name: {"column": k} for k, name in enumerate(names)}
    elif kind == "npz":
        np.savez(tmp_path / "run.npz", **columns)
        entry["file"] = "run.npz"
    elif kind == "npz_2d":
        np.savez(tmp_path / "run.npz", t=columns["t"], q=matrix[:, 1:8], tau_m=matrix[:, 8:])
        entry["file"] = "run.npz"
    elif kind == "mat":
        scipy.io.savemat(
            tmp_path / "run.mat", {"t": columns["t"], "q": matrix[:, 1:8], "tau_m": matrix[:, 8:].T}
        )
        entry["file"] = "run.mat"
    else:
        with h5py.File(tmp_path / "run.h5", "w") as out:
            if kind == "hdf5":
                for name, values in columns.items():
                    out[f"log/{name}"] = values
            else:
                out["t"], out["q"], out["tau_m"] = columns["t"], matrix[:, 1:8], matrix[:, 8:].T
        entry["file"] = "run.h5"
    same(run(tmp_path, [entry], **keys), reference)


def test_column_map_scale_offset_sign(tmp_path, table, reference):
    columns = {name: values for name, values in table[0].items() if name not in ("q2", "tau_m4")}
    columns |= {"pos": np.degrees(table[0]["q2"]) - 90.0, "torque": -1000 * table[0]["tau_m4"]}
    write_parquet(tmp_path / "run.parquet", columns)
    maps = {
        "q2": {"column": "pos", "scale": np.pi / 180, "offset": np.pi / 2},
        "tau_m4": {"column": "torque", "scale": 0.001, "sign": -1},
    }
    # noise-free positions: the width of sign(dq) is estimated from rounding errors, which the map changes
    same(run(tmp_path, [{"file": "run.parquet"}], columns=maps), reference, 1e-3)


def test_currents_with_gains(tmp_path, table, reference):
    gains = [2.0, 3, 4, 5, 6, 7, 8]
    columns = {
        name.replace("tau_m", "i"): (values / gains[int(name[-1]) - 1] if name.startswith("tau") else values)
        for name, values in table[0].items()
    }
    write_parquet(tmp_path / "run.parquet", columns)
    same(run(tmp_path, [{"file": "run.parquet"}], drive_gains=gains), reference)


def test_no_time_column_but_a_rate(tmp_path, table, reference):
    write_parquet(
        tmp_path / "run.parquet", {name: values for name, values in table[0].items() if name != "t"}
    )
    same(run(tmp_path, [{"file": "run.parquet", "rate_hz": 200}]), reference, 1e-6)


def test_jitter_is_resampled_and_said(tmp_path, table):
    model = generated.load("kuka_lwr4p", "A")
    t, *_ = motion(40, 200, 0)
    rng = np.random.default_rng(1)
    stamps = t + rng.uniform(-0.002, 0.002, len(t))
    fine_t, *fine = motion(40, 2000, 0)
    state = [np.column_stack([np.interp(stamps, fine_t, column) for column in part.T]) for part in fine]
    tau = model.torque(*state, true_chi(model)) + 0.2 * rng.normal(size=(len(t), 7))
    columns = {"t": stamps - stamps[0]} | {f"q{j + 1}": state[0][:, j] for j in range(7)}
    columns |= {f"tau_m{j + 1}": tau[:, j] for j in range(7)}
    write_parquet(tmp_path / "run.parquet", columns)
    result = run(tmp_path, [{"file": "run.parquet"}])
    assert any("jitter" in note and "resampled at" in note for note in result.notes)
    assert inside(result, table[1], 0.8)


def test_gaps_split_and_are_never_bridged(tmp_path, table):
    keep = np.ones(len(table[0]["t"]), bool)
    keep[3000:3400] = False  # 2 s lost, in which the robot moved on
    write_parquet(tmp_path / "run.parquet", {name: values[keep] for name, values in table[0].items()})
    result = run(tmp_path, [{"file": "run.parquet"}])
    assert any("2 segments" in note for note in result.notes)
    assert inside(result, table[1])
    t = np.concatenate([segment.t for segment in result.systems[0].segments])
    assert not np.any((t > 15.0) & (t < 17.0))


def test_repeated_rows_and_stamps_are_counted(tmp_path, table):
    rows = np.sort(np.concatenate([np.arange(8000), np.arange(100, 7000, 100)]))
    columns = {name: values[rows] for name, values in table[0].items()}
    write_parquet(tmp_path / "same.parquet", columns)
    result = run(tmp_path, [{"file": "same.parquet"}])
    assert result.recordings[0].survey.same_stamp_rows == 69
    assert any("69 rows with a repeated time stamp" in note for note in result.notes)
    assert inside(result, table[1])


def test_rest_at_the_ends_is_not_used(tmp_path, table):
    columns = {}
    for name, values in table[0].items():
        head, tail = np.full(600, values[0]), np.full(600, values[-1])
        columns[name] = (
            np.concatenate([head, values, tail]) if name != "t" else np.arange(len(values) + 1200) / 200
        )
    write_parquet(tmp_path / "run.parquet", columns)
    result = run(tmp_path, [{"file": "run.parquet"}])
    assert any("of rest at the ends" in note for note in result.notes)
    assert 2.5 < result.systems[0].segments[0].t[0] < 4.0
    assert result.systems[0].segments[0].t[-1] < 43.5


def test_streaming_is_the_same_as_all_at_once(tmp_path, table, monkeypatch):
    """Tables read in blocks of 500 rows against one block, and the factors against the dense decimated
    system."""
    import ident.recordings.tables.table

    write_parquet(tmp_path / "run.parquet", table[0])
    study = load_study(write_study(tmp_path, [{"file": "run.parquet"}]))
    whole = prepare_study(study)
    one = build(whole, 2.0)
    monkeypatch.setattr(ident.recordings.tables.table, "ROWS", 500)
    blocks = prepare_study(study)
    other = build(blocks, 2.0)
    assert np.allclose(one[0].segments[0].Y, other[0].segments[0].Y, atol=1e-9)
    assert np.allclose(one[0].segments[0].values, other[0].segments[0].values, atol=1e-8)
    segment, b = one[0].segments[0], len(whole.columns.parameters)
    chi = np.random.default_rng(0).normal(size=b)
    for j, factor in enumerate(stack(one)):
        W = one[0].dense(segment, j, b)[segment.used[j]]
        residual = segment.Y[j, segment.used[j]] - W @ chi
        assert factor.sum_of_squares(chi) == pytest.approx(residual @ residual, rel=1e-9)


def test_payload_by_two_sets_of_runs(tmp_path):
    free, truth = recording("B", payload="L", seconds=40, seed=1, carried=False)
    loaded, _ = recording("B", payload="L", seconds=40, seed=2)
    for name, columns in (("free", free), ("loaded", loaded), ("again", loaded)):
        write_parquet(tmp_path / f"{name}.parquet", columns)
    entries = [{"file": "free.parquet"}, {"file": "loaded.parquet", "payload": "L"}]
    result = run(tmp_path, entries, model="B", payload_mass={"L": 4.6})
    k = result.columns.parameters.index("ML")
    assert abs(result.estimate.chi[k] / truth["ML"] - 1) < 0.01
    assert any(note.startswith("ML identified as") for note in result.notes)
    assert not [check for check in result.checks if check.check == "payload_mass"]
    assert inside(result, truth)
    for told, unit in ((4600.0, "a mass in g,"), (10.14, "a mass in pounds,"), (4.1, "")):
        result = run(tmp_path, entries, model="B", payload_mass={"L": told})
        (check,) = [check for check in result.checks if check.check == "payload_mass"]
        factor = f"{result.full.chi[k] / told:.3g}"
        assert check.message.startswith(f"the payload L weighs {told:g} kg as told, and 4.6")
        assert f"{factor} times what they are" in check.message
        assert unit in check.message and bool(unit) == ("a mass in" in check.message)
    exchanged = [{"file": "free.parquet", "payload": "L"}, {"file": "loaded.parquet"}]
    result = run(tmp_path, exchanged, model="B", payload_mass={"L": 4.6})
    (check,) = [check for check in result.checks if check.check == "payload_mass"]
    assert "comes out as -4.6" in check.message and "carries less in free than in the others" in check.message
    # a second label has ten parameters of its own
    entries[1]["payload"] = "P"
    result = run(tmp_path, [*entries, {"file": "again.parquet", "payload": "Q"}], model="B")
    P, Q = (result.estimate.chi[result.columns.parameters.index(name)] for name in ("MP", "MQ"))
    assert pytest.approx(Q) == P and pytest.approx(truth["ML"], rel=0.01) == P


def test_four_models_of_one_recording(tmp_path):
    columns, truth = recording("C", seconds=60, seed=3)
    write_parquet(tmp_path / "run.parquet", columns)
    study = load_study(write_study(tmp_path, [{"file": "run.parquet"}], model="C"))
    results = fit_models(study, ["A", "B", "C", "D"])
    for name, result in results.items():
        known = truth_of(name, truth)
        assert inside(result, known, 0.8), name
    header, rows = comparison_table(results)
    assert header[:6] == ("parameter", "A value", "A % std", "B value", "B % std", "B |e %|")
    assert {"Iam3", "MY2", "Fcm1"} <= {row[0] for row in rows}


def truth_of(name, truth_c):
    """Base parameters of another model from those of model C, read as standard parameters."""
    model = generated.load("kuka_lwr4p", name)
    standard = {key.removesuffix("R"): value for key, value in truth_c.items()}
    chi = model.regroup({key: value for key, value in standard.items() if key in model.standard_parameters})
    return dict(zip(model.parameters, chi))


def test_drive_gains_are_identified_with_both_signals(tmp_path):
    columns, truth = recording("C", seconds=60, seed=4)
    gains = np.array([100.0, 140, 110, 112, 62, 86, 45])
    for j in range(7):
        columns[f"i{j + 1}"] = columns.pop(f"tau_m{j + 1}") / gains[j]
    write_parquet(tmp_path / "run.parquet", columns)
    for model in ("C", "D"):
        result = run(tmp_path, [{"file": "run.parquet"}], model=model, drive_gains="identify")
        found = [result.estimate.chi[result.columns.parameters.index(f"g{j + 1}")] for j in range(7)]
        assert np.allclose(found, gains, rtol=0.02), model
        assert result.relative_error["identify"]["total"] < 5
    some = [f"tau_{kind}{j}" for kind in "ml" for j in range(1, 8) if (kind, j) != ("m", 4)]
    result = run(tmp_path, [{"file": "run.parquet"}], model="C", drive_gains="identify", channels=some)
    assert np.allclose(drive_gains(result), [*gains[:3], 1.0, *gains[4:]], rtol=0.02)
    alone = run(tmp_path, [{"file": "run.parquet"}], model="A", drive_gains="identify")
    assert alone.notes[0].startswith("drive gains as identified by model C") and inside(
        alone, truth_of("A", truth), 0.7
    )
    write_parquet(tmp_path / "motor.parquet", {k: v for k, v in columns.items() if not k.startswith("tau_l")})
    with pytest.raises(StudyError, match="payload_mass"):
        run(tmp_path, [{"file": "motor.parquet"}], model="A", drive_gains="identify")
    with pytest.raises(StudyError, match="choose C or D"):
        run(tmp_path, [{"file": "run.parquet"}], model="B", drive_gains="identify")


def test_a_weighed_payload_is_the_reference_where_there_is_no_sensor(tmp_path):
    free, truth = recording("A", payload="L", seconds=60, seed=5, carried=False, noise=0.05)
    loaded, _ = recording("A", payload="L", seconds=60, seed=6, noise=0.05)
    gains = np.array([10.0, 14, 11, 11, 6, 8, 4])
    for name, columns in (("free", free), ("loaded", loaded)):
        drive = {f"i{j + 1}": columns.pop(f"tau_m{j + 1}") / gains[j] for j in range(7)}
        write_parquet(tmp_path / f"{name}.parquet", columns | drive)
    result = run(
        tmp_path,
        [{"file": "free.parquet"}, {"file": "loaded.parquet", "payload": "L"}],
        drive_gains="identify",
        payload_mass={"L": float(truth["ML"])},
    )
    found = np.array([result.estimate.chi[result.columns.parameters.index(f"g{j + 1}")] for j in range(7)])
    assert np.allclose(found, gains, rtol=0.05)


def test_joint_positions_follow_the_stiffness(tmp_path):
    columns, _truth = recording("B", seconds=40, seed=7)
    stiffness = [10000.0] * 5 + [7500.0] * 2
    soft = dict(columns)
    for j in range(7):
        soft[f"q{j + 1}"] = columns[f"q{j + 1}"] + columns[f"tau_l{j + 1}"] / stiffness[j]
    write_parquet(tmp_path / "run.parquet", soft)
    result = run(tmp_path, [{"file": "run.parquet"}], model="B", positions="joint", stiffness=stiffness)
    write_parquet(tmp_path / "stiff.parquet", columns)
    same(result, run(tmp_path, [{"file": "stiff.parquet"}], model="B"), 1e-3)


def test_with_joint_positions_a_rotor_keeps_the_acceleration_of_its_motor(tmp_path):
    model, stiffness = generated.load(ROBOT, "C"), 300.0  # N m/rad: soft enough to see
    t, q, dq, ddq = motion(30.0, 200.0, 7)
    chi = true_chi(model)
    chi[[name.startswith("Fc") for name in model.parameters]] = 0.0  # whose steps no difference follows
    tau = np.asarray(model.torque(q, dq, ddq, chi))
    bend = tau[:, 7:] / stiffness
    rotors = [model.parameters.index(f"Iam{j}") for j in range(1, 8)]
    tau[:, :7] += chi[rotors] * np.gradient(np.gradient(bend, t, axis=0), t, axis=0)
    columns = {"t": t} | {f"q{j + 1}": (q + bend)[:, j] for j in range(7)}
    write_parquet(tmp_path / "run.parquet", columns | dict(zip(model.channels, tau.T)))
    keys = {"filter": {"decimation_cutoff_hz": 2.0}, "without": ["coulomb_friction"], "model": "C"}
    entries = [{"file": "run.parquet"}]
    fit = run(tmp_path, entries, positions="joint", stiffness=[stiffness] * 7, **keys)
    found = [fit.full.chi[fit.columns.parameters.index(f"Iam{j}")] for j in range(1, 8)]
    assert np.allclose(found, chi[rotors], rtol=0.01)


def test_terms_left_out(tmp_path, table):
    write_parquet(tmp_path / "run.parquet", table[0])
    result = run(tmp_path, [{"file": "run.parquet"}], without=["coulomb_friction", "offset:2"])
    left = set(result.columns.parameters)
    assert not {name for name in left if name.startswith("Fc")}
    assert "Offm2R" not in left and "Offm3R" in left
    assert result.relative_error["identify"]["total"] > 5


def test_huber_resists_spikes(tmp_path, table):
    columns = {name: values.copy() for name, values in table[0].items()}
    columns["tau_m2"][2000:2100] += 800.0
    write_parquet(tmp_path / "run.parquet", columns)
    plain, robust = (
        run(tmp_path, [{"file": "run.parquet"}], robust=how, reduction=False) for how in (None, "huber")
    )
    truth = np.array([table[1][name] for name in plain.columns.parameters])
    assert np.linalg.norm(robust.full.chi - truth) < 0.5 * np.linalg.norm(plain.full.chi - truth)


def test_automatic_cutoff_obeys_the_rule(tmp_path, table):
    write_parquet(tmp_path / "run.parquet", table[0])
    result = run(tmp_path, [{"file": "run.parquet"}], filter={"position_cutoff_hz": 10})
    assert result.cutoff_trials and result.cutoff_hz in [trial.cutoff_hz for trial in result.cutoff_trials]
    assert 1 <= result.durbin_watson <= 3
    assert inside(result, table[1])


def test_a_slow_log_is_filtered_as_it_can_be_and_that_is_said(tmp_path):
    """Of logs of 20 Hz the default filter was refused, which nobody had written."""
    write_parquet(tmp_path / "run.parquet", recording("A", seconds=120, rate=20)[0])
    document = fit_document(run(tmp_path, [{"file": "run.parquet"}], filter={"decimation_cutoff_hz": 1}))
    assert document["filter"]["position_cutoff_hz"] == 8.0
    assert any("recorded at 20 Hz" in note and "8 Hz instead of 10" in note for note in document["notes"])
    with pytest.raises(StudyError, match="write at most 9"):
        run(tmp_path, [{"file": "run.parquet"}], filter={"position_cutoff_hz": 10})


def test_a_check_of_a_slow_log_says_the_filter_that_it_goes_through(tmp_path):
    """Of positions in steps of 2 mrad that scatter as well, logged at 20 Hz and filtered at 8, it said 10."""
    columns = dict(recording("A", seconds=120, rate=20)[0])
    noise = 1.5e-3 * np.random.default_rng(0).normal(size=len(columns["q1"]))
    columns["q1"] = np.round((columns["q1"] + noise) / 2e-3) * 2e-3
    write_parquet(tmp_path / "run.parquet", columns)
    result = run(tmp_path, [{"file": "run.parquet"}], filter={"decimation_cutoff_hz": 1})
    (coarse,) = (check for check in result.checks if check.check == "coarse_signal")
    assert "behind a filter of 8 Hz" in coarse.message


@pytest.mark.parametrize(("rate", "step"), [(20, 4e-3), (100, 1e-3), (100, 4e-3)])
def test_steps_that_a_lowered_filter_takes_away_are_not_told(tmp_path, rate, step):
    """Of a slow arm it said that steps make up 37 % of its acceleration behind 10 Hz, where it took 1.7."""
    columns = dict(recording("A", seconds=60, rate=rate)[0])
    columns["q1"] = np.round(columns["q1"] / step) * step
    write_parquet(tmp_path / "run.parquet", columns)
    result = run(tmp_path, [{"file": "run.parquet"}], filter={"decimation_cutoff_hz": 1})
    assert not {"coarse_signal", "noisy_position"} & {check.check for check in result.checks}


def test_document_follows_the_contract(tmp_path, reference, table):
    document = json.loads(json.dumps(fit_document(reference)))
    assert {
        "robot",
        "model",
        "base_parameters",
        "essential_parameters",
        "parameters",
        "relative_error_percent",
        "full_rate_error_percent",
        "tests",
    } <= set(document)
    assert set(document["tests"]) >= {"durbin_watson", "kolmogorov_smirnov", "condition_number", "rows"}
    row = document["parameters"][0]
    assert {"name", "value", "std", "relative_std_percent", "essential", "unit", "regroups"} <= set(row)
    assert document["base_parameters"] == len(document["parameters"])
    assert document["essential_parameters"] == sum(row["essential"] for row in document["parameters"])
    assert all(row["value"] == 0 for row in document["parameters"] if not row["essential"])
    assert list(document["relative_error_percent"]["identify"]) == ["total"] + [
        f"tau_m{j}" for j in range(1, 8)
    ]
    (tmp_path / "out").mkdir()
    write_into(reference, tmp_path / "out")
    assert json.loads((tmp_path / "out" / "fit.json").read_text())["robot"] == "kuka_lwr4p"
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "fit.json",
        "fit.npz",
        "parameters.csv",
        "errors.csv",
        "reduction.csv",
        "plots",
    }
    assert len(parameter_table(reference)[1]) == reference.estimate.b
    assert error_table(reference)[1][0][0] == "total"


def test_a_window_is_cut_before_anything_else(tmp_path, table):
    write_parquet(tmp_path / "run.parquet", table[0])
    result = run(
        tmp_path,
        [
            {"file": "run.parquet", "name": "first", "to": 30},
            {"file": "run.parquet", "name": "rest", "from": 30, "use": "validate"},
        ],
    )
    first, rest = result.systems
    assert first.segments[0].t[-1] < 30 < rest.segments[0].t[0]
    assert set(result.relative_error) == {"identify", "validate"}


def test_a_run_that_does_not_excite_is_told_by_name(tmp_path):
    moving, truth = recording("A", seconds=40, seed=8)
    model = generated.load("kuka_lwr4p", "A")
    t, q, dq, ddq = motion(40, 200, 9)
    q[:, 4], dq[:, 4], ddq[:, 4] = 0.3, 0.0, 0.0
    tau = model.torque(q, dq, ddq, np.array([truth[name] for name in model.parameters]))
    tau = tau + 0.2 * np.random.default_rng(0).normal(size=tau.shape)
    half = (
        {"t": t} | {f"q{j + 1}": q[:, j] for j in range(7)} | {f"tau_m{j + 1}": tau[:, j] for j in range(7)}
    )
    write_parquet(tmp_path / "moving.parquet", moving)
    write_parquet(tmp_path / "half.parquet", half)
    result = run(tmp_path, [{"file": "moving.parquet"}, {"file": "half.parquet"}])
    said = next(warning for warning in result.warnings if warning.startswith("half: does not excite"))
    assert {"Iam5", "Fvm5R", "Fcm5R"} <= set(said.replace(",", " ").split())
    assert inside(result, truth)
    # alone it leaves these parameters open, says so, and identifies the others
    alone = run(tmp_path, [{"file": "half.parquet"}])
    told = next(text for text in alone.warnings if "not excited at all" in text)
    assert {"Iam5", "Fvm5R", "Fcm5R"} & set(told.replace(",", " ").split()) and "joint 5" in told
    assert {"Iam5", "Fvm5R", "Fcm5R"}.isdisjoint(alone.reduction.essential)
    k = alone.columns.parameters.index("Fcm1R")
    assert abs(alone.estimate.chi[k] - truth["Fcm1R"]) < 4 * alone.std[k]


def test_figures_take_results_and_an_axes(reference):
    from matplotlib.figure import Figure

    from ident.report import fit_plots as plots

    axes = Figure().subplots(2)
    lines = plots.torque(reference.errors.curves[0], 0, axes[0])
    assert [line.get_label() for line in lines] == ["measured", "reconstructed", "error"]
    measured, modelled, error = (line.get_ydata() for line in lines)
    assert np.allclose(measured - modelled, error)
    assert plots.histogram(reference.normalised, axes[1])


def test_memory_does_not_grow_with_the_log(tmp_path, monkeypatch):
    """Peak of traced allocations, ten times the samples: only decimated rows may add to it."""
    import tracemalloc

    import ident.recordings.held

    monkeypatch.setattr(ident.recordings.held, "NUMBERS", 0)
    columns, _ = recording("B", seconds=100, rate=500)
    write_parquet(tmp_path / "short.parquet", columns)
    long = {name: np.concatenate([values] * 8) for name, values in columns.items()}
    long["t"] = np.concatenate([columns["t"] + 101.0 * k for k in range(8)])
    write_parquet(tmp_path / "long.parquet", long)
    peaks = []
    for name in ("short", "long"):
        study = load_study(write_study(tmp_path, [{"file": f"{name}.parquet"}], model="B"))
        prepared = prepare_study(study)
        tracemalloc.start()
        build(prepared, 0.5)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.5 * peaks[0], peaks
