"""Writing a simulated study into a folder: one Parquet file a run, study.yaml, and the truth apart."""

import json
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import yaml

from ident.output import staged
from ident.summaries.arrow import table_of
from ident.twin.study import SimulatedStudy

TRUTH = "truth.json"  # not named in the study; for whoever wants to check an answer


def write_simulation(simulated: SimulatedStudy, folder: Path, overwrite: bool = False) -> Path:
    """Write run1.parquet .., study.yaml, truth.json (and the robot file, unless built in); returns the study.

    All or nothing, and over nothing that is not ours. Raises OutputError.
    """
    inputs = [simulated.robot_file] if simulated.robot_file else []
    with staged(folder, "ident simulate", overwrite=overwrite, inputs=inputs) as stage:
        for recording in simulated.recordings:
            pq.write_table(table_of(recording.columns), stage / f"{recording.label}.parquet")
        if simulated.robot_file is not None:
            shutil.copyfile(simulated.robot_file, stage / simulated.robot_file.name)
        text = yaml.safe_dump(dict(simulated.study), sort_keys=False, default_flow_style=None, width=100)
        (stage / "study.yaml").write_text(text, encoding="utf-8")
        (stage / TRUTH).write_text(json.dumps(simulated.truth, indent=1) + "\n", encoding="utf-8")
    return folder / "study.yaml"
