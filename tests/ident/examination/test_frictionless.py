"""Torques that were recorded less the friction of their drives."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from planted import DATA, ON_RECORDINGS, measured, parted, planted
from small_arm import ARM

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.twin import PlannedRun, simulate

PLAN = (PlannedRun("run1", "identify", 20.0), PlannedRun("run2", "validate", 15.0))


def _said(folder, share):
    """Checks of an arm of whose drives' friction so much was taken off."""
    (folder / "small.yaml").write_text(ARM)
    made = simulate(folder / "small.yaml", runs=PLAN, seed=3)
    x, runs = made.truth["standard_parameters"], []
    for its in made.recordings:
        c = dict(its.columns)
        for j in (1, 2, 3):
            rate = np.gradient(c[f"q{j}"], c["t"])
            rubs = (x[f"Fcm{j}"] + x[f"Fcl{j}"]) * np.tanh(rate / 0.01) + (x[f"Fvm{j}"] + x[f"Fvl{j}"]) * rate
            c[f"tau_m{j}"] = c[f"tau_m{j}"] - share * rubs
        runs.append(ident.Recording(pa.table(c), its.use, name=its.label))
    study = ident.Study(robot=str(folder / "small.yaml"), recordings=runs)
    return [c.check for c in examine_fit(prepare_study(study)) if c.check != "poor_excitation"]


@pytest.mark.long
def test_friction_that_was_taken_off_is_missed(tmp_path):
    assert _said(tmp_path, 1.0) == ["friction_compensated"]
    assert not _said(tmp_path, 0.0)


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("off", [False, True])
@pytest.mark.long
def test_measured_currents_less_what_goes_with_the_rate(tmp_path, off):
    """By each joint's own regression on a sign, the rate, a wave of the position."""

    def change(c):
        out = dict(c)
        for j in range(1, 7) if off else ():
            dq, q, tau = c[f"dq{j}"], c[f"q{j}"], c[f"i{j}"]
            rubs = np.column_stack([np.tanh(dq / 0.02), dq])
            own = np.column_stack([rubs, np.ones(len(q)), np.sin(q), np.cos(q)])
            out[f"i{j}"] = tau - rubs @ np.linalg.lstsq(own, tau, rcond=None)[0][:2]
        return out

    study = planted(tmp_path, change)
    checks = examine_fit(prepare_study(study.with_(filter=type(study.filter)())))
    assert [c.check for c in checks] == (["friction_compensated"] if off else [])


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_an_encoder_that_stops_midway_hides_friction(tmp_path):
    """A Barrett's two torques were said to show none: what was left of them was as large."""

    def change(c):
        half = len(c["q2"]) // 2
        stopped = {"q2": c["q2"][half], "dq2": 0.0}
        return c | {k: np.where(np.arange(len(c[k])) < half, c[k], x) for k, x in stopped.items() if k in c}

    study = planted(tmp_path, change, measured("barrett_wam_2dof"))
    fitted = tuple(r for r in study.recordings if r.use == "identify")
    checks = examine_fit(prepare_study(study.with_(recordings=fitted)))
    assert "friction_compensated" not in {c.check for c in checks}


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_what_a_wrong_table_leaves_is_no_friction_taken_off(tmp_path):
    """Of a Barrett with its two rows exchanged, of which a third is left, both torques were said to show
    none."""
    study = measured("barrett_wam_2dof")
    run = next(r for r in study.recordings if r.use == "identify")
    length = float(np.ptp(pq.read_table(study.recording_path(run), columns=["t"])["t"].to_numpy()))
    study = parted(study.with_(recordings=(run,)), 0.6 * length, 0.8 * length)
    table = yaml.safe_load((DATA / "barrett_wam_2dof" / "robot.yaml").read_text(encoding="utf-8"))
    (one, its) = table["links"]
    for key in ("alpha", "d", "r"):
        one[key], its[key] = its[key], one[key]
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(table))
    checks = examine_fit(prepare_study(study.with_(robot=str(tmp_path / "robot.yaml"))))
    assert all(c.check != "friction_compensated" for c in checks)
