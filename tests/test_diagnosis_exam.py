"""The exam's simulator shares no formula with the catalogue: here both are held against each other."""

import sys
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

pytest.importorskip("pinocchio")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.exam import draw, physics
from benchmarks.exam.make_cases import Case
from modelgen.effects import catalogue

COLUMNS = (
    "stribeck_friction",
    "nonlinear_viscous_friction",
    "asymmetric_friction",
    "load_dependent_friction",
    "thermal_friction",
    "hysteresis",
    "torque_ripple",
    "spring",
    "joint_coupling",
    "drive_gain_error",
    "offset_drift",
    "time_delay",
)


def _short_case(model: str = "A") -> Case:
    for seed in range(20):
        try:
            return Case("clean", [], seed, 10.0, 500.0, model)
        except RuntimeError:
            continue
    raise AssertionError("no short case could be drawn")


@pytest.mark.parametrize("name", COLUMNS)
def test_catalogue_columns_explain_what_the_exam_puts_in(name: str) -> None:
    """Least squares of the exam's torque on the catalogue's columns at the true nonlinear parameters.

    Tolerance 3 %: interpolation, the first sample; a delay is a Taylor step, right to 10 %.
    """
    case, effect = _short_case(), catalogue()[name]
    case.plant.drives.presliding[:] = 0.0
    case.plant.drives.smooth[:] = 0.05  # rad/s; so wide that a delay can be a Taylor step
    run = case.runs[0]
    rng = np.random.default_rng(5)
    joint = 1
    drawn = None
    while drawn is None or drawn.build(drawn.start).joint is None:
        drawn = draw.draw(name, case.scene, joint, rng)
        assert drawn is not None
    put_in = drawn.build(drawn.start)
    free = physics.simulate(case.plant, run, [])
    delta = (physics.simulate(case.plant, run, [put_in])[1] - free[1])[:, joint]
    d, tau = case.plant.drives, free[1][:, joint]
    sign = np.tanh(run.dq[:, joint] / d.smooth[joint])
    signals = {
        "t": run.t,
        "q": run.q[:, joint],
        "dq": run.dq[:, joint],
        "ddq": run.ddq[:, joint],
        "sign_dq": sign,
        "tau_link": run.tau[:, joint],
        "tau": tau,
        "dtau": np.gradient(tau, run.t),
    }
    if put_in.source is not None:
        k = put_in.source
        signals |= {"dq_source": run.dq[:, k], "ddq_source": run.ddq[:, k]}
        signals["sign_sum"] = np.sign(run.dq[:, joint] + run.dq[:, k])
    told = {k: v for k, v in put_in.params.items() if k in {q.name for q in effect.quantities}}
    context = {name: put_in.params[name] for name in effect.context if name in put_in.params}
    nonlinear = {}
    for p in effect.nonlinear:
        expression = effect.inverse.get(p.name)
        nonlinear[p.name] = (
            put_in.params[p.name]
            if expression is None
            else float(expression.subs({**_symbols(told), **_symbols(context)}))
        )
    columns = effect.numpy_columns(signals, nonlinear)
    fitted = columns @ np.linalg.lstsq(columns, delta, rcond=None)[0]
    assert np.linalg.norm(delta - fitted) < (0.1 if name == "time_delay" else 0.03) * np.linalg.norm(delta)


def _symbols(values: dict[str, float]) -> dict[sp.Symbol, float]:
    return {sp.Symbol(k, real=True): v for k, v in values.items()}
