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
