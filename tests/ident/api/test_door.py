"""The door for Python: the same numbers as the inner rooms and the command, from files and from tables."""

import inspect
import json
import pkgutil
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest
from small_arm import ARM

import ident
from ident.signals.filtering import zero_phase

pytestmark = pytest.mark.unexamined


@pytest.fixture(scope="module")
def twin(tmp_path_factory):
    folder = tmp_path_factory.mktemp("door")
    (folder / "small.yaml").write_text(ARM)
    return ident.simulate(
        folder / "small.yaml", "C", ["stribeck_friction:2"], duration=20, rate_hz=250, noise=0.5, seed=1
    )


@pytest.fixture(scope="module")
def fit(twin):
    return ident.fit(twin.study)


def numbers(table, *names):
    return [np.asarray(table[name], dtype=float) for name in names]


def test_importing_it_costs_nothing_and_shows_all_names():
    code = (
        "import sys, ident; heavy = {'numpy', 'scipy', 'pydantic', 'sympy', 'typer'} & set(sys.modules);"
        "assert set(ident.__all__) <= set(dir(ident)); sys.exit(str(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert all(getattr(ident, name) for name in ident.__all__ if name != "register")
    assert inspect.isfunction(ident.simulate)
    rooms = {module.name for module in pkgutil.iter_modules(ident.__path__)}
    assert not rooms & set(ident.__all__)  # importing a room puts its name here
    with pytest.raises(AttributeError, match="no attribute 'fitt'"):
        _ = ident.fitt


def test_a_saved_study_gives_the_same_fit_as_tables_in_memory(twin, fit, tmp_path):
    loaded = ident.load(twin.save(tmp_path / "twin"))
    again = ident.fit(loaded)
    assert again.parameters == fit.parameters and again.chi == pytest.approx(fit.chi, rel=1e-9, abs=1e-12)
    assert repr(loaded) == "Study('small.yaml', model='C', 4 recordings)"
    with pytest.raises(ident.Error, match="run1: column q1 is missing"):
        ident.fit(
            ident.Study(robot=loaded.robot_source, recordings=[{"t": np.arange(9.0), "z": np.arange(9.0)}])
        )


@pytest.mark.parametrize("kind", ["dict", "matrices", "arrow", "frame", "path"])
def test_every_kind_of_table_gives_the_same_numbers(kind, twin, tmp_path):
    run = dict(twin.result.recordings[1].columns)
    if kind == "matrices":
        data = {
            "t": run["t"],
            **{k: np.stack([run[f"{k}{j}"] for j in (1, 2, 3)], 1) for k in ("q", "tau_m")},
        }
    elif kind == "frame":
        data = pytest.importorskip("pandas").DataFrame(run)
    elif kind == "path":
        twin.save(tmp_path / "twin")
        data = tmp_path / "twin" / "run2.parquet"
    else:
        data = pa.table(run) if kind == "arrow" else run
    one = ident.Study(robot=twin.study.robot, recordings=[ident.Recording(data)], reduction=False)
    expected = ident.Study(robot=twin.study.robot, recordings=[run], reduction=False)
    assert ident.fit(one).chi == pytest.approx(ident.fit(expected).chi, rel=1e-9, abs=1e-12)


def test_a_fit_answers_questions(fit):
    table = fit.to_frame()
    assert list(table["name"]) == list(fit.parameters)
    value, std = numbers(table, "value", "std")
    assert value == pytest.approx(fit.chi) and std == pytest.approx(np.sqrt(np.diag(fit.covariance)))
    interval = fit.conf_int(0.9)
    low, high = numbers(interval, "low", "high")
    assert (low < fit.chi[fit.essential]).all() and (fit.chi[fit.essential] < high).all()
    wider = fit.conf_int(0.99)
    assert (numbers(wider, "low")[0] < low).all()
    with pytest.raises(ident.Error, match="probability between 0 and 1"):
        fit.conf_int(95)
    rest = fit.residuals("run3")
    rows = np.stack(numbers(rest, *fit.channels), axis=1)
    sums = np.nansum(rows**2)
    errors = fit.result.errors.decimated
    assert sums == pytest.approx(errors.above["run3"].sum(), rel=0.2)  # those count rest as well
    with pytest.raises(ident.Error, match="there is no recording 'sunday'"):
        fit.residuals("sunday")


def test_prediction_is_the_torque_of_the_identified_parameters(twin, fit):
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.normal(size=(3, 20, 3))
    chi = fit.result.columns.model_chi(fit.chi, None)
    expected = fit.result.columns.model.torque(q, dq, ddq, chi)
    assert fit.predict(q, dq, ddq) == pytest.approx(expected, abs=1e-12)
    assert fit.predict({"q": q, "dq": dq, "ddq": ddq}) == pytest.approx(expected, abs=1e-12)
    run = twin.result.recordings[2].columns
    made = fit.predict({name: run[name] for name in ("t", "q1", "q2", "q3")})  # no torque is needed
    (t,) = numbers(made, "t")
    moving = (t > 0.6) & (t < t[-1] - 0.6)  # rest at the ends is not in the fit's error
    for name in fit.channels:
        smooth = np.interp(t, run["t"], zero_phase(run[name], 250.0, 10.0))[moving]  # as the fit compares
        error = 100 * np.linalg.norm(smooth - numbers(made, name)[0][moving]) / np.linalg.norm(smooth)
        assert error == pytest.approx(fit.error_percent["validate"][name], rel=0.1)
    with pytest.raises(ident.Error, match="ddq has shape"):
        fit.predict(q, dq, ddq[:, :1])
    with pytest.raises(ident.Error, match="different numbers of rows"):
        fit.predict(q, dq, ddq[:9])
    with pytest.raises(ident.Error, match="payload 'L' was not identified"):
        fit.predict(run, payload="L")


def test_effects_of_a_study_are_fitted_and_predicted(twin, fit):
    pytest.importorskip("ident.equations.terms")
    study = twin.study
    keys = {name: getattr(study, name) for name in ("robot", "model", "recordings")}
    extended = ident.fit(ident.Study(effects=["stribeck_friction:2"], **keys))
    assert extended.error_percent["validate"]["total"] < 0.7 * fit.error_percent["validate"]["total"]
    assert any("stribeck_friction" in name for name in extended.parameters)
    run = twin.result.recordings[2].columns
    made = extended.predict(run)
    (t,) = numbers(made, "t")
    bare = extended.predict({name: column for name, column in run.items() if not name.startswith("tau")})
    np.testing.assert_allclose(numbers(bare, "tau_m2")[0], numbers(made, "tau_m2")[0], rtol=1e-9)
    moving = (t > 0.6) & (t < t[-1] - 0.6)
    smooth = np.interp(t, run["t"], zero_phase(run["tau_m2"], 250.0, 10.0))[moving]
    error = 100 * np.linalg.norm(smooth - numbers(made, "tau_m2")[0][moving]) / np.linalg.norm(smooth)
    assert error == pytest.approx(extended.error_percent["validate"]["tau_m2"], rel=0.1)
    with pytest.raises(ident.Error, match="effects, which need a history"):
        extended.predict(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 3)))


