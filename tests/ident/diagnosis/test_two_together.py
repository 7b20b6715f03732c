"""Two effects of which neither says anything of the judged rows as long as the other is not in the model."""

import pytest

import ident
from benchmarks.exam.make_cases import make_case


@pytest.mark.long
def test_two_couplings_of_one_joint_that_hide_each_other(tmp_path):
    """Of the fifth joint of an arm to the first and the fourth: each said 65 nats on the fitted rows and 10
    against itself on the judged ones, nothing was told, and 4.4 % of the torque were left for 1."""
    names = ["joint_coupling"] * 2
    truth = make_case("twice", names, 3730894877, "two", tmp_path, 30.0, 250.0, "")
    true = {its["source_joint"]: its["parameters"] for its in truth["effects"]}
    diagnosis = ident.diagnose(ident.load(tmp_path / "cases" / "two" / "study.yaml"))
    found = {f.where["source_joint"]: f for f in diagnosis.findings}
    assert set(found) == set(true) and {f.effect for f in diagnosis.findings} == {"joint_coupling"}
    for source, parameters in true.items():
        for name, value in parameters.items():
            told = found[source].parameters[name]
            assert abs(told["value"] - value) < 4 * told["std"]


@pytest.mark.long
def test_two_of_one_kind_on_a_slide_reach_the_last_fit(tmp_path):
    """What the loop found at 0.045 m/s the study's own fit refused: it searched a Stribeck rate up to 0.038
    on a slide that goes 0.3 m, and both were told as something without a name."""
    make_case("twice", ["stribeck_friction"] * 2, 1829175813, "slide", tmp_path, 30.0, 250.0, "")
    (study,) = tmp_path.glob("**/study.yaml")
    told = ident.diagnose(ident.load(study)).document()["findings"]
    assert [(f["effect"], f["joints"]) for f in told] == [("stribeck_friction", [5])] * 2
    assert sorted(f["parameters"]["vs"]["value"] for f in told) == pytest.approx([0.0151, 0.0446], rel=0.05)
