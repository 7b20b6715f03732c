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

RATE, NOISE = 200.0, 0.6


def log(folder, name, seed, change=None, seconds=30.0):
    """A run with noise that neighbouring samples share; `change(t, q, dq, tau)` happens to the robot."""
    model = generated.load("kuka_lwr4p", "A")
    t, q, dq, ddq = motion(seconds, RATE, seed)
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
