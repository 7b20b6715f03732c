"""A residual that oscillates of its own, and slow noise, which does not."""

import numpy as np
import pytest

from ident.diagnosis.telling.oscillating import block, most_likely, oscillation
from ident.signals.low_pass import LowPass, zero_phase

HOP, ROWS = 0.04, 200


def noise(rng, corner_hz, size=3.0):
    """White noise, and a relaxation `size` times as large."""
    a = np.exp(-2 * np.pi * corner_hz * HOP)
    x = np.zeros(ROWS + 2000)
    for k, w in enumerate(rng.normal(size=len(x) - 1), 1):
        x[k] = a * x[k - 1] + np.sqrt(1 - a * a) * w
    return rng.normal(size=ROWS) + size * x[2000:]


def rows_of(x, lost, rng):
    """Rows of which a share is left out."""
    t = HOP * np.arange(ROWS)
    kept = np.flatnonzero(rng.random(ROWS) > lost)
    return block(t[kept], x(t)[kept] if callable(x) else x[kept], np.zeros((len(kept), 0)))


def oscillation_says(*its):
    found = oscillation(*its)
    return 0.0 if found is None else found.log_e


@pytest.mark.first_case
@pytest.mark.parametrize("corner_hz", [0.03, 0.3, 2.0])
@pytest.mark.parametrize("lost", [0.0, 0.2])
def test_slow_noise_forgets(corner_hz, lost):
    for seed in range(2):
        rng = np.random.default_rng(seed)
        six = [rows_of(noise(rng, corner_hz), lost, rng) for _ in range(6)]
        assert oscillation_says(HOP, six[:3], six[3:]) < 3.0


@pytest.mark.first_case
@pytest.mark.parametrize("lost", [0.0, 0.2])
def test_a_slosh_is_said_of_runs_that_it_was_not_learned_on(lost):
    """Its frequency wanders; of runs that are without it, it is not said."""
    rng = np.random.default_rng(1)

    def slosh(t):
        wandering = 2 * np.pi * 0.6 * t + 3.0 * np.sin(0.3 * t + 6 * rng.random())
        return 3.0 * np.sin(wandering) + rng.normal(size=len(t))

    with_it = [rows_of(slosh, lost, rng) for _ in range(6)]
    assert oscillation_says(HOP, with_it[:3], with_it[3:]) > 20.0
    assert oscillation(HOP, with_it[:3], with_it[3:]).frequency_hz == pytest.approx(0.6, abs=0.2)
    without = [rows_of(noise(rng, 0.3), lost, rng) for _ in range(3)]
    assert oscillation_says(HOP, with_it[:3], without) < 0.0


def test_a_torque_whose_frequency_sweeps():
    """A line that is a fiftieth of it stands out of its neighbours more than any of its own frequencies."""
    rng = np.random.default_rng(5)

    def sweep(t):
        swept = 3.0 * np.sin(2 * np.pi * (0.6 + 0.15 * t) * t + 6 * rng.random())
        return swept + 0.06 * np.sin(2 * np.pi * 9.0 * t) + 0.05 * rng.normal(size=len(t))

    six = [rows_of(sweep, 0.0, rng) for _ in range(6)]
    assert oscillation_says(HOP, six[:3], six[3:]) > 20.0


def test_sizes_are_the_most_likely_ones():
    """Of white noise alone the mean square; no other size has a larger likelihood."""
    rng = np.random.default_rng(2)
    (b,) = (rows_of(2.0 * rng.normal(size=ROWS), 0.0, rng),)
    sizes, likelihood = most_likely([b], [[np.eye(ROWS)]])
    assert sizes[0] == pytest.approx(np.mean(b.residual**2), rel=1e-6)
    variance = sizes[0]
    expected = -0.5 * ROWS * (np.log(variance) + 1)
    assert likelihood == pytest.approx(expected, rel=1e-6)


def test_accelerations_of_positions_in_steps_do_not_oscillate():
    """Behind the filter that the steps ask for their spectrum has a peak, at the same place in every run."""
    rng, its = np.random.default_rng(3), LowPass(2.4, 1 / HOP)

    def accelerations():
        q = zero_phase(rng.normal(size=(ROWS + 100, 1)), its.rate_hz, its.cutoff_hz, its.order)
        return 8.0 * np.diff(q[:, 0], 2)[50 : 50 + ROWS] + 0.1 * noise(rng, 0.05)

    six = [rows_of(accelerations(), 0.1, rng) for _ in range(6)]
    assert oscillation_says(HOP, six[:3], six[3:]) > 20.0
    assert oscillation_says(HOP, six[:3], six[3:], [its]) < 3.0


def test_contrasts_do_not_see_what_parameters_change():
    rng, t = np.random.default_rng(4), HOP * np.arange(ROWS)
    columns = np.column_stack([np.ones(ROWS), t, 1e-6 * np.sin(t)])
    one = block(t, rng.normal(size=ROWS), columns)
    other = block(t, one.contrasts @ one.residual + columns @ [5.0, -2.0, 1e6], columns)
    assert other.residual == pytest.approx(one.residual, abs=1e-9)
    assert one.contrasts.shape == (ROWS, ROWS - 3)
