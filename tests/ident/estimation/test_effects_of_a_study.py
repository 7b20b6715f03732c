"""`effects:` in a study: the extended model is fitted whole, on twins whose truth is known."""

import json
from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
import yaml
from recordings import recording, write_parquet, write_study

from ident.equations.build import build
from ident.equations.prepared import prepare_study
from ident.errors import StudyError
from ident.estimation.fit import examined, fit_study
from ident.estimation.found_effects import extended_study, found_effects
from ident.estimation.shapes import extend
from ident.estimation.solving import estimate_all
from ident.recordings.study import load_study, study_from
from ident.report.files import fit_document
from ident.twin import PlannedRun, Sensors, simulate, write_simulation

pytestmark = pytest.mark.unexamined

RUNS = (PlannedRun("run1", "identify", 40.0, 20), PlannedRun("run3", "validate", 30.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Joint 2 with Stribeck friction, joint 4 with two ripples."""
    folder = tmp_path_factory.mktemp("effects")
    columns, _ = recording("A", seconds=60, rate=250)
    dq = np.gradient(columns["q2"], columns["t"])
    columns["tau_m2"] = columns["tau_m2"] + 5.0 * np.exp(-((dq / 0.1) ** 2)) * np.sign(dq)
    q = columns["q4"]
    columns["tau_m4"] = columns["tau_m4"] + 1.5 * np.sin(12 * q + 0.7) + 0.8 * np.sin(20 * q - 0.3)
    write_parquet(folder / "run.parquet", columns)
    return folder


def study(folder, effects, **keys):
    return load_study(write_study(folder, [{"file": "run.parquet"}], effects=effects, **keys))


@pytest.fixture(scope="module")
def result(folder):
    return fit_study(study(folder, ["stribeck_friction:2", "torque_ripple:4", "torque_ripple:4"]))


def test_truth_inside_its_intervals(result):
    stribeck, *ripples = found_effects(result)
    ripples = sorted(ripples, key=lambda found: found.parameters["wavenumber"].value)
    truth = [
        (stribeck, {"Fs": 5.0, "vs": 0.1}),
        (ripples[0], {"A": 1.5, "wavenumber": 12.0, "phi": 0.7}),
        (ripples[1], {"A": 0.8, "wavenumber": 20.0, "phi": -0.3}),
    ]
    for found, values in truth:
        for name, value in values.items():
            its = found.parameters[name]
            assert abs(its.value - value) < 3.3 * its.std, (found.term.label, name, its)
            assert its.std < 0.03 * max(abs(value), 1.0)


def test_a_size_is_told_from_zero_by_the_deviation_that_is_told(folder):
    """One size and no shape: its chance is that of a normal number so many deviations away."""
    (spring,) = found_effects(fit_study(study(folder, ["spring:3"])))
    its = spring.parameters["k"]
    assert spring.p_told == pytest.approx(2 * scipy.stats.norm.sf(abs(its.value) / its.std), rel=0.05)
    assert spring.p_told > spring.p_value


@pytest.mark.long
@pytest.mark.parametrize("gain", [0.1, 20.0])
def test_a_gain_is_found_however_large_it_is_with_what_acts_before_it(tmp_path, gain):
    """Sizes and the model are one product: both are what they are without the gain."""
    columns, _ = recording("A", seconds=40, rate=250)
    dq = np.gradient(columns["q2"], columns["t"])
    columns["tau_m2"] = columns["tau_m2"] + 5.0 * np.exp(-((dq / 0.1) ** 2)) * np.sign(dq)
    found = {}
    for times in (1.0, gain):
        write_parquet(tmp_path / "run.parquet", columns | {"tau_m2": times * columns["tau_m2"]})
        found[times] = fit_study(study(tmp_path, ["drive_gain_error:2", "stribeck_friction:2:vs=0.1"]))
    for times, fit in found.items():
        its, stribeck = (its.parameters for its in found_effects(fit))
        assert abs(its["gain"].value - times) < 3.3 * its["gain"].std < 0.1 * times
        assert abs(stribeck["Fs"].value - 5.0) < 3.3 * stribeck["Fs"].std
    one, other = (fit.relative_error["identify"]["total"] for fit in (found[1.0], found[gain]))
    assert other < 1.5 * one


def test_without_the_effects_the_error_is_larger(folder, result):
    plain = fit_study(study(folder, []))
    for errors in (lambda r: r.relative_error, lambda r: r.full_rate_error):
        assert errors(plain)["identify"]["total"] > 3 * errors(result)["identify"]["total"]
    assert plain.columns.parameters == result.columns.parameters[: len(plain.columns.parameters)]


def test_fit_json_has_the_effects(result):
    document = json.loads(json.dumps(fit_document(result)))
    assert [found["joint"] for found in document["effects"]] == [2, 4, 4]
    assert document["effects"][0]["parameters"]["vs"]["unit"] == "rad/s"
    names = [row["name"] for row in document["parameters"]]
    assert {"stribeck_friction:2.Fs", "torque_ripple:4.wavenumber", "torque_ripple:4#2.As"} <= set(names)
    assert document["base_parameters"] == len(names) - 8
    row = document["parameters"][names.index("stribeck_friction:2.vs")]
    assert row["value"] == pytest.approx(0.1, abs=0.01) and row["unit"] == "rad/s"


def test_the_extended_study_gives_the_same_numbers(folder, result):
    again = fit_study(study_from(yaml.safe_load(yaml.safe_dump(extended_study(result))), folder / "s.yaml"))
    assert again.columns.parameters == result.columns.parameters
    assert np.all(np.abs(again.estimate.chi - result.estimate.chi) <= 2e-2 * result.std + 1e-12)
    assert np.allclose(again.std, result.std, rtol=1e-2)


@pytest.mark.long
def test_equations_built_ahead_serve_every_fit_with_other_effects(folder):
    settings = {"decimation_cutoff_hz": 10.0}
    plain = study(folder, [], filter=settings)
    built = examined(plain).built()
    for effects in ([], ["stribeck_friction:2"], ["spring:6", "stribeck_friction:2"]):
        its = study(folder, effects, filter=settings)
        again = built.again(its)
        assert again.systems is built.systems
        fit, fresh = fit_study(its, known=again), fit_study(its)
        assert fit.columns.parameters == fresh.columns.parameters
        assert np.array_equal(fit.estimate.chi, fresh.estimate.chi) and np.array_equal(fit.std, fresh.std)
    for other in (
        plain.with_(turn_over=(0.01,) * 7),
        study(folder, [], filter={"decimation_cutoff_hz": 9.0}),
    ):
        assert built.again(other).systems is None


def test_what_is_fixed_stays(folder):
    entry = {"effect": "torque_ripple", "joint": 4, "wavenumber": 12.0, "fixed": ["wavenumber"]}
    found = found_effects(fit_study(study(folder, [entry, "stribeck_friction:2:vs=0.1,fixed=vs"])))
    assert found[0].parameters["wavenumber"].value == 12.0 and found[0].parameters["wavenumber"].given
    assert found[0].parameters["A"].value == pytest.approx(1.5, abs=0.1)
    assert found[1].parameters["vs"].std is None and found[1].parameters["Fs"].std > 0


def test_an_effect_that_is_not_there_is_cancelled_whole(folder):
    result = fit_study(study(folder, ["stribeck_friction:2", "stribeck_friction:5", "spring:6"]))
    there, *absent = found_effects(result)
    assert there.essential and not any(found.essential for found in absent)
    step = next(s for s in result.reduction.steps if s.dropped == "stribeck_friction:5.Fs")
    assert step.accepted and step.df_num in (1, 2)  # its shape goes with it, unless it is at a bound


def test_a_bound_is_told_as_a_bound(folder):
    result = fit_study(study(folder, [{"effect": "torque_ripple", "joint": 7, "wavenumber": 5.0}]))
    (found,) = found_effects(result)
    for its in found.parameters.values():
        assert np.isfinite(its.value) and (its.std is None or its.std >= 0)
    if result.at_bound:
        assert found.parameters["wavenumber"].at_bound and found.parameters["wavenumber"].std is None


def test_a_shape_that_fewer_parameters_take_beyond_its_bounds_stands_where_it_was(folder):
    """Of an arm's counterbalance the reduced fit had rho = 1.04, of which the length is no number: its errors
    were none, and the balancer "was not told from zero"."""
    prepared = prepare_study(study(folder, ["stribeck_friction:2"]))
    systems = build(prepared, 10.0)
    extended = extend(prepared, systems, 10.0)
    fitted = [its for its in extended.systems if its.role == "identify"]
    estimate, _ = estimate_all(fitted, prepared.study, extended.columns, extended.allowed, extended.held)
    assert extended.inside(estimate) is estimate
    (term,) = extended.terms
    k = extended.columns.parameters.index(term.names[-1])
    for bound, beyond in zip(term.bounds["vs"], (-1.0, 1.0)):
        moved = estimate.chi.copy()
        moved[k] = bound + beyond
        inside = extended.inside(replace(estimate, chi=moved))
        assert inside.chi[k] == term.theta["vs"] and not inside.active[k]
        assert inside.rss >= estimate.rss
        np.testing.assert_allclose(extended.at(inside.chi)[0].size, term.size, rtol=0.05)


def test_a_negative_size_is_marked_impossible(folder):
    columns, _ = recording("A", seconds=60, rate=250)
    dq = np.gradient(columns["q2"], columns["t"])
    columns["tau_m2"] = columns["tau_m2"] - 5.0 * np.exp(-((dq / 0.1) ** 2)) * np.sign(dq)
    columns["tau_m3"] = -columns["tau_m3"]
    write_parquet(folder / "odd.parquet", columns)
    result = fit_study(
        load_study(write_study(folder, [{"file": "odd.parquet"}], effects=["stribeck_friction:2"]))
    )
    assert "negative" in result.impossible["stribeck_friction:2.Fs"]
    marked = {name for name in result.impossible if name.startswith(("Fcm3", "Fvm3", "Iam3"))}
    assert len(marked) == 3


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        (["stribeck:2"], ("effects[1]", "stribeck_friction")),
        (["spring:1", "stribeck_friction:9"], ("effects[2]", "no joint 9")),
        (["stribeck_friction"], ("effects[1]", "joint:")),
        (["joint_coupling:2"], ("effects[1]", "source_joint")),
        (["coulomb_friction:2"], ("effects[1]", "without: [coulomb_friction:2]")),
        ([{"effect": "stribeck_friction", "joint": 2, "Vs": 0.1}], ("effects[1]", "Vs", "Fs, vs")),
        ([{"effect": "stribeck_friction", "joint": 2, "vs": 9.0}], ("effects[1]", "outside", "0.6")),
        ([{"effect": "stribeck_friction", "joint": 2, "fixed": ["vs"]}], ("vs", "no value")),
        ([{"effect": "stribeck_friction", "joint": 2, "vs": "fast"}], ("vs", "number")),
        ([{"effect": "spring", "joint": 2, "recording": "run9"}], ("effects[1]", "run9")),
        ([{"effect": "spring", "joint": 2, "recording": "run"}], ("effects[1]", "come and go")),
        (["spring:2:k"], ("'k'", "KEY=VALUE")),
        ("spring:2", ("effects", "list")),
    ],
)
def test_refusals(folder, effects, words):
    with pytest.raises(StudyError) as caught:
        fit_study(study(folder, effects))
    assert all(word in str(caught.value) for word in words) and "\n" not in str(caught.value)


@pytest.mark.long
@pytest.mark.parametrize(
    ("hidden", "declared"),
    [
        ("stribeck_friction:4", "stribeck_friction:4"),
        ("joint_coupling:6:source_joint=5", "joint_coupling:6:source_joint=5"),
        pytest.param(
            "payload_change::recording=run1,from=20",
            "payload_change::recording=run1,from=20",
            marks=pytest.mark.long,
        ),
        pytest.param("joint_elasticity:4", "joint_elasticity:4", marks=pytest.mark.long),
    ],
)
def test_twins_of_every_kind(tmp_path, hidden, declared):
    """What the simulator hid is fitted away to the noise on a run that was not fitted, and comes back."""
    simulated = simulate("kuka_lwr4p", "A", effects=(hidden,), seed=1, runs=RUNS)
    file = write_simulation(simulated, tmp_path / "twin")
    keys = yaml.safe_load(file.read_text()) | {"filter": {"decimation_cutoff_hz": 2.0}}
    plain, found = (fit_study(study_from({**keys, "effects": e}, file)) for e in ([], [declared]))
    role = "identify" if "payload" in hidden else "validate"
    assert found.relative_error[role]["total"] < 0.75 * plain.relative_error[role]["total"]
    truth = simulated.truth["effects"][0]["parameters"]
    (its,) = found_effects(found)
    for name, parameter in its.parameters.items():
        if name in truth and not parameter.given:
            assert abs(parameter.value - truth[name]) < 4 * parameter.std + 0.02 * abs(truth[name]), name


@pytest.mark.long
@pytest.mark.parametrize(
    "effect, names",
    [("counterbalance", ("Kl", "q0", "rho")), ("current_saturation", ("share", "limit"))],
)
def test_shapes_are_found_from_another_start_than_the_nearest(tmp_path, effect, names):
    """The best start of either lies in another valley: 9 and 17 % of error were left where 0.7 can be, with
    deviations of a hundredth (q0 = 0.450 +- 0.003, limit = 6.44 +- 0.05)."""
    rate = Sensors(rate_hz=250.0)
    made = simulate("staubli_tx40", "A", (f"{effect}:2",), seed=3, sensors=rate, runs=RUNS)
    truth = made.truth["effects"][0]["parameters"]
    file = write_simulation(made, tmp_path / "twin")
    data = yaml.safe_load(file.read_text()) | {"effects": [f"{effect}:2"]}
    result = fit_study(study_from(data, file))
    (found,) = found_effects(result)
    for name in names:
        its = found.parameters[name]
        assert abs(its.value - truth[name]) < 3.3 * its.std, (name, its)
    assert result.full_rate_error["validate"]["total"] < 1.0