def test_results_read_like_the_report_and_fit_in_a_line(twin, fit):
    assert str(fit) == fit.summary() and "base parameters explain the torque" in str(fit)
    assert "What is left:" in str(fit) and "ident diagnose looks for" in str(fit)
    html = fit._repr_html_()
    assert html.count("<table>") == 1 and "base parameters explain" in html and len(html) < 1e5
    for value in (fit, twin, twin.study, twin.study.recordings[0]):
        assert "\n" not in repr(value) and len(repr(value)) < 160
    assert str(twin).splitlines()[2].split() == ["run1", "identify", "20", "5001"]


def test_saving_twice_keeps_an_edit(fit, tmp_path):
    fit.save(tmp_path / "out")
    assert json.loads((tmp_path / "out" / "fit.json").read_text())["model"] == "C"
    fit.save(tmp_path / "out")
    (tmp_path / "out" / "errors.csv").write_text("mine")
    with pytest.raises(ident.Error, match=r"errors[.]csv was changed since it was written"):
        fit.save(tmp_path / "out")
    fit.report(tmp_path / "fit.html")
    assert "<!doctype html>" in (tmp_path / "fit.html").read_text(encoding="utf-8")[:20]
    with pytest.raises(ident.Error, match="is there already"):
        fit.report(tmp_path / "fit.html")


