"""What is in one run alone: a joint's other zero; loads on the run that judges, which no fitted row shows."""

import numpy as np
import pytest
import yaml
from planted import ON_RECORDINGS, planted, ur10e

import ident


def told(study):
    """The diagnosis and its only finding."""
    diagnosis = ident.diagnose(study)
    (finding,) = diagnosis.document()["findings"]
    assert not diagnosis.document()["unexplained"]
    return diagnosis, finding


@pytest.mark.long
@pytest.mark.parametrize(("zero", "recording"), [(0.03, "run1"), (-0.03, "run2"), (0.35, "run2")])
def test_another_zero_of_a_joint_in_one_run(arm, zero, recording):
    diagnosis, finding = told(arm(f"position_zero:2:zero={zero},recording={recording}"))
    its = finding["parameters"]["zero"]
    others = [r.get("recording") for r in finding["equivalent"] if r["effect"] == "position_zero"]
    assert finding["effect"] == "position_zero" and finding["joints"] == [2]
    assert recording in (finding["recording"], *others)  # of two runs either may count from another zero
    sign = 1 if finding["recording"] == recording else -1
    assert its["value"] == pytest.approx(sign * zero, rel=0.1) and 0 < its["std"] < 0.1 * abs(zero)
    errors = diagnosis.document()["error_percent"]
    assert errors["after"]["validate"]["total"] < 0.5 * errors["before"]["validate"]["total"]


@pytest.mark.parametrize(
    ("request_", "sizes"),
    [
        pytest.param(
            "payload_change:m=0.1,mz=0.01,from=4,recording=run2",
            {"m": 0.1, "mz": 0.01},
            marks=pytest.mark.long,
        ),
        pytest.param(
            "external_force:fx=0.4,fy=-0.3,fz=0.3,from=3,to=7,recording=run2",
            {"fx": 0.4, "fz": 0.3},
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_load_on_the_run_that_judges(arm, tmp_path, request_, sizes):
    """It was found and could not be fitted, so that "nothing known" explained that run."""
    diagnosis, finding = told(arm(request_))
    assert finding["effect"] == request_.split(":")[0] and finding["recording"] == "run2"
    for name, size in sizes.items():
        its = finding["parameters"][name]
        assert its["std"] > 0 and abs(its["value"] - size) < 4 * its["std"] + 0.02 * abs(size)
    assert "on run2, which told its size," in str(diagnosis)

    diagnosis.save(tmp_path / "out")
    path = tmp_path / "out" / "extended_study.yaml"
    (entry,) = yaml.safe_load(path.read_text())["effects"]
    assert {"M", "FX"} & {*entry["fixed"]}  # held as it was found, no fitted row shows it
    again = ident.fit(ident.load(path)).result.full_rate_error
    for role, errors in diagnosis.document()["error_percent"]["after"].items():
        assert again[role] == pytest.approx(errors)


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_five_degrees_on_the_fitted_run_of_a_measured_robot(tmp_path):
    """A UR10e's second joint homed 5 degrees off before the run that is fitted; twenty seconds of each."""
    turned, study = np.radians(5.0), ur10e()
    short = [entry.model_copy(update={"to_s": 20.0}) for entry in study.recordings]

    def change(columns):
        return columns | ({"q2": columns["q2"] + turned} if columns["t"][-1] - columns["t"][0] > 40 else {})

    study = planted(tmp_path, change, study.with_(recordings=tuple(short)))
    found = ident.diagnose(study).document()["findings"]
    (its,) = (f for f in found if f["effect"] == "position_zero")
    others = [r.get("recording") for r in its["equivalent"] if r["effect"] == "position_zero"]
    assert its["joints"] == [2] and "excite_a_50s" in (its["recording"], *others)  # either may, as above
    zero, sign = its["parameters"]["zero"], 1 if its["recording"] == "excite_a_50s" else -1
    assert abs(sign * zero["value"] - turned) < 2 * zero["std"]
