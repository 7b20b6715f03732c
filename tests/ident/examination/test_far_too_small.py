"""A torque that is far too small is explained as by itself: with its factor squares of its own grow."""

from types import SimpleNamespace

import numpy as np
import pytest

from ident.examination.fits.stretches import ODD, agreed
from ident.examination.rivals.scales import _rejects
from ident.examination.torques import believed


def explained(*torques):
    """A fit that leaves these squared errors (stretches,) of each torque."""
    stretches = np.column_stack(torques)
    fit = SimpleNamespace(error=np.sqrt(stretches.mean(axis=0)))
    return SimpleNamespace(stretches=(stretches,), sizes=(np.ones(len(torques)),), fit=fit)


def test_its_factor_is_told_by_what_others_gain_all_along():
    """Of a TX40's second torque, 101 times too small, it was not: the few stretches in which it is large
    outweighed what its neighbours gained in all."""
    rng = np.random.default_rng(3)
    n = 18
    own, others = rng.uniform(0.5, 2.0, n), rng.uniform(0.5, 2.0, (2, n))
    large = np.where(np.arange(n) % 5 == 4, 12.0, 0.2)
    plain = explained(own * large * 1e-4, *(others * 4e-2))
    scaled = explained(16e-4 * own * large, *(others * 4e-3))
    none = explained(16e-4 * own * large, *(others * 4e-2 * rng.uniform(0.7, 1.5, (2, n))))
    assert not agreed(plain, scaled, ODD)
    assert _rejects(plain, scaled, 9)
    assert not _rejects(plain, none, 9)


@pytest.mark.parametrize(
    ("left", "less", "part"), [(0.3, None, True), (0.06, None, False), (0.06, "less", True)]
)
def test_what_leaves_no_torque_that_others_contradict_is_no_part_of_what_is_wrong(left, less, part):
    """However little of what fits of each torque by itself explain better, of few seconds, it takes off;
    unless a torque is asked for less of it."""
    alone = np.array([0.01, 0.005, 0.02])
    asked = SimpleNamespace(
        fit=SimpleNamespace(error=np.array([0.1, 0.04, 0.26])), alone=alone, of_robot=lambda h: False
    )
    taken = SimpleNamespace(fit=SimpleNamespace(error=np.array([0.04, 0.04, left])), alone=alone)
    h = SimpleNamespace(own=False, gain=2.0, quick=less)
    assert believed._a_part(asked, h, taken) == part
