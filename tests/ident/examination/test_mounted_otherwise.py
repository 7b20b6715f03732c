"""A base that stands otherwise in one recording, of a simulated arm."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import ROBOT, motion, write_parquet, write_study

import generated
from ident.estimation.fit import fit_study
from ident.examination.fits.bodies import torques
from ident.recordings.study import load_study
from modelgen.geometry.kinematics import Geometry

USES = ("identify", "identify", "validate")


def _bodies(links):
    """(10 L,): cylinders of 3 kg and less towards the tip, their centres off the axes."""
    rng, out = np.random.default_rng(5), []
    for k in range(links):
        m = 3.0 / (1 + 0.3 * k)
        x, y, z = 0.1 * rng.normal(size=3)
        xx, yy, zz = 0.02 + m * (y * y + z * z), 0.02 + m * (x * x + z * z), 0.01 + m * (x * x + y * y)
        out += [xx, -m * x * y, -m * x * z, yy, -m * y * z, zz, m * x, m * y, m * z, m]
    return np.array(out)


def _warned(folder, degrees, of, change=lambda columns: columns):
    """What is warned of three recordings, in number `of` with the base turned about x, or something else."""
    table = Geometry.of(generated.load(ROBOT, "A").geometry)
    bodies, g = _bodies(len(table.rows)), 9.81
    for k in range(len(USES)):
        t, q, dq, ddq = motion(30.0, 200.0, seed=10 + k)
        angle = np.radians(degrees) if k == of else 0.0
        there = replace(table, gravity=(0.0, g * np.sin(angle), -g * np.cos(angle)))
        tau = torques(there, q, dq, ddq, bodies).T + 3.0 * dq + 2.0 * np.tanh(dq / 0.01) + 0.3 * ddq
        tau += 0.2 * np.random.default_rng([k, 9]).normal(size=tau.shape)
        columns = {"t": t} | {f"q{j + 1}": q[:, j] for j in range(7)}
        columns |= {f"tau_m{j + 1}": tau[:, j] for j in range(7)}
        write_parquet(folder / f"run{k}.parquet", change(columns) if k == of else columns)
    entries = [{"file": f"run{k}.parquet", "use": use} for k, use in enumerate(USES)]
    checks = fit_study(load_study(write_study(folder, entries))).checks
    return [(c.check, c.recording, c.signals) for c in checks if c.outcome == "warned"], checks


@pytest.mark.parametrize("of", [0, pytest.param(2, marks=pytest.mark.long)])
def test_a_base_that_stands_otherwise_in_one_recording_is_told(tmp_path, of):
    """Of an LWR4+ another zero of a joint was told there, or a load; of a UR10e and an AIRBOT nothing."""
    told, checks = _warned(tmp_path, 8.0, of)
    assert told == [("base_orientation", f"run{of}", ())]
    (check,) = (c for c in checks if c.check == "base_orientation")
    degrees = float(check.message.split("about ")[1].split(" degrees")[0])
    assert abs(degrees - 8.0) <= 1.5


@pytest.mark.long
@pytest.mark.parametrize("change", [lambda c: c, lambda c: c | {"q2": c["q2"] + 0.1}])
def test_nothing_else_is_a_base(tmp_path, change):
    told, _ = _warned(tmp_path, 0.0, 0, change)
    assert "base_orientation" not in [check for check, *_ in told]
