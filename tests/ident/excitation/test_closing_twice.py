"""A diagnosis in doubt, the motion that decides, the diagnosis with all runs: once, on an arm of two joints.

Sixty cases of twelve pairs are benchmarks/closing_twice.py."""

import json

import numpy as np
import pyarrow as pa

import ident
from ident.excitation.experiment import Request, excite
from ident.excitation.motion import FourierMotion
from ident.report.files import fit_document, write_document
from ident.twin import PlannedRun, Sensors, simulate
from ident.twin.trajectories import Reach, fourier, reach
from modelgen.geometry.robot_file import load_robot

ARM = """\
name: small
convention: mdh
gravity: [0, -9.81, 0]
links:
  - {joint: revolute, antecedent: 0, alpha: 0, d: 0,   theta: q1, r: 0}
  - {joint: revolute, antecedent: 1, alpha: 0, d: 0.3, theta: q2, r: 0}
"""
HIDDEN = "quadratic_friction:1:Fv2=0.094"


def test_what_was_one_or_the_other_is_the_true_one_after_the_motion_that_decides(tmp_path):
    robot = tmp_path / "small.yaml"
    robot.write_text(ARM)
    whole = reach(load_robot(str(robot)))
    slow = Reach(whole.centre, 0.3 * whole.half, 0.3 * whole.rate, 0.3 * whole.acceleration)

    def recorded(*plans):
        runs = tuple(PlannedRun(name, use, motion.duration, motion=motion) for name, use, motion in plans)
        sensors = Sensors(rate_hz=125.0, noise_percent=0.0, noise_floor=3e-3)
        made = simulate(robot, effects=(HIDDEN,), seed=0, runs=runs, sensors=sensors)
        tables = ((pa.table(dict(r.columns)), r) for r in made.recordings)
        return [ident.Recording(table, r.use, name=r.label) for table, r in tables]

    def diagnosed(runs):
        return ident.diagnose(ident.Study(robot=str(robot), recordings=runs))

    slowly = [fourier(slow, 16.0, np.random.default_rng([0, 3, k])) for k in range(2)]
    before = recorded(("run1", "identify", slowly[0]), ("run2", "validate", slowly[1]))
    first = diagnosed(before)
    finding = first.document()["findings"][0]
    suspects = {finding["effect"], *(rival["effect"] for rival in finding["equivalent"])}
    assert "quadratic_friction" in suspects and len(suspects) > 1
    assert finding["separate"]["command"].startswith("ident excite") and finding["separate"]["seconds"] > 0

    write_document(tmp_path / "diagnosis.json", first.document())
    write_document(tmp_path / "fit.json", fit_document(first.result.last))
    assert json.loads((tmp_path / "diagnosis.json").read_text())["smallest_visible"]
    done = excite(
        Request(str(robot), diagnosis=tmp_path, duration=10.0, starts=1, iterations=15, sensitivity=False)
    )
    assert "quadratic_friction:1" in done.separated.labels
    answer = FourierMotion(done.motion.basis, done.motion.x, 10.0).motion
    again = recorded(("answer1", "identify", answer), ("answer2", "validate", answer))
    findings = diagnosed([*before, *again]).document()["findings"]
    assert [f["effect"] for f in findings] == ["quadratic_friction"]
    assert findings[0]["equivalent"] == []
    assert abs(findings[0]["parameters"]["Fv2"]["value"] - 0.094) < 0.01
