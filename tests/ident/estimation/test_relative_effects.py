"""What is told relative to a parameter of the model is as uncertain as that parameter."""

import numpy as np
import pytest
from small_arm import ARM

import ident

pytestmark = pytest.mark.unexamined

EFFECT = "thermal_coulomb_friction:2"  # a = aFc / Fc


def told(folder, seed):
    (folder / "small.yaml").write_text(ARM)
    twin = ident.simulate(
        folder / "small.yaml", effects=[EFFECT], duration=40, rate_hz=200, noise=1.0, seed=seed
    )
    fit = ident.fit(twin.study.with_(effects=[EFFECT]))
    (its,) = fit.document()["effects"]
    (true,) = twin.truth["effects"]
    return fit, its["parameters"]["a"], true["parameters"]["a"]


def test_a_fraction_of_a_friction_that_is_hardly_known(tmp_path):
    """By the delta method with the friction among what is estimated. (Of 3.38 "3.294 +- 0.018" was told.)"""
    fit, a, true = told(tmp_path, 11)
    result = fit.result
    names = list(result.columns.parameters)
    k = [names.index("thermal_coulomb_friction:2.aFc"), names.index("Fcm2R" if "Fcm2R" in names else "Fcm2")]
    wide = np.ones(len(names)) if result.widened is None else result.widened
    C = (result.full_covariance * np.outer(wide, wide))[np.ix_(k, k)]
    size, friction = result.full.chi[k]
    slope = np.array([1 / friction, -size / friction**2])
    assert a["std"] == pytest.approx(float(np.sqrt(slope @ C @ slope)), rel=0.02)
    assert a["std"] > 2 * slope[0] * np.sqrt(C[0, 0])
    assert abs(a["value"] - true) < 2.5 * a["std"]


@pytest.mark.long
def test_intervals_of_a_fraction_hold_the_truth(tmp_path):
    seen = [told(tmp_path, seed)[1:] for seed in range(30, 50)]
    inside = sum(abs(a["value"] - true) < 1.96 * a["std"] for a, true in seen)
    assert inside >= 17  # of 20: 95 % of them leave two out or fewer in 92 of 100
