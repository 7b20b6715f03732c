"""A position that was held for a while, beside one that leaps."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, strangers_log
from small_arm import ARM

import ident
from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit


@pytest.mark.parametrize(("held", "joints"), [(160, (2,)), (15, (2,)), (160, (1, 2, 3)), (0, ())])
def test_rows_in_which_a_position_was_held_are_named(tmp_path, held, joints):
    """It was said to have slipped in the row behind them, where they were few or all positions were held."""
    (tmp_path / "small.yaml").write_text(ARM)
    t = np.arange(3000) / 40
    columns = {"t": t} | {f"{kind}{j}": np.sin(j * t) for kind in ("q", "tau_m") for j in (1, 2, 3)}
    if held:
        for j in joints:
            columns[f"q{j}"][1450 - held : 1450] = columns[f"q{j}"][1450 - held]
    else:
        columns["q2"][1450:] += 0.7
    study = ident.Study(
        robot=str(tmp_path / "small.yaml"), recordings=[ident.Recording(columns, use="identify", name="run")]
    )
    with pytest.raises(ident.Error) as caught:
        ident.fit(study)
    said = f"stands still in rows {1451 - held} to 1450" if held else "in row 1451 and stays there"
    assert said in str(caught.value)


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_a_position_that_is_one_number_throughout_may_not_be_recorded(tmp_path):
    """Of a Barrett without its first one its second torque was told to have the other sign."""

    def change(log):
        for table in log.tables.values():
            table["q1"], table["dq1"] = 0 * table["q1"], 0 * table["q1"]

    study = strangers_log(tmp_path, "barrett_wam_2dof", (50, False, True, True), change)
    (told, *_) = examine_fit(prepare_study(study))
    assert "or q1 is not recorded, though the joint moves" in told.message
