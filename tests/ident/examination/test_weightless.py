"""Torques that were recorded less what the controller adds to carry the arm."""

import numpy as np
import pyarrow as pa
import pytest
from planted import ON_RECORDINGS, planted
from small_arm import ARM

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.fits.quick import quick_of
from ident.examination.fits.samples import at_rest, take
from ident.examination.undone import mended_study
from ident.twin import PlannedRun, simulate

PLAN = (PlannedRun("run1", "identify", 20.0), PlannedRun("run2", "validate", 15.0))


def _carrying(truth, q2, q3):
    """N m that hold joints 2 and 3, whose axes are level, by first moments and masses of a simulated arm."""
    x = truth["standard_parameters"]
    third = 9.81 * (x["MX3"] * np.cos(q2 + q3) - x["MY3"] * np.sin(q2 + q3))
    second = 9.81 * ((x["MX2"] + 0.3 * x["M3"]) * np.cos(q2) - x["MY2"] * np.sin(q2))
    return {"tau_m2": second + third, "tau_m3": third}


def _study(tmp_path, names, runs=("run1", "run2"), share=1.0):
    (tmp_path / "small.yaml").write_text(ARM)
    made = simulate(tmp_path / "small.yaml", runs=PLAN, seed=3)
    out = []
    for its in made.recordings:
        c = dict(its.columns)
        less = _carrying(made.truth, c["q2"], c["q3"]) if its.label in runs else {}
        c |= {name: c[name] - share * less[name] for name in names if name in less}
        out.append(ident.Recording(pa.table(c), its.use, name=its.label))
    return ident.Study(robot=str(tmp_path / "small.yaml"), recordings=out)


def _said(checks):
    return [(c.check, c.signals, c.recording) for c in checks if c.check != "poor_excitation"]


def test_of_a_small_arm_one_torque_is_no_other_fault(tmp_path):
    """Its inertia hardly shows beside friction, so that gravity may as well be made up for."""
    assert not _said(ident.fit(_study(tmp_path, ["tau_m2"])).checks)


def test_torques_that_show_no_gravity_are_remarked_on(tmp_path):
    (check,) = ident.fit(_study(tmp_path, ["tau_m2", "tau_m3"])).checks
    assert (check.check, check.signals) == ("poor_excitation", ("tau_m2", "tau_m3"))
    assert "do not show gravity" in check.message


def test_torques_that_show_some_of_gravity_are_remarked_on(tmp_path):
    """A controller's model of the arm is not the arm's. It was told that the base may be upside down."""
    (check,) = ident.fit(_study(tmp_path, ["tau_m2", "tau_m3"], share=0.9)).checks
    assert "do not show how the base is mounted" in check.message and "a controller adds" in check.remedy


def test_in_one_recording(tmp_path):
    (said,) = _said(ident.fit(_study(tmp_path, ["tau_m2", "tau_m3"], ["run1"])).checks)
    assert said == ("gravity_compensated", ("tau_m2", "tau_m3"), "run1")


def test_a_torque_that_feels_gravity_is_left_alone(tmp_path):
    assert not any("gravity_comp" in c.check or "show gravity" in c.message for c in _as_it_is(tmp_path))


def _as_it_is(tmp_path):
    return ident.fit(_study(tmp_path, [])).checks


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("names", [("i2",), ("i1", "i2", "i3", "i4", "i5", "i6")])
def test_of_a_measured_robot(tmp_path, names):
    """Without what a fit of its own recordings says that gravity asks for: of all nothing was said, of the
    second one the third was told as 1.7 times too large."""
    prepared = prepare_study(planted(tmp_path, lambda c: c))
    quick, gains = _quick(prepared), np.array(prepared.study.drive_gains)

    def change(c):
        q = np.stack([c[f"q{j}"] for j in range(1, 7)], axis=1)
        tau = at_rest(prepared.columns, None, q) @ quick.fit(quick.plain()).chi / gains[:, None]
        return c | {name: c[name] - tau[int(name[1]) - 1] for name in names}

    study = planted(tmp_path, change)
    (said,) = (checks := examine_fit(prepare_study(study)))
    assert said.check == "gravity_compensated" and set(said.signals) == set(names) - {"i1"}
    if len(names) > 1:
        assert mended_study(study, checks).gravity == (0, 0, 0)


def _quick(prepared):
    roles = ("identify", "validate")
    return quick_of(
        prepared.columns,
        [s for role in roles for s in take(prepared.streams, prepared.banks, prepared.columns, role)],
    )


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_velocity_in_the_place_of_a_measured_torque(tmp_path):
    """It shows no gravity, and no body either: it was told to be compensated."""
    study = planted(tmp_path, lambda c: c | {"i4": 20 * np.gradient(c["q4"], c["t"])})
    (said,) = examine_fit(prepare_study(study))
    assert (said.check, said.signals) == ("unrelated_torque", ("i4",))
    assert said.message.startswith("i4 shows friction alone, as its joint's velocity")
