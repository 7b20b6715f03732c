"""Waves that are one shape, as numbers of an arm whose first gear has a damaged tooth, and by themselves."""

import pytest

from ident.diagnosis.telling.findings import Finding
from ident.diagnosis.telling.multiples import multiples


def _wave(effect, wavenumber, std, joint=1):
    values = {"wavenumber": {"value": wavenumber, "std": std, "unit": "1/rad", "at_bound": False}}
    return Finding(effect, (joint,), "tau_m", {}, values, 0.0, 9.0, 9.0, 0.0, (), "", "established", "")


BASE = _wave("gear_ripple", 11.1453, 0.0128)
HIGHER = [(33.3634, 0.0602), (44.6184, 0.1022), (55.6379, 0.2016)]


def test_what_repeats_and_is_no_wave():
    (told,) = multiples([BASE, *(_wave("torque_ripple", *k) for k in HIGHER)], 0.01)
    assert "joint 1: one thing that repeats every 0.564 rad (11.15 1/rad)" in told
    assert "gear ripple at 1 times, torque ripple at 3 times, torque ripple at 4 times" in told


@pytest.mark.parametrize(
    ("wavenumber", "std", "joint"),
    [(30.0, 0.06, 1), (33.36, 0.06, 2), (33.36, 0.8, 1)],  # no multiple; another joint's; by chance
)
def test_waves_by_themselves(wavenumber, std, joint):
    assert not list(multiples([BASE, _wave("torque_ripple", wavenumber, std, joint)], 0.01))
