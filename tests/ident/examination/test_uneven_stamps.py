"""Stamps that are rounded to about a sample's length, beside rows that were lost."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, measured, planted, tables, ur10e

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.excerpt import Excerpt
from ident.examination.uneven_stamps import uneven_steps


def _said(t, stamps, kept=slice(None)):
    q = np.stack([np.sin(0.9 * t), 0.4 * np.cos(1.7 * t)], 1)
    q += 1e-4 * np.random.default_rng(1).normal(size=q.shape)
    excerpt = Excerpt()
    excerpt.take((np.arange(len(t[kept])), stamps[kept], np.hstack([q, q])[kept]))
    return uneven_steps(excerpt, 2)


def test_rounded_stamps_are_told_and_lost_rows_are_not():
    t = np.arange(4000) / 94.0
    assert "of the steps of t are" in _said(t, np.round(t, 2))
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


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_stamps_taken_late_are_those_of_even_samples(tmp_path):
    """Of an LWR4+ 7 % were left, for 2, where they scatter by a third of a sample."""

    def change(c):
        noise = np.random.default_rng(7).normal(size=len(c["t"]))
        return c | {"t": np.sort(c["t"] + 0.3 * np.median(np.diff(c["t"])) * noise)}

    (entry, *_) = (r for r in measured("kuka_lwr4plus").recordings if r.file.startswith("traj_b"))
    study = measured("kuka_lwr4plus").with_(
        recordings=(entry.model_copy(update={"use": "identify", "from_s": 2.0, "to_s": 14.0}),)
    )
    planted_study = planted(tmp_path, change, study)
    (said,) = (c for c in tables(planted_study) if c.check == "time_stamps")
    assert said.outcome == "mended" and "those of a uniform clock" in said.message
    errors = [ident.fit(its).error_percent["identify"]["total"] for its in (study, planted_study)]
    assert errors[1] < 1.1 * errors[0]


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_stamps_taken_late_are_no_clock_at_another_rate(tmp_path):
    """Of an LWR4+ whose positions came 20 ms late, too, one of an eighth was told."""

    def change(c):
        t = c["t"]
        late = {k: np.interp(t - 0.02, t, x) if k.startswith(("q", "dq")) else x for k, x in c.items()}
        thin = {k: x[::3] for k, x in late.items()}
        h = np.median(np.diff(thin["t"]))
        noise = np.random.default_rng(7).normal(size=len(thin["t"]))
        return thin | {"t": np.sort(thin["t"] + 0.3 * h * noise)}

    study = measured("kuka_lwr4plus")
    ends = {"traj_a_run1.parquet": ("identify", 1.0, 24.0), "traj_b_run1.parquet": ("validate", 14.0, 19.0)}
    runs = [r.model_copy(update=dict(zip(("use", "from_s", "to_s"), ends[r.file]))) for r in study.recordings]
    study = study.with_(recordings=tuple(runs), filter=type(study.filter)())
    checks = examine_fit(prepare_study(planted(tmp_path, change, study)))
    assert "clock_rate" not in {c.check for c in checks}
