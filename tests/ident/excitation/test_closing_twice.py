"""A diagnosis in doubt, the motion that decides, the diagnosis with all runs: once, on an arm of two joints.

Sixty cases of twelve pairs are benchmarks/closing_twice.py."""

import json

import pytest

from benchmarks.closing_twice import ARM, Case, PlannedRun, answer
from ident.report.files import fit_document, write_document

HIDDEN = "quadratic_friction:1:Fv2=0.094"


@pytest.mark.long
def test_what_was_one_or_the_other_is_the_true_one_after_the_motion_that_decides(tmp_path):
    robot = tmp_path / "small.yaml"
    robot.write_text(ARM)
    case = Case("quadratic_friction", 1, 0, 0, robot)
    before = case.recordings((HIDDEN,), case.runs())
    first = case.told(before)
    finding = first.document()["findings"][0]
    suspects = {finding["effect"], *(rival["effect"] for rival in finding["equivalent"])}
    assert "quadratic_friction" in suspects and len(suspects) > 1
    offer = finding["separate"]
    assert offer["command"].startswith("ident excite") and offer["seconds_as_recorded"] > 0
    kept = first.document(tmp_path)["findings"][0]  # in a folder, its commands count what was recorded
    commands = [kept["separate"]["command"], kept["equivalent"][0]["separate"]]
    assert all(f" --from {tmp_path} --separate " in command for command in commands)
    (said,) = offer["so_far"]  # the run that judged goes on judging
    logs = [finding["evidence"]["log_e"], finding["equivalent"][0]["log_e"]]
    assert said["ahead"] == pytest.approx(logs[0] - logs[1], abs=1.0)

    write_document(tmp_path / "diagnosis.json", first.document())
    write_document(tmp_path / "fit.json", fit_document(first.result.last))
    assert json.loads((tmp_path / "diagnosis.json").read_text())["smallest_visible"]
    done, motion = answer(case, tmp_path)
    assert "quadratic_friction:1" in done.separated.labels
    assert (
        done.separated.pairs[0].so_far.ahead == said["ahead"]
        and "stays in the study" in done.separated.sentence
    )
    assert done.separated.seconds <= offer["seconds"]  # a bound: what is designed needs no longer
    moved = motion.motion
    plans = [
        PlannedRun(name, use, moved.duration, motion=moved)
        for name, use in (("answer1", "identify"), ("answer2", "validate"))
    ]
    findings = case.told([*before, *case.recordings((HIDDEN,), tuple(plans))]).document()["findings"]
    assert [f["effect"] for f in findings] == ["quadratic_friction"]
    assert findings[0]["equivalent"] == []
    assert abs(findings[0]["parameters"]["Fv2"]["value"] - 0.094) < 0.01
