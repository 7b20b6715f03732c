"""Every effect that is a column, emitted and compiled, against the catalogue's own NumPy evaluation."""

import numpy as np
import pytest

import generated
from modelgen.effects import catalogue

COLUMNS = [name for name, effect in catalogue().items() if effect.kind == "column"]
ROW = 1  # joint 2


@pytest.mark.parametrize("model", ["A", "C"])
def test_compiled_effects_are_the_catalogue_columns(model):
    requests = tuple(f"{name}:2" for name in COLUMNS)
    m = generated.load("kuka_lwr4p", model, effects=requests)
    plain = generated.load("kuka_lwr4p", model)
    first = len(plain.parameters)
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.normal(size=(3, 19, 7))
    extra = {name: rng.uniform(0.2, 1, 19) for name in m.extra_inputs}
    theta = {p.name: 0.3 for name in COLUMNS for p in catalogue()[name].nonlinear}
    extra |= {name: 0.3 for name in m.extra_inputs if name.partition("2")[0] in theta}  # also k2_of_an_effect
    W = m.regressor(q, dq, ddq, extra=extra)
    np.testing.assert_array_equal(W[:, :, :first], plain.regressor(q, dq, ddq))
    signals = {"q": q[:, ROW], "dq": dq[:, ROW], "ddq": ddq[:, ROW]}
    signals |= {"dq_source": dq[:, 0], "ddq_source": ddq[:, 0]}  # the pair's other joint is the one before
    signals |= {name.rstrip("2"): value for name, value in extra.items() if isinstance(value, np.ndarray)}
    b = first
    for name in COLUMNS:
        effect = catalogue()[name]
        expected = effect.numpy_columns(signals, {p.name: 0.3 for p in effect.nonlinear})
        copies = 2 if effect.channel == "any" and model == "C" else 1  # a parameter for each measured channel
        for copy in range(copies):
            for column in expected.T:
                rows = np.flatnonzero(np.abs(W[:, :, b]).any(axis=0))
                assert set(rows) <= {ROW, ROW + 7}, m.parameters[b]
                row = ROW + 7 * copy if copies == 2 else ROW
                np.testing.assert_allclose(
                    W[:, row, b], column, rtol=1e-12, atol=1e-14, err_msg=m.parameters[b]
                )
                b += 1
    assert b == len(m.parameters)
    chi = rng.normal(size=b)
    tau = m.torque(q, dq, ddq, chi, extra=extra)
    np.testing.assert_allclose(tau, W @ chi, rtol=1e-11, atol=1e-11 * np.abs(tau).max())


def test_what_is_no_column_is_refused():
    for name, effect in catalogue().items():
        if effect.kind != "column":
            with pytest.raises(generated.GeneratedError, match=f"{name} .* is no column"):
                generated.load("scara", "A", effects=(f"{name}:2",))


def test_motor_effects_are_not_in_the_sensor_model():
    with pytest.raises(generated.GeneratedError, match="does not act in the torques of model B"):
        generated.load("kuka_lwr4p", "B", effects=("stribeck_friction:2",))


def test_pairs_name_their_source():
    m = generated.load("kuka_lwr4p", "A", effects=("joint_coupling:3:source_joint=5",))
    q, dq, ddq = np.random.default_rng(1).normal(size=(3, 5, 7))
    column = m.parameters.index("Fv3")
    np.testing.assert_array_equal(m.regressor(q, dq, ddq)[:, 2, column], dq[:, 4])


def test_two_effects_of_a_joint_keep_their_own_nonlinear_parameters():
    m = generated.load("kuka_lwr4p", "A", effects=("torque_ripple:2", "position_dependent_friction:2"))
    assert m.extra_inputs == ("wavenumber2", "wavenumber2_position_dependent_friction")


def test_two_effects_of_a_kind_on_a_joint_are_two_effects():
    m = generated.load("kuka_lwr4p", "D", effects=("torque_ripple:2", "torque_ripple:2"))
    assert m.extra_inputs == ("wavenumber2", "wavenumber2_2")
    q, dq, ddq = np.random.default_rng(1).normal(size=(3, 5, 7))
    W = m.regressor(q, dq, ddq, extra={"wavenumber2": 12.0, "wavenumber2_2": 30.0})
    for name, wave in (("As2", 12.0), ("As2_2", 30.0)):
        np.testing.assert_allclose(W[:, 1, m.parameters.index(name)], np.sin(wave * q[:, 1]), atol=1e-14)
