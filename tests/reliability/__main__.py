"""`make reliability`: as many mutated inputs as wished, a table at the end, exit status 1 if anything failed.

    python -m tests.reliability --robots 20000 --planted 1000 --seed 7

`RELIABILITY=0.1` in the environment multiplies the numbers.
"""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support")]
USUAL = {
    "robots": 20000,
    "studies": 20000,
    "recordings": 20000,
    "planted": 1000,
    "fits": 500,
    "commands": 500,
    "kills": 20,
}


def main() -> int:
    """Exit status."""
    from tests.reliability import command_lines, fits, kills, planted, recordings, robot_files, studies
    from tests.reliability.explore import explore, table
    from tests.reliability.judge import HANG_S

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    times = float(os.environ.get("RELIABILITY", "1"))
    for name, number in USUAL.items():
        parser.add_argument(f"--{name}", type=int, default=int(times * number), metavar="N")
    parser.add_argument("--seed", type=int, default=0, help="of the first chunk")
    wanted = parser.parse_args()
    warnings.simplefilter("ignore")
    tallies = []
    for name, module in (
        ("robots", robot_files),
        ("studies", studies),
        ("recordings", recordings),
        ("planted", planted),
        ("fits", fits),
        ("commands", command_lines),
        ("kills", kills),
    ):
        if number := getattr(wanted, name):
            seconds = getattr(module, "HANG_S", HANG_S)
            found = explore(
                name, module.cases(), module.trial, number, wanted.seed, module.CHUNK, seconds=seconds
            )
            tallies.append(found)
    print(table(tallies))
    return int(any(t.failures for t in tallies))


if __name__ == "__main__":
    sys.exit(main())
