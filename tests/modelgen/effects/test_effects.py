"""The catalogue of effects: every file is complete, and its formulas do what its words say."""

from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import modelgen.effects
from modelgen.effects import SIGNALS, Effect, EffectError, catalogue, effect
from modelgen.effects.states import integrate_dahl, integrate_play

CONTRACT = {  # contract 7: name -> reported parameters that it asks for
    "coulomb_friction": {"Fc"},
    "viscous_friction": {"Fv"},
    "offset": {"off"},
    "rotor_inertia": {"Ia"},
    "stribeck_friction": {"Fs", "vs"},
    "nonlinear_viscous_friction": {"Fv3"},
    "asymmetric_friction": {"Fva"},
    "load_dependent_friction": {"mu"},
    "thermal_friction": {"a", "T"},
    "hysteresis": {"sigma"},
    "torque_ripple": {"A", "wavenumber", "phi"},
    "spring": {"k", "q0"},
    "joint_elasticity": {"k"},
    "joint_coupling": {"Fv", "Ia"},
    "base_tilt": {"roll", "pitch"},
    "payload_change": {"m", "mx", "my", "mz"},
    "external_force": {"force"},
    "drive_gain_error": {"gain"},
    "sensor_crosstalk": {"gain"},
    "offset_drift": {"slope"},
    "time_delay": {"delay"},
    "backlash": {"gap"},
}
EVERY = sorted(catalogue())
WITH_TERMS = [name for name in EVERY if effect(name).terms]
OWN_PATH = {"hysteretic_gear", "maxwell_slip"}  # states with a test of their own
# what a C generator understands; Heaviside, Piecewise and the like it does not
C_FUNCTIONS = (sp.exp, sp.sin, sp.cos, sp.tanh, sp.sign, sp.Abs)


def some_signals(e: Effect, N: int = 200, seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 4, N)
    signals = {"t": t, "q": np.sin(2 * t), "dq": 2 * np.cos(2 * t), "ddq": -4 * np.sin(2 * t)}
    for name in e.needs - set(signals) - {"z", "sign_dq", "sign_sum"}:
        signals[name] = rng.normal(size=N)
    return signals


def test_catalogue_has_every_name_and_parameter_of_the_contract():
    for name, parameters in CONTRACT.items():
        assert parameters <= {q.name for q in effect(name).quantities}, name


def test_every_file_of_the_folder_that_defines_an_effect_is_found():
    folder = Path(modelgen.effects.__file__).parent / "catalogue"
    written = {p.stem for p in folder.glob("[a-z]*.py") if "\nEFFECT = " in p.read_text()}
    assert written == set(EVERY)  # and each file bears the name of its effect


@pytest.mark.parametrize("name", EVERY)
def test_an_effect_answers_its_questions(name):
    e = effect(name)
    assert len(e.summary) > 20 and len(e.signature) > 20 and len(e.source) > 10
    assert set(e.terms) in (set(e.linear_names), set()) and len(e.remedy) > 20
    assert e.terms or e.equation
    assert e.needs <= {s.name for s in vars(SIGNALS).values() if isinstance(s, sp.Symbol)}
    for p in (*e.linear, *e.nonlinear):
        assert p.unit and p.low < p.high
    for p in e.linear:
        assert p.sign == "any" or p.low >= 0
    for p in e.nonlinear:
        assert all(p.low <= g <= p.high for g in p.grid) and list(p.grid) == sorted(p.grid)
    if e.reported:
        told = {s.name for q in e.quantities for s in q.expression.free_symbols}
        internal = {p.name for p in e.linear if not p.optional} | set(e.nonlinear_names)
        assert told - set(e.context) <= internal | {p.name for p in e.linear}
    assert set(e.typical) <= {q.name for q in e.quantities}


@pytest.mark.parametrize("name", EVERY)
def test_terms_can_become_c(name):
    e = effect(name)
    expressions = [*e.terms.values(), *([e.state.update] if e.state else [])]
    for node in (n for x in expressions for n in sp.preorder_traversal(x)):
        assert isinstance(node, (*C_FUNCTIONS, sp.Add, sp.Mul, sp.Pow, sp.Symbol, sp.Number)), node


