"""Time and memory of `ident fit`, whole process: two 90 s runs at 1 kHz, and the same motion for an hour.

    python benchmarks/fit_speed.py [--repeat 3]

Model C of the paper's robot with payload, decimation cut-off 0.8 Hz; results, plots and report are written.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from child import measured

from ident.twin.study import PlannedRun, simulate
from ident.twin.writing import write_simulation

RUNS = (PlannedRun("run1", "identify", 90.0, 44), PlannedRun("run5", "identify", 90.0, 44, loaded=True))
STUDY = """robot: kuka_lwr4p
model: C
recordings:
  - {file: run1.parquet, use: identify}
  - {file: run5.parquet, use: identify, payload: L}
filter: {position_cutoff_hz: 10, decimation_cutoff_hz: 0.8}
"""


def lengthen(source: Path, target: Path, times: int) -> None:
    """The same run `times` over, a second apart (a gap, so segments are not bridged)."""
    table = pq.read_table(source)
    t = table.column("t").to_numpy()
    with pq.ParquetWriter(target, table.schema) as out:
        for k in range(times):
            shifted = pa.array(t + k * (t[-1] + 1.0))
            out.write_table(table.set_column(table.column_names.index("t"), "t", shifted))


def measure(study: Path, repeat: int) -> tuple[float, float, float]:
    """Median wall and CPU time [s], largest resident set [MB] of `ident fit`."""
    output = study.parent / "out"
    return measured([sys.executable, "-m", "ident", "fit", str(study), "-o", str(output)], repeat)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeat", type=int, default=3)
    repeat = parser.parse_args().repeat
    with tempfile.TemporaryDirectory() as folder:
        short, long = Path(folder) / "short", Path(folder) / "long"
        long.mkdir()
        write_simulation(simulate("kuka_lwr4p", "C", payload_kg=4.6136, runs=RUNS), short)
        for name in ("run1", "run5"):
            lengthen(short / f"{name}.parquet", long / f"{name}.parquet", 20)
        for label, place, times in (("2 x 90 s", short, repeat), ("1 h", long, 1)):
            (place / "study.yaml").write_text(STUDY, encoding="utf-8")
            wall, cpu, peak = measure(place / "study.yaml", times)
            print(f"{label:9} {wall:6.2f} s wall, {cpu:6.2f} s CPU, {peak:5.0f} MB peak", flush=True)


if __name__ == "__main__":
    main()
