"""Every notebook runs in a fresh kernel, and the claim in its last cell is checked here."""

import json
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(path.name for path in FOLDER.glob("*.ipynb"))


def executed(name, tmp_path):
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(FOLDER / name, as_version=4)
    client = NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    )
    client.execute()
    return json.loads(notebook.cells[-1].outputs[-1]["text"])


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_outputs_are_whole_and_the_last_cell_is_the_claim(name):
    cells = json.loads((FOLDER / name).read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    counts = [cell["execution_count"] for cell in code]  # run once from top to bottom, or not at all
    assert counts in ([None] * len(code), list(range(1, len(code) + 1)))
    assert not any(output["output_type"] == "error" for cell in code for output in cell["outputs"])
    assert "".join(cells[-2]["source"]).startswith("## The claim")
    assert "json.dumps" in "".join(cells[-1]["source"])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
def test_regrouped_parameters(tmp_path):
    claim = executed("1_regrouped_parameters.ipynb", tmp_path)
    assert claim["counts"] == {"A": 79, "B": 74, "C": 102, "D": 28}
    assert (
        claim["rank_of_all_joints"]
        == claim["base_parameters_of_the_bare_arm"]
        == 69
        > claim["rank_of_ten_poses"]
    )
    assert claim["separate_in_C"] == 28
    assert claim["rotors_mixed_in_A"] == ["Iam1", "Iam2"]


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
def test_the_paper_on_a_twin(tmp_path):
    claim = executed("2_the_paper_on_a_twin.ipynb", tmp_path)
    assert claim["base_parameters"] == {"A": 79, "B": 74, "C": 102, "D": 28}
    assert all(abs(error) < 1 for error in claim["payload_error_percent"].values())
    # the twin has the paper's Iam2 = 3.05; 2 % is some five of its standard deviations
    assert all(abs(value / 3.05 - 1) < 0.02 for value in claim["Iam2"].values())
    assert abs(claim["ZZ2R_A_minus_C_is_Iam2"] / 3.05 - 1) < 0.05
    # gears that yield: the joints' positions are where the bodies are
    assert claim["off_truth_percent"]["joint"] < 0.5 * claim["off_truth_percent"]["motor"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
def test_the_regressor_in_your_own_code(tmp_path):
    claim = executed("4_regressor_in_your_code.ipynb", tmp_path)
    assert claim["chi_error"] < 1e-8  # of numbers of size 1, through normal equations
    assert claim["c_against_python"] < 1e-9
    assert claim["rms_torque"]["optimal"] < 0.8 * claim["rms_torque"]["quintic"]


def claims_to_close_the_loop(claim):
    before, after = claim["total"]
    assert after < 0.85 * before
    assert claim["refitted"] < 1e-6


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
def test_closing_the_loop(tmp_path, monkeypatch):
    """On the twin that takes the place of the recordings where these are not there."""
    monkeypatch.setenv("DYNIDENT_DATA", str(tmp_path / "not_there"))
    claim = executed("3_closing_the_loop.ipynb", tmp_path)
    assert not claim["real"]
    claims_to_close_the_loop(claim)
    assert sorted(claim["found"]) == [["load_dependent_friction", [2]], ["stribeck_friction", [4]]]


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
def test_closing_the_loop_on_a_measured_robot(tmp_path):
    claim = executed("3_closing_the_loop.ipynb", tmp_path)
    if not claim["real"]:
        pytest.skip("no measured robots here: set DYNIDENT_DATA")
    claims_to_close_the_loop(claim)
    assert ["load_dependent_friction", [2]] in claim["found"]
