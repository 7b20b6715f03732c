"""Fisher's F without SciPy, held against SciPy's; and a fit that needs no SciPy does not import it."""

import math
import subprocess
import sys

import pytest
import scipy.special

from ident.distributions import f_beyond, f_quantile, t_beyond

FREE = [(m, n) for m in (1, 2, 7, 60) for n in (1.0, 2.5, 40.0, 3e3, 1e6)]


@pytest.mark.parametrize(("m", "n"), FREE)
def test_tail_and_quantile_are_those_of_scipy(m, n):
    for f in (1e-6, 0.03, 0.9, 1.0, 1.1, 4.0, 30.0, 200.0):
        expected = scipy.special.fdtrc(m, n, f)
        assert f_beyond(f, m, n) == pytest.approx(expected, rel=1e-9, abs=1e-100)  # theirs fails below
    for share in (1e-6, 0.01, 0.05, 0.5, 0.99):
        assert f_quantile(share, m, n) == pytest.approx(scipy.special.fdtri(m, n, 1 - share), rel=1e-8)
        assert f_beyond(f_quantile(share, m, n), m, n) == pytest.approx(share, rel=1e-9)


def test_students_t_squared_is_fishers():
    for free in (1.0, 9.0, 1e5):
        t = scipy.special.stdtrit(free, 0.975)
        assert f_quantile(0.05, 1, free) == pytest.approx(t**2, rel=1e-9)
        for t in (-3.0, -0.1, 0.0, 1.0, 20.0):
            assert t_beyond(t, free) == pytest.approx(scipy.special.stdtr(free, -t), rel=1e-9)


def test_the_ends():
    assert [f_beyond(f, 1, 50.0) for f in (-1.0, 0.0, 1e-320, math.inf)] == [1.0, 1.0, 1.0, 0.0]
    assert math.isnan(f_beyond(math.nan, 1, 50.0))


def test_a_fit_does_not_import_scipy():
    said = "import sys, ident.estimation.fit, ident.report.fit_result; sys.exit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", said], check=False).returncode == 0