@pytest.mark.parametrize("name", sorted({*WITH_TERMS} - OWN_PATH))
def test_columns_are_the_symbolic_terms(name):
    """Sample by sample substitution into the SymPy expression: the slow twin of numpy_columns."""
    e = effect(name)
    signals, theta = some_signals(e), e.complete(None)
    columns = e.numpy_columns(signals, theta)
    assert columns.shape == (200, len(e.linear))
    known = dict(signals) | {"sign_dq": np.sign(signals["dq"])}
    if "dq_source" in signals:
        known["sign_sum"] = np.sign(signals["dq"] + signals["dq_source"])
    if e.state:
        known["z"] = e.state.integrate(signals["q"], theta, 0.0)
    for i in (0, 57, 199):
        point = {k: sp.Float(float(v[i]), 30) for k, v in known.items()}
        exact = e.term(point, {k: sp.Float(v, 30) for k, v in theta.items()})
        for value, p in zip(columns[i], e.linear_names):
            assert value == pytest.approx(float(exact[p]), rel=1e-9, abs=1e-12)  # 53 bits against 30 digits


@pytest.mark.parametrize("name", EVERY)
def test_reported_values_come_back(name):
    e = effect(name)
    context = {name: 7.0 + k for k, name in enumerate(e.context)}
    linear, nonlinear = e.values_from_reported(e.typical, context)
    told = e.report({**linear, **nonlinear}, None, context)
    for key, value in e.typical.items():
        assert told[key]["value"] == pytest.approx(value, rel=1e-12)
        assert told[key]["std"] == 0.0


@pytest.mark.parametrize("name", [n for n in EVERY if effect(n).quantities])
def test_reported_spread_is_the_spread_of_random_draws(name):
    """Delta method against Monte Carlo with small covariances: second order terms are 1e-4 of the first."""
    e = effect(name)
    context = {name: 7.0 + k for k, name in enumerate(e.context)}
    linear, nonlinear = e.values_from_reported(e.typical, context)
    centre = np.array([*linear.values(), *nonlinear.values()])
    size = 1e-4 * np.maximum(np.abs(centre), 1e-3 * np.abs(centre).max())
    rng = np.random.default_rng(4)
    mix = rng.normal(size=(len(centre), len(centre))) * size[:, None]
    told = e.report({**linear, **nonlinear}, mix @ mix.T, context)
    draws = centre + rng.normal(size=(400, len(centre))) @ mix.T
    k = len(linear)
    seen = [
        [
            q["value"]
            for q in e.report(
                {**dict(zip(linear, x[:k])), **dict(zip(nonlinear, x[k:]))}, mix @ mix.T, context
            ).values()
        ]
        for x in draws
    ]
    for value, spread in zip(told.values(), np.std(seen, axis=0)):
        assert value["std"] == pytest.approx(spread, rel=0.15, abs=1e-15)  # 400 draws: 3.5 % one sigma


def test_what_depends_on_an_absent_optional_parameter_is_not_told():
    told = effect("spring").report({"k": 8.0}, np.array([[0.04]]))
    assert set(told) == {"k"} and told["k"]["std"] == pytest.approx(0.2)
    force = effect("external_force").report({"FX": 3.0, "FY": 4.0, "FZ": 0.0}, 0.01 * np.eye(3))
    assert force["force"]["value"] == 5.0 and force["force"]["std"] == pytest.approx(0.1)


def test_mistakes_are_told():
    with pytest.raises(EffectError, match="no effect is called stribek"):
        effect("stribek")
    with pytest.raises(EffectError, match="needs the signal q"):
        effect("torque_ripple").numpy_columns({"dq": np.ones(3)})
    with pytest.raises(EffectError, match="has no parameter vs inside its term"):
        effect("torque_ripple").numpy_columns({"q": np.ones(3)}, {"vs": 1.0})
    with pytest.raises(EffectError, match="relative to Fv"):
        effect("thermal_friction").report({"aFv": 1.0, "T": 10.0})
    with pytest.raises(EffectError, match="has no parameter amplitude"):
        effect("torque_ripple").values_from_reported({"amplitude": 1.0})


def test_every_effect_has_a_test_file_of_its_own():
    folder = Path(__file__).parent
    assert [name for name in EVERY if not (folder / f"test_{name}.py").is_file()] == []


# What the signatures say.


def test_stribeck_is_gone_above_three_vs():
    e = effect("stribeck_friction")
    dq = np.array([-0.4, -0.01, 0.01, 0.4])
    column = e.numpy_columns({"dq": dq}, {"vs": 0.1})[:, 0]
    assert column == pytest.approx([-np.exp(-16), -np.exp(-0.01), np.exp(-0.01), np.exp(-16)])


