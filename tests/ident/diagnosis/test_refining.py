"""Shapes by variable projection, against scipy's optimiser on the same likelihood."""

import numpy as np
import pytest
import scipy.optimize

from ident.diagnosis.diagnosis import diagnose_study
from ident.diagnosis.evidence.leading import leading_metric
from ident.diagnosis.evidence.refine import fit_sizes, refine
from ident.diagnosis.opening import opened
from ident.diagnosis.rows.terms import Term
from ident.equations.prepared import prepare_study
from modelgen.effects import catalogue


@pytest.fixture(scope="module")
def lacking(arm):
    return opened(prepare_study(arm("stribeck_friction:2"))).state


def stribeck(vs):
    effect = catalogue()["stribeck_friction"]
    from modelgen.effects.place import Place

    return Term(effect, Place(1, None, "motor", parts=()), {"vs": vs})


def test_sizes_are_those_of_least_squares_beside_the_model(lacking):
    m = lacking.metric
    columns = lacking.scene.columns(stribeck(0.1))
    sizes, gain = fit_sizes(m, columns)
    on = m.fitted.mask & m.rows.use[1]
    blocks, torque = [], []
    for c, (places, values) in enumerate(m.X):
        here = m.fitted.mask & m.rows.use[c]
        wide = np.zeros((here.sum(), m.B + 1))
        wide[:, places] = values[here]
        if c in columns:
            wide[:, -1] = (m.whiteners[c] @ columns[c])[here, 0]
        blocks.append(wide)
        torque.append(m.y[c, here])
    X, y = np.vstack(blocks), np.concatenate(torque)
    scale = np.maximum(np.linalg.norm(X, axis=0), 1e-12)
    full = np.linalg.lstsq(X / scale, y, rcond=1e-9)[0] / scale
    bare = np.linalg.lstsq(X[:, :-1] / scale[:-1], y, rcond=1e-9)[0] / scale[:-1]
    fall = np.sum((y - X[:, :-1] @ bare) ** 2) - np.sum((y - X @ full) ** 2)
    assert on.any() and sizes[0] == pytest.approx(full[-1], rel=1e-3)
    assert gain == pytest.approx(0.5 * fall, rel=1e-3)


@pytest.mark.parametrize("end", [0, 1])
def test_a_shape_that_begins_beyond_its_bounds_begins_at_them(lacking, end):
    """Where a law that contains it ended elsewhere (a hysteresis began within 0.23 mrad, of 0.3 at least)."""
    term = stribeck(0.1)
    bound = term.effect.bounds(term.place)["vs"][end]
    begun = refine(lacking.metric, lacking.scene, term.at(vs=bound * (10.0 if end else 0.1)), turns=0)
    assert begun.term.theta["vs"] == bound


def test_the_shape_is_the_optimisers(lacking):
    found = refine(lacking.metric, lacking.scene, stribeck(0.3), turns=15)

    def loss(log_vs):
        return -fit_sizes(lacking.metric, lacking.scene.columns(stribeck(float(np.exp(log_vs)))))[1]

    best = scipy.optimize.minimize_scalar(loss, bounds=(np.log(0.02), np.log(0.5)), method="bounded")
    assert found.term.theta["vs"] == pytest.approx(float(np.exp(best.x)), rel=0.03)
    assert found.gain == pytest.approx(-best.fun, abs=0.5)
    assert not found.at_bound


def test_a_shape_outside_stays_at_its_bound(lacking):
    effect = catalogue()["stribeck_friction"]
    low, high = effect.bounds(stribeck(0.1).place)["vs"]
    found = refine(lacking.metric, lacking.scene, stribeck(high))
    assert low <= found.term.theta["vs"] <= high


def test_no_columns_no_gain(lacking):
    assert fit_sizes(lacking.metric, {})[1] == 0.0


def test_a_tilt_is_found_from_an_angle_that_is_far_too_small(arm):
    """Angle and size say the same; six degrees had been left as half a degree, thirteen times."""
    begun = opened(prepare_study(arm("base_tilt")))
    state = begun.state
    effect = catalogue()["base_tilt"]
    (place,) = effect.places(begun.layout)
    ends = []
    for part in (1.0, 1 / 30):
        start = {name: part * value for name, value in effect.typical.items()}
        its = refine(state.metric, state.scene, Term(effect, place, start), turns=0)
        assert its.sizes[-1] == pytest.approx(1.0, abs=0.05)
        ends.append(its.term.theta)
    assert ends[1] == pytest.approx(ends[0], rel=0.05)


def test_a_tilt_that_is_a_little_off_is_refined(arm):
    begun = opened(prepare_study(arm("base_tilt")))
    state, effect = begun.state, catalogue()["base_tilt"]
    (place,) = effect.places(begun.layout)
    begins = (effect.typical, {"roll": 1.3 * effect.typical["roll"], "pitch": 0.9 * effect.typical["pitch"]})
    right, off = (refine(state.metric, state.scene, Term(effect, place, dict(its))) for its in begins)
    assert off.gain == pytest.approx(right.gain, abs=0.5)
    assert off.term.theta == pytest.approx(right.term.theta, rel=0.01)


@pytest.mark.long
def test_two_of_a_kind_on_one_joint(arm):
    """One refined once after the other stood for both; a function of the rate was told."""
    findings = diagnose_study(arm(*(f"stribeck_friction:2:Fs=0.5,vs={vs}" for vs in (0.1, 0.03)))).findings
    assert [finding.effect for finding in findings] == ["stribeck_friction"] * 2
    for finding, vs in zip(sorted(findings, key=lambda f: -f.parameters["vs"]["value"]), (0.1, 0.03)):
        for name, truth in {"vs": vs, "Fs": 0.5}.items():
            told = finding.parameters[name]
            assert abs(told["value"] - truth) < 4 * told["std"] < 0.5 * truth


def test_a_shape_is_followed_along_several_of_its_numbers(arm):
    """A step that was cut in one of them alone led nowhere: of nine of fifteen starts a counterbalance was
    lost, and a ripple of five numbers told in its place."""
    begun = opened(prepare_study(arm("counterbalance:2:Kab=0,Kl=-5")))
    state, effect = begun.state, catalogue()["counterbalance"]
    place = next(p for p in effect.places(begun.layout) if p.joint == 1 and p.parts == ("Kl",))
    known = Term(effect, place, {"q0": 0.3, "rho": 0.85})
    m = leading_metric(state, [refine(state.metric, state.scene, known)])
    for q0, rho in ((0.42, 0.4), (0.42, 0.44), (0.5, 0.4), (0.0, 0.65)):
        r = refine(m, state.scene, known.at(q0=q0, rho=rho), turns=12)
        assert (r.term.theta["q0"], r.term.theta["rho"]) == pytest.approx((0.3, 0.85), abs=0.01)
