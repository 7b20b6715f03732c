"""Keys that shape the equations: channels, gravity, turn_over, payload labels."""

import numpy as np
import pytest
from recordings import recording, write_parquet, write_study

import generated
from ident.equations.build import build
from ident.equations.prepared import columns_of, prepare_study
from ident.errors import StudyError
from ident.estimation.fit import fit_study
from ident.recordings.study import load_study

pytestmark = pytest.mark.unexamined


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("keys")
    for model in "AC":
        columns, _ = recording(model, seconds=30)
        write_parquet(folder / f"{model}.parquet", columns)
        torques = ("tau_m2", "tau_m5", "tau_l5")
        few = {name: x for name, x in columns.items() if "tau" not in name or name in torques}
        write_parquet(folder / f"few_{model}.parquet", few)
    return folder


def study(folder, file="A.parquet", **keys):
    return load_study(write_study(folder, [{"file": file}], **keys))


def dense(system, b):
    return [np.vstack([system.dense(s, j, b) for s in system.segments]) for j in range(len(system.factors))]


@pytest.mark.parametrize(
    ("model", "chosen", "left"),
    [
        ("A", ["tau_m2", "tau_m5"], ["tau_m2", "tau_m5"]),
        ("C", ["tau_l5", "tau_m2"], ["tau_m2", "tau_l5"]),
        ("D", ["tau_m5", "tau_l5", "tau_m2"], ["tau_d5"]),
        ("B", ["tau_l5", "tau_m2"], ["tau_l5"]),
    ],
)
def test_channels_take_rows_away_and_nothing_else(folder, model, chosen, left):
    file = "A.parquet" if model == "A" else "C.parquet"
    whole = prepare_study(study(folder, file, model=model))
    part = prepare_study(study(folder, f"few_{file}", model=model, channels=chosen))
    assert list(part.columns.channels) == left
    (all_rows,), (rows,) = build(whole, 2.0), build(part, 2.0)
    W, few = dense(all_rows, len(whole.columns.parameters)), dense(rows, len(part.columns.parameters))
    place = [whole.columns.parameters.index(name) for name in part.columns.parameters]
    for k, name in enumerate(left):
        j = whole.columns.channels.index(name)
        assert np.allclose(few[k], W[j][:, place])
        assert np.allclose(np.delete(W[j], place, axis=1), 0)  # parameters that are gone had no part in it
        assert np.allclose(rows.segments[0].Y[k], all_rows.segments[0].Y[j])


def test_channels_fit_and_report(folder):
    result = fit_study(study(folder, "few_A.parquet", channels=["tau_m2", "tau_m5"]))
    assert set(result.relative_error["identify"]) == {"total", "tau_m2", "tau_m5"}
    assert result.relative_error["identify"]["total"] < 5


def test_channels_with_identified_gains(folder):
    keys = {"model": "C", "drive_gains": "identify", "columns": {"i2": "tau_m2", "i5": "tau_m5"}}
    result = fit_study(study(folder, "few_C.parquet", channels=["tau_m5", "tau_l5"], **keys))
    assert [name for name in result.columns.parameters if name.startswith("g")] == ["g5"]
    assert result.estimate.chi[result.columns.parameters.index("g5")] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"channels": ["tau_m9"]}, ("channels", "tau_m9")),
        ({"channels": ["tau_l2"]}, ("channels", "tau_l2", "tau_m1")),
        ({"channels": ["tau_m2", "tau_m2"]}, ("channels", "twice")),
        ({"turn_over": [0.1]}, ("turn_over", "7 joints")),
        ({"estimator": "iv"}, ("estimator", "controller")),
        ({"gravity": [0, 0]}, ("gravity",)),
    ],
)
def test_refusals(folder, keys, words):
    with pytest.raises(StudyError) as caught:
        prepare_study(study(folder, **keys))
    assert all(word in str(caught.value) for word in words) and "\n" not in str(caught.value)


@pytest.mark.parametrize("labels", [("X4",), ("L", "LR"), ("L", "XL")])
def test_payload_labels_that_make_other_parameters(folder, labels):
    entries = [{"file": "A.parquet", "name": f"run{k}", "payload": label} for k, label in enumerate(labels)]
    with pytest.raises(StudyError, match="label"):
        columns_of(load_study(write_study(folder, entries)))


def test_turn_over_is_the_sign_of_the_model(folder):
    width = 0.3
    (plain,) = build(prepare_study(study(folder)), 2.0)
    prepared = prepare_study(study(folder, turn_over=[0.0, width, 0, 0, 0, 0, 0]))
    (bent,) = build(prepared, 2.0)
    names = prepared.columns.parameters
    for joint in (1, 2):
        column = next(k for k, name in enumerate(names) if name.removesuffix("R") == f"Fcm{joint + 1}")
        a, b = (dense(system, len(names))[joint][:, column] for system in (plain, bent))
        assert np.allclose(a, b) == (joint == 2)
    assert (
        0.5 < np.linalg.norm(dense(bent, len(names))[1]) / np.linalg.norm(dense(plain, len(names))[1]) < 1.0
    )


def test_gravity_is_the_models(folder):
    turned = columns_of(study(folder, gravity=[0, 0, -9.81]))
    assert turned.model.parameters == generated.load("kuka_lwr4p", "A").parameters