def test_ripple_has_its_amplitude_and_phase():
    e = effect("torque_ripple")
    linear, nonlinear = e.values_from_reported({"A": 2.0, "wavenumber": 12.0, "phi": 0.7})
    q = np.linspace(-2, 2, 500)
    torque = e.numpy_columns({"q": q}, nonlinear) @ [linear["As"], linear["Ac"]]
    assert torque == pytest.approx(2.0 * np.sin(12.0 * q + 0.7), abs=1e-12)


def test_thermal_friction_fades_with_its_time_constant():
    e = effect("thermal_friction")
    t = np.array([0.0, 20.0, 40.0])
    assert e.numpy_columns({"t": t, "dq": np.full(3, 2.0)}, {"T": 20.0})[:, 0] == pytest.approx(
        2 * np.exp([0.0, -1.0, -2.0])
    )


def test_spring_is_at_rest_at_q0():
    e = effect("spring")
    linear, _ = e.values_from_reported({"k": 8.0, "q0": 0.2})
    q = np.array([0.2, 1.2])
    assert e.numpy_columns({"q": q}) @ [linear["k"], linear["c"]] == pytest.approx([0.0, 8.0])


# States: against their law, whatever the path.

paths = st.lists(st.floats(-0.2, 0.2).map(lambda x: round(x, 6)), min_size=2, max_size=60).map(np.cumsum)


def slow(e: Effect, q: np.ndarray, theta: dict[str, float]) -> np.ndarray:
    """The update of the definition, one step after the other."""
    update = sp.lambdify([SIGNALS.z, SIGNALS.step, *(p.symbol for p in e.nonlinear)], e.state.update, "numpy")
    z = [e.state.initial]
    for step in np.diff(q):
        z.append(float(update(z[-1], step, *(theta[p] for p in e.nonlinear_names))) if step else z[-1])
    return np.array(z)


@settings(max_examples=60, deadline=None)
@given(paths, st.sampled_from([1e-3, 0.02, 0.1]))
def test_states_integrate_their_own_update(q, size):
    for name, parameter in (("hysteresis", "width"), ("backlash", "travel")):
        e, theta = effect(name), {parameter: size}
        z = e.state.integrate(q, theta, e.state.initial)
        # sums of exponentials lose e^12 of the rounding
        assert z == pytest.approx(slow(e, q, theta), abs=1e-8)
        assert np.all(np.abs(z) <= 1.0 + 1e-8)


@settings(max_examples=40, deadline=None)
@given(paths, st.integers(2, 5))
def test_states_do_not_depend_on_the_rate(q, slower):
    """The same path sampled more finely, as when driven more slowly, ends in the same state."""
    fine = np.interp(np.arange(slower * (len(q) - 1) + 1) / slower, np.arange(len(q)), q)
    for integrate, theta in ((integrate_dahl, {"width": 0.03}), (integrate_play, {"travel": 0.03})):
        assert integrate(fine, theta)[::slower] == pytest.approx(integrate(q, theta), abs=1e-8)


def test_dahl_obeys_its_differential_equation():
    q = np.concatenate([np.linspace(0, 0.3, 4000), np.linspace(0.3, -0.1, 4000)[1:]])
    Fc, sigma = 6.0, 150.0
    F = Fc * integrate_dahl(q, {"width": Fc / sigma})
    dq = np.diff(q)
    middle = (F[1:] + F[:-1]) / 2
    law = sigma * (1 - middle / Fc * np.sign(dq))
    assert np.diff(F) / dq == pytest.approx(law, rel=1e-3)  # trapezoid rule, steps of 1/500 of the width
    assert np.abs(F).max() <= Fc


def test_hysteresis_becomes_coulomb_when_it_is_stiff():
    q = np.sin(np.linspace(0, 12, 3000))
    dq = np.gradient(q)
    column = effect("hysteresis").numpy_columns({"q": q, "dq": dq}, {"width": 3e-4})[:, 0]
    assert np.mean(np.abs(column) > 0.01) < 0.02  # only around the four reversals


def test_backlash_loses_the_gap_at_a_reversal():
    e = effect("backlash")
    q = np.concatenate([np.linspace(0, 1, 500), np.linspace(1, 0, 500)])
    lag, lost = e.numpy_columns({"q": q, "tau_link": np.full(1000, 7.0)}, {"travel": 0.01}).T
    lag *= 0.01
    assert lag[400] == pytest.approx(-0.005) and lag[-1] == pytest.approx(0.005)
    link = q + lag
    turning = (q > 0.9901) & (np.arange(1000) > 500)
    assert np.ptp(link[turning]) < 1e-9  # the link rests while the motor crosses the gap
    assert lost[502] == -7.0 and lost[400] == lost[-1] == 0.0  # and feels nothing of it
