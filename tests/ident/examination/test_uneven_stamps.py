"""Stamps that are rounded to about a sample's length, beside rows that were lost."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, measured, planted, tables, ur10e

from ident.examination.excerpt import Excerpt
from ident.examination.uneven_stamps import uneven_stamps


def _said(t, stamps, kept=slice(None)):
    q = np.stack([np.sin(0.9 * t), 0.4 * np.cos(1.7 * t)], 1)
    q += 1e-4 * np.random.default_rng(1).normal(size=q.shape)
    excerpt = Excerpt()
    excerpt.take((np.arange(len(t[kept])), stamps[kept], np.hstack([q, q])[kept]))
    return list(uneven_stamps(excerpt, 2))


def test_rounded_stamps_are_told_and_lost_rows_are_not():
    t = np.arange(4000) / 94.0
    assert [c.check for c in _said(t, np.round(t, 2))] == ["time_stamps"]
    assert not _said(t, t, np.flatnonzero(np.random.default_rng(2).random(4000) > 0.1))
    assert not _said(t, np.round(t, 3)) and not _said(t, t)


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_measured_log_whose_stamps_are_rounded_to_10_ms(tmp_path):
    """Its fit left a third of the torques, and nothing was said."""
    study = planted(tmp_path, lambda c: c | {"t": np.round(c["t"], 2)})
    told = [c.recording for c in tables(study) if c.check == "time_stamps"]
    assert sorted(set(told)) == sorted(entry.label for entry in study.recordings)
    assert not [c for c in tables(ur10e()) if c.check == "time_stamps"]


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("robot", ["kinova_gen3_joint7_friction", "franka_friction_j2"])
def test_stamps_of_measured_logs_are_left_alone(robot):
    assert not [c for c in tables(measured(robot)) if c.check == "time_stamps"]
