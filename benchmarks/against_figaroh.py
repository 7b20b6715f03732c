"""`ident fit` beside figaroh (https://github.com/thanhndv212/figaroh) on the same run: time and memory.

    python -m venv /tmp/figaroh && /tmp/figaroh/bin/pip install figaroh
    python benchmarks/against_figaroh.py --figaroh /tmp/figaroh/bin/python [--seconds 90] [--repeat 3]

Installs nothing; figaroh lives in an environment of its own. A KUKA iiwa 7 (seven joints, its URDF) is
simulated at 1 kHz; both identify inertia, friction, rotor inertia and offset of all joints from motor
torques. figaroh goes its documented way: low-pass filter, derivatives, `build_regressor_basic`, the columns
that do nothing left out, decimation of every column, double QR, deviations; no plots and no page, which
`ident fit` writes. Both read the same run.npz. Whole processes, in turns, medians; one run before them
derives and compiles the model, which is kept. The last lines are processes that only import what each works
with: below those no data set, however short, is identified.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path
from statistics import median

import numpy as np
from child import measured

PEER = """
import sys, warnings
import numpy as np
from scipy import signal
from figaroh.tools.load_robot import load_robot
from figaroh.tools.regressor import build_regressor_basic, build_regressor_reduced, get_index_eliminate
from figaroh.tools.qrdecomposition import QRDecomposer
from figaroh.identification.identification_tools import (
    calculate_first_second_order_differentiation, low_pass_filter_data, relative_stdev)

warnings.simplefilter("ignore")
data, urdf, cutoff = np.load(sys.argv[1]), sys.argv[2], float(sys.argv[3])
robot = load_robot(urdf, package_dirs=".")
config = {"has_friction": True, "has_actuator_inertia": True, "has_joint_offset": True,
          "is_joint_torques": True, "is_external_wrench": False, "force_torque": None,
          "ts": 1e-3, "cut_off_frequency_butterworth": cutoff, "act_idxv": list(range(7))}
q = low_pass_filter_data(data["q"], config)
tau = low_pass_filter_data(data["tau_m"], config)
q, dq, ddq = calculate_first_second_order_differentiation(robot.model, q, config)
tau = tau[: len(q)]
W = build_regressor_basic(robot, q, dq, ddq, config)
names = [str(k) for k in range(W.shape[1])]
gone, names = get_index_eliminate(W, dict(zip(names, np.ones(len(names)))), 1e-6)
W = build_regressor_reduced(W, gone)
N, n = q.shape
rows = [np.column_stack([signal.decimate(W[j * N:(j + 1) * N, k], 10, zero_phase=True)
                         for k in range(W.shape[1])]) for j in range(n)]
Y = np.concatenate([signal.decimate(tau[:, j], 10, zero_phase=True) for j in range(n)])
W = np.vstack(rows)
found = QRDecomposer().double_decomposition(Y, W, names)
base, phi = found[0], found[3]
print(base.shape[1], float(np.linalg.norm(Y - base @ phi) / np.linalg.norm(Y)))
"""


FLOORS = {
    "ident": "import numpy, ident.estimation.fit, ident.report.fit_result",
    "figaroh": PEER[: PEER.index("warnings.simplefilter")],
}


def simulated(folder: Path, seconds: float) -> Path:
    """study.yaml and run1.npz, which both read; -> the URDF."""
    from ident.recordings.tables import open_table
    from ident.twin.study import PlannedRun, simulate
    from ident.twin.writing import write_simulation
    from modelgen.geometry import robot_file

    urdf = Path(robot_file.__file__).parents[1] / "robots" / "kuka_iiwa7.urdf"
    write_simulation(simulate(str(urdf), "A", runs=(PlannedRun("run1", "identify", seconds, 44),)), folder)
    table = open_table(folder / "run1.parquet")
    values = np.concatenate(list(table.blocks(table.columns)))
    at = {name: values[:, k] for k, name in enumerate(table.columns)}
    both = {name: np.column_stack([at[f"{name}{j}"] for j in range(1, 8)]) for name in ("q", "tau_m")}
    np.savez(folder / "run1.npz", t=at["t"], **both)
    study = folder / "study.yaml"
    study.write_text(study.read_text(encoding="utf-8").replace("run1.parquet", "run1.npz"), encoding="utf-8")
    (folder / "peer.py").write_text(PEER)
    return urdf


def in_turns(commands: dict[str, list[str]], repeat: int) -> dict[str, tuple[float, ...]]:
    """Medians of wall and CPU time, largest memory; one after the other, so a busy machine is so for both."""
    rounds = [{who: measured(command, 1) for who, command in commands.items()} for _ in range(repeat)]
    columns = {who: list(zip(*(its[who] for its in rounds))) for who in commands}
    return {who: (median(wall), median(cpu), max(peak)) for who, (wall, cpu, peak) in columns.items()}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--figaroh", required=True, help="a Python that has figaroh")
    parser.add_argument("--seconds", type=float, default=90.0)
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        urdf = simulated(folder, options.seconds)
        fit = [sys.executable, "-m", "ident.command_line.cli", "fit", str(folder / "study.yaml")]
        peer = [options.figaroh, str(folder / "peer.py"), str(folder / "run1.npz"), str(urdf), "10"]
        fit += ["-o", str(folder / "out")]
        measured(fit, 1)
        pythons = {"ident": sys.executable, "figaroh": options.figaroh}
        found = in_turns({"ident fit": fit, "figaroh": peer}, options.repeat)
        floors = in_turns({who: [pythons[who], "-c", code] for who, code in FLOORS.items()}, options.repeat)
    print(f"{'':12}{'wall s':>9}{'CPU s':>9}{'MB':>8}   (load {os.getloadavg()[0]:.1f})")
    for label, figures in found.items():
        print(f"{label:12}{figures[0]:9.2f}{figures[1]:9.2f}{figures[2]:8.0f}")
    ours, theirs = found["ident fit"], found["figaroh"]
    print("ratio       " + "".join(f"{b / a:8.1f}x" for a, b in zip(ours, theirs)))
    for who, figures in floors.items():
        print(f"{who + ' imports':16}{figures[0]:5.2f}{figures[1]:9.2f}{figures[2]:8.0f}")
    least = floors["ident"]
    print("no more than" + "".join(f"{b / a:8.1f}x" for a, b in zip(least, theirs)))


if __name__ == "__main__":
    main()
