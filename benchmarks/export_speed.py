"""Time per call of the exported C beside Pinocchio's RNEA on the exported robot, one core.

    python benchmarks/export_speed.py [ROBOT] [--calls N]

A twin of the robot is fitted, exported and compiled with -O2 (and -O2 -march=native); both are called a
million times; Pinocchio through its Python bindings, whose own time is in the number: that of a call that
computes next to nothing is measured and printed as well. For kuka_lwr4p also Pinocchio's C++ in a compiled
loop (-O3 -march=native), as regressor_speed.py has it.
"""

import argparse
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import regressor_speed

from ident.estimation.fit import fit_study
from ident.export.c_source import c_code
from ident.export.saved import keep, load_fit
from ident.recordings.study import load_study
from ident.report.files import fit_document, write_document

TIMER = """
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <time.h>
#include "arm.h"
int main(void)
{{
  {real} q[{n}], dq[{n}], ddq[{n}], tau[{m}], sum = 0;
  struct timespec a, b;
  int j; long k;
  for (j = 0; j < {n}; j++) {{
    q[j] = ({real})(0.1 * j); dq[j] = ({real})(0.3 - 0.1 * j); ddq[j] = ({real})0.2;
  }}
  clock_gettime(CLOCK_MONOTONIC, &a);
  for (k = 0; k < {calls}L; k++) {{ q[0] += ({real})1e-7; arm_torque(q, dq, ddq, tau); sum += tau[0]; }}
  clock_gettime(CLOCK_MONOTONIC, &b);
  printf("%.1f ", ((double)(b.tv_sec - a.tv_sec) * 1e9 + (double)(b.tv_nsec - a.tv_nsec)) / {calls});
  printf("%g\\n", (double)sum);
  return 0;
}}
"""


def exported(robot: str, folder: Path):
    from ident.command_line.cli import run

    run(["simulate", robot, "-o", str(folder / "twin"), "--seed", "1"])
    result = fit_study(load_study(folder / "twin" / "study.yaml"))
    write_document(folder / "fit.json", fit_document(result))
    keep(result, folder)
    return load_fit(folder)


def c_time(fit, folder: Path, float32: bool, options: list[str], calls: int) -> float:
    """Nanoseconds of one arm_torque, the best of three runs."""
    code = c_code(fit, fit.load_robot(), "arm", float32)
    (folder / "arm.h").write_text(code.header)
    (folder / "arm.c").write_text(code.source)
    n, m = fit.columns.model.n, len(fit.columns.channels)
    real = "float" if float32 else "double"
    (folder / "timer.c").write_text(TIMER.format(real=real, n=n, m=m, calls=calls))
    build = ["cc", "-std=c99", "-O2", *options, "timer.c", "arm.c", "-o", "timer", "-lm"]
    subprocess.run(build, cwd=folder, check=True)
    run: dict = {"cwd": folder, "check": True, "capture_output": True, "text": True}
    return min(float(subprocess.run(["./timer"], **run).stdout.split()[0]) for _ in range(3))


def pinocchio_times(fit) -> tuple[float, float]:
    """Nanoseconds of one pin.rnea from Python, and of one pin.neutral, which is nearly all overhead."""
    import pinocchio as pin

    from ident.export.consistent import consistent
    from ident.export.urdf import write_urdf

    robot = fit.load_robot()
    model = pin.buildModelFromXML(write_urdf(robot, consistent(fit, robot), ""))
    data = model.createData()
    q, dq, ddq = np.random.default_rng(0).uniform(-1, 1, (3, model.nq))
    rnea = best_of(lambda: pin.rnea(model, data, q, dq, ddq))
    return rnea, best_of(lambda: pin.neutral(model))


def compiled_rnea() -> float:
    """Nanoseconds a sample of Pinocchio's RNEA in a loop of its own language."""
    peer = regressor_speed.Peer()
    q, dq, ddq = np.random.default_rng(0).uniform(-1, 1, (3, 100_000, regressor_speed.JOINTS))
    return best_of(lambda: peer.rnea(q, dq, ddq), 1) / len(q)


def best_of(call, repeats: int = 20_000) -> float:
    """Nanoseconds of a call, the best of five."""
    best = np.inf
    for _ in range(5):
        start = time.perf_counter()
        for _ in range(repeats):
            call()
        best = min(best, (time.perf_counter() - start) / repeats)
    return 1e9 * best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("robot", nargs="?", default="kuka_lwr4p", help="built-in name, robot file or URDF")
    parser.add_argument("--calls", type=int, default=1_000_000, help="of the C, a run")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        fit = exported(asked.robot, folder)
        for float32 in (False, True):
            for options in ([], ["-march=native"]):
                kind = f"C, {'float32' if float32 else 'float64'} {' '.join(options)}"
                best = c_time(fit, folder, float32, options, asked.calls)
                print(f"{kind:28} {best:8.1f} ns a call, friction included")
        rnea, overhead = pinocchio_times(fit)
        print(f"{'Pinocchio RNEA from Python':28} {rnea:8.1f} ns a call, no friction")
        print(f"{'Pinocchio from Python, idle':28} {overhead:8.1f} ns a call that computes nothing")
        if asked.robot == regressor_speed.ROBOT:
            print(f"{'Pinocchio RNEA in C++':28} {compiled_rnea():8.1f} ns a call, no friction")


if __name__ == "__main__":
    main()