def test_progress_is_told_to_a_callback_and_never_printed(twin, capsys):
    told = []
    ident.fit(twin.study, progress=lambda text, done=None: told.append((text, done)))
    assert told[0][0] == "loading the model" and any(done == 1.0 for _, done in told)
    ident.fit(twin.study)
    seen = capsys.readouterr()
    assert seen.out == seen.err == ""


def test_models_side_by_side(twin):
    both = ident.compare(twin.study, ["a", "B"])
    assert list(both.fits) == ["A", "B"] and "B value" in str(both)
    with pytest.raises(ident.Error, match="there is no model E"):
        ident.compare(twin.study, "E")


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: ident.load("nowhere.yaml"), "nowhere.yaml: there is no such file"),
        (lambda: ident.fit(3), "give ident.Study or the path of a study"),
        (lambda: ident.Study(robot="ur10e"), "recordings: this key is missing"),
        (lambda: ident.Study(robot="ur10e", recordings=[]), "the list is empty"),
        (lambda: ident.Study(robot="ur10e", recordings=["a.csv"], modle="A"), "did you mean model"),
        (lambda: ident.Recording("a.csv", "fit"), "'fit' is not one of"),
        (lambda: ident.fit(ident.Study(robot="nobody", recordings=["a.csv"])), "nobody"),
        (lambda: ident.fit(ident.Study(robot="ur10e", recordings=[3])), "is int, not a table"),
        (lambda: ident.simulate("ur10e", duration="long"), "duration is 'long'"),
        (lambda: ident.simulate("ur10e", rate_hz=0), "rate_hz is 0; give 20 to 20000"),
        (lambda: ident.simulate("ur10e", effects=[{"joint": 1}]), "is no effect"),
        (lambda: ident.simulate("ur10e", effects="gremlins:1"), "gremlins"),
        (lambda: ident.diagnose("nowhere.yaml", memory="2 apples"), "is no size"),
    ],
)
def test_errors_are_one_family_with_one_sentence(call, said):
    with pytest.raises(ident.Error) as error:
        call()
    assert said in str(error.value) and "\n" not in str(error.value)


def test_effects_are_written_as_text_or_as_a_mapping():
    wanted = {"effect": "torque_ripple", "joint": 2, "wavenumber": 20.0}
    as_text = ident.simulate("ur10e", effects=["torque_ripple:2:wavenumber=20.0"], duration=5, rate_hz=50)
    as_mapping = ident.simulate("ur10e", effects=[wanted], duration=5, rate_hz=50)
    assert as_text.truth == as_mapping.truth and len(as_text.truth["effects"]) == 1


def test_sizes_of_memory():
    from ident.api.diagnosis import size_in_bytes

    assert [size_in_bytes(text) for text in ("2GB", "1.5 gib", "500M", 10**9)] == [
        2 * 10**9,
        15 * 10**8,
        5 * 10**8,
        10**9,
    ]


@pytest.mark.slow
def test_a_diagnosis_answers_questions(twin, tmp_path):
    found = ident.diagnose(twin.study)
    first = found.document()["findings"][0]
    assert (first["effect"], first["joints"]) == ("stribeck_friction", [2])
    assert "stribeck_friction:2" in repr(found) and len(repr(found)) < 400
    assert "The model lacks" in str(found) and "stribeck friction" in found._repr_html_()
    table = found.to_frame()
    assert "stribeck_friction" in list(table["effect"]) and {"parameter", "value", "std"} <= set(
        getattr(table, "column_names", None) or table.columns
    )
    found.save(tmp_path / "out")
    assert json.loads((tmp_path / "out" / "diagnosis.json").read_text())["verdict"] == found.verdict
