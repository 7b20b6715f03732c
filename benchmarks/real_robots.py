"""Before and after the loop on the recorded robots: `python benchmarks/real_robots.py [STUDY ...]`.

Every committed study `ident/studies/diagnose_*.yaml` is diagnosed. Errors are per joint and recording, in
percent of the filtered torque, with everything frozen at the fit of the identify runs. DYNIDENT_DATA names
the folder of the recordings (default: ../shared/data beside the project).
"""

import os
import sys
import time
from importlib.resources import files
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from ident.diagnosis import Diagnosis, diagnose_study
from ident.diagnosis.state import State
from ident.errors import IdentError
from ident.report.diagnosis_report import finding_sentence, unexplained_sentence
from ident.study import load_study


def by_recording(state: State) -> dict[str, np.ndarray]:
    """{recording: (channels,) percent}."""
    rows = state.context.rows
    out = {}
    for k, run in enumerate(rows.runs):
        use = (rows.run == k) & rows.keep
        rho = np.sqrt(np.sum((state.system.residual * use) ** 2, axis=1))
        size = np.sqrt(np.sum((rows.y * use) ** 2, axis=1))
        out[f"{run.label} ({run.role})"] = 100 * rho / np.maximum(size, 1e-30)
    return out


def show(name: str, diagnosis: Diagnosis, seconds: float) -> None:
    print(f"\n## {name} ({seconds:.1f} s of one processor)")
    document = diagnosis.document()
    for finding in document["findings"]:
        print("  " + finding_sentence(document, finding))
    for item in document["unexplained"]:
        print("  " + unexplained_sentence(item))
    before, after = by_recording(diagnosis.outcome.first), by_recording(diagnosis.outcome.last)
    for run in before:
        print(f"  {run:32s} before " + " ".join(f"{v:5.1f}" for v in before[run]))
        print(f"  {'':32s} after  " + " ".join(f"{v:5.1f}" for v in after[run]))


def main() -> None:
    folder = Path(str(files("ident").joinpath("studies")))
    names = sys.argv[1:] or sorted(p.stem for p in folder.glob("diagnose_*.yaml"))
    for name in names:
        path = Path(name) if Path(name).is_file() else folder / f"{name}.yaml"
        begin = time.process_time()
        try:
            show(path.stem, diagnose_study(load_study(path)), time.process_time() - begin)
        except IdentError as error:
            print(f"\n## {path.stem}: {error}")


if __name__ == "__main__":
    main()
