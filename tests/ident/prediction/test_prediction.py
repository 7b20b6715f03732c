"""The band of a kept fit on new logs: clean ones stay inside, what happened to the robot does not."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from recordings import motion, true_chi, write_parquet, write_study

import generated
from ident.command_line.cli import run
from ident.errors import IdentError
from ident.estimation.fit import fit_study
from ident.export.saved import load_fit
from ident.prediction.files import write_prediction
from ident.prediction.prediction import predict
from ident.recordings.study import load_study
from ident.report.files import write_into

pytestmark = pytest.mark.unexamined

RATE, NOISE = 200.0, 0.6


def log(folder, name, seed, change=None, seconds=30.0, held=()):
    """A run with noise that neighbouring samples share; `change(t, q, dq, tau)` happens to the robot."""
    model = generated.load("kuka_lwr4p", "A")
    t, q, dq, ddq = motion(seconds, RATE, seed)
    for j in held:
        q[:, j], dq[:, j], ddq[:, j] = 0.4, 0.0, 0.0
    tau = np.asarray(model.torque(q, dq, ddq, true_chi(model)))
    rng = np.random.default_rng([seed, 9])
    noise = rng.normal(size=tau.shape)
    slow = np.zeros_like(noise)
    for k in range(1, len(noise)):  # half a second of memory
        slow[k] = 0.99 * slow[k - 1] + 0.14 * rng.normal(size=7)
    tau = tau + NOISE * (noise + 0.3 * slow)
    if change:
        change(t, q, dq, tau)
    columns = {"t": t} | {f"q{j + 1}": q[:, j] for j in range(7)}
    return write_parquet(folder / f"{name}.parquet", columns | {f"tau_m{j + 1}": tau[:, j] for j in range(7)})


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fit")
    uses = {"a": "identify", "b": "identify", "c": "validate"}
    for seed, name in enumerate(uses, 1):
        log(folder, name, seed)
    entries = [{"file": f"{name}.parquet", "use": use} for name, use in uses.items()]
    result = fit_study(load_study(write_study(folder, entries)))
    (folder / "out").mkdir()
    write_into(result, folder / "out", plots=False)
    return load_fit(folder / "out")


def test_95_percent_means_95_percent_on_clean_logs(kept, tmp_path):
    inside = []
    for seed in range(20, 26):
        found = predict(kept, log(tmp_path, f"clean{seed}", seed))
        assert not found.excursions
        for t, measured, predicted in found.full_rate():
            held = np.abs(measured - predicted) <= found.band(t)
            inside.append(held[found.judged(t)])
    assert 0.935 < np.concatenate(inside).mean() < 0.965


def test_a_contact_is_pointed_out_where_and_when_it_was(kept, tmp_path):
    def push(t, q, dq, tau):
        tau[:, 2] += 6.0 * ((t > 12.0) & (t < 13.0))

    found = predict(kept, log(tmp_path, "contact", 30, push))
    assert {e.channel for e in found.excursions} == {"tau_m3"}
    first = found.excursions[0]
    assert abs(first.start - 12.0) < 0.5 and abs(first.stop - 13.0) < 0.5 and first.kind == "short"
    assert first.mean == pytest.approx(6.0, abs=2.0)


def test_friction_that_rose_lasts(kept, tmp_path):
    def wear(t, q, dq, tau):
        tau[:, 4] += 1.5 * np.sign(dq[:, 4])

    found = predict(kept, log(tmp_path, "wear", 31, wear))
    assert {e.channel for e in found.excursions} == {"tau_m5"}
    spans = sum(e.stop - e.start for e in found.excursions)
    assert spans > 20 and found.excursions[0].kind == "lasting"


def test_a_payload_from_a_moment_on(kept, tmp_path):
    model = generated.load("kuka_lwr4p", "A", payload="L")
    load = np.array([2.0 if name == "ML" else 0.0 for name in model.parameters])

    def grasp(t, q, dq, tau):
        still = np.zeros_like(q)
        tau += model.torque(q, still, still, load) * (t > 15.0)[:, None]

    found = predict(kept, log(tmp_path, "payload", 32, grasp))
    assert len({e.channel for e in found.excursions}) >= 2
    assert min(e.start for e in found.excursions) > 14.0
    assert min(e.start for e in found.excursions) < 17.0


def test_files(kept, tmp_path):
    found = predict(kept, log(tmp_path, "new", 33))
    (tmp_path / "out").mkdir()
    document = json.loads(json.dumps(write_prediction(found, tmp_path / "out")))
    table = pq.read_table(tmp_path / "out" / "predict.parquet").to_pydict()
    error = np.array(table["tau_m2"]) - np.array(table["tau_m2_predicted"])
    assert np.std(error) < 2 * NOISE and not any(table["tau_m2_outside"])
    assert np.allclose(np.diff(table["t"]), 1 / RATE)
    assert document["verdict"] == "inside" and set(document["inside_band_percent"]) == set(
        kept.columns.channels
    )
    assert (tmp_path / "out" / "predict.svg").stat().st_size > 10000


def without(file, *words):
    """The same table without the columns that begin with these words."""
    table = pq.read_table(file)
    kept = [name for name in table.column_names if not name.startswith(words)]
    target = file.with_stem(f"{file.stem}_bare")
    pq.write_table(table.select(kept), target)
    return target


def test_a_log_without_torques_is_predicted_alone(kept, tmp_path, capsys):
    whole = log(tmp_path, "monday", 36, seconds=12)
    bare = without(whole, "tau")
    for file, out in ((whole, "whole"), (bare, "bare")):
        assert run(["predict", str(kept.folder), str(file), "-o", str(tmp_path / out)]) == 0
    assert "holds no torques" in capsys.readouterr().out
    known, alone = (pq.read_table(tmp_path / out / "predict.parquet") for out in ("whole", "bare"))
    assert [n for n in alone.column_names if n.startswith("tau_m1")] == ["tau_m1_predicted", "tau_m1_band"]
    for name in alone.column_names:
        np.testing.assert_allclose(alone[name], known[name], rtol=1e-9, atol=1e-9)
    document = json.loads((tmp_path / "bare" / "predict.json").read_text())
    assert document["verdict"] == "not compared" and document["excursions"] == []
    assert document["relative_error_percent"] == document["inside_band_percent"] == {}
    rms = np.sqrt(np.mean(np.square(alone["tau_m2_predicted"].to_numpy())))
    assert document["predicted_rms"]["tau_m2"] == pytest.approx(rms)
    with pytest.raises(IdentError, match="column tau_m3 is missing"):  # some are there: not a bare log
        predict(kept, without(log(tmp_path, "torn", 37, seconds=12), "tau_m3"))


def test_effects_of_a_study_are_part_of_the_prediction(tmp_path):
    def bend(t, q, dq, tau):
        tau[:, 1] += 4.0 * np.exp(-((dq[:, 1] / 0.15) ** 2)) * np.sign(dq[:, 1]) + 1.0 * np.sin(9 * q[:, 1])

    for seed, name in ((1, "a"), (2, "b"), (3, "c")):
        log(tmp_path, name, seed, bend)
    entries = [{"file": "a.parquet", "use": "identify"}, {"file": "b.parquet", "use": "validate"}]
    effects = [
        {"effect": "stribeck_friction", "joint": 2},
        {"effect": "torque_ripple", "joint": 2, "wavenumber": 9.0, "fixed": ["wavenumber"]},
    ]
    result = fit_study(load_study(write_study(tmp_path, entries, effects=effects)))
    (tmp_path / "out").mkdir()
    write_into(result, tmp_path / "out", plots=False)
    fit = load_fit(tmp_path / "out")
    assert [term.effect.name for term in fit.terms] == ["stribeck_friction", "torque_ripple"]
    np.testing.assert_allclose(fit.terms[0].at, result.terms[0].at, rtol=1e-12)
    again = predict(fit, tmp_path / "b.parquet")
    own = [piece for piece in fit.residuals if piece.label == "b"]
    rms = np.sqrt(sum(np.sum(piece.rho**2, axis=1) for piece in own) / sum(p.used.sum(axis=1) for p in own))
    np.testing.assert_allclose(list(again.rms.values()), rms, rtol=1e-3)  # residuals are kept in float32
    assert not predict(fit, tmp_path / "c.parquet").excursions
    bare, whole = (list(predict(fit, file).full_rate())
                   for file in (without(tmp_path / "c.parquet", "tau"), tmp_path / "c.parquet"))  # fmt: skip
    np.testing.assert_allclose(bare[0][2], whole[0][2], rtol=1e-9, atol=1e-9)
    clean = predict(fit, log(tmp_path, "mended", 4))
    assert {item.channel for item in clean.excursions} == {"tau_m2"}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of the checks, on a joint that never moves
def test_motion_that_the_fit_never_saw_is_told(tmp_path):
    for seed, name in ((1, "a"), (2, "b")):
        log(tmp_path, name, seed, held=[3])
    entries = [{"file": "a.parquet", "use": "identify"}, {"file": "b.parquet", "use": "validate"}]
    result = fit_study(load_study(write_study(tmp_path, entries)))
    (tmp_path / "out").mkdir()
    write_into(result, tmp_path / "out", plots=False)
    fit = load_fit(tmp_path / "out")
    again = predict(fit, tmp_path / "b.parquet")
    assert not any("is not predicted" in text for text in again.warnings)
    (tmp_path / "files").mkdir()
    write_prediction(
        again, tmp_path / "files"
    )  # a joint that is never judged has no band, and no plot of one
    moving = predict(fit, log(tmp_path, "c", 3))
    assert any("Fvm4R" in text and "is not predicted" in text for text in moving.warnings)


def test_a_payload_that_the_fit_does_not_know_is_refused(kept, tmp_path):
    with pytest.raises(IdentError, match="payload X is not one that the fit knows"):
        predict(kept, log(tmp_path, "loaded", 34, seconds=5), payload="X")


def test_the_commands(kept, tmp_path, capsys):
    file = log(tmp_path, "monday", 35, seconds=10)
    assert run(["predict", str(kept.folder), str(file), "-o", str(tmp_path / "out")]) == 0
    assert "Nothing leaves the fit's band" in capsys.readouterr().out
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"predict.json", "predict.csv", "predict.parquet", "predict.svg"} <= written
    assert run(["export", str(kept.folder), "--c", str(tmp_path / "c"), "--name", "arm"]) == 0
    assert (tmp_path / "c" / "arm.c").is_file() and (tmp_path / "c" / "arm.h").is_file()
    capsys.readouterr()
    for wrong, words in (
        (["export", str(kept.folder)], "nothing to write"),
        (["export", str(tmp_path), "--c", str(tmp_path / "c")], "holds no fit.json"),
        (["predict", str(kept.folder), str(tmp_path / "none.csv"), "-o", str(tmp_path / "p")], "none.csv"),
    ):
        assert run(wrong) == 2
        told = capsys.readouterr().err
        assert words in told and told.count("\n") == 1 and not (tmp_path / "p").exists()
