"""The loop closed on recordings of real robots: what was found, error before and after, as Markdown.

    python benchmarks/measured_robots.py [-o FOLDER] [NAME ...] > notebooks/measured_robots.md

Runs `ident diagnose` on every ident/studies/diagnose_NAME.yaml whose recordings are there (../shared/data, or
DYNIDENT_DATA) and that FOLDER (build/measured) has no result of yet, then tells all results of FOLDER.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ident.report.diagnosis_words import finding_sentence, unexplained_sentence, verdict

STUDIES = Path(__file__).parents[1] / "ident" / "studies"
PREFIX = "diagnose_"
MOST = 5  # sentences of findings, and of unexplained structure


def diagnose(names: list[str], folder: Path) -> None:
    """One process a study, as a user would."""
    for study in sorted(STUDIES.glob(f"{PREFIX}*.yaml")):
        name = study.stem.removeprefix(PREFIX)
        if (names and name not in names) or (folder / name / "diagnosis.json").is_file():
            continue
        command = [
            sys.executable,
            "-m",
            "ident.command_line.cli",
            "diagnose",
            str(study),
            "-o",
            str(folder / name),
        ]
        done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        print(f"{name}: {'done' if done.returncode == 0 else done.stderr.strip()}", file=sys.stderr)


def section(name: str, document: Mapping[str, Any]) -> list[str]:
    """Heading, what the study is, what was found, error table."""
    study = (STUDIES / f"{PREFIX}{name}.yaml").read_text(encoding="utf-8").splitlines()
    about = " ".join(line.removeprefix("#").strip() for line in study if line.startswith("#"))
    lines = [f"## {name.replace('_', ' ')}", about, "", f"**{verdict(document)}**", ""]
    for items, tell in (
        (document["findings"], lambda item: finding_sentence(document, item)),
        (document["unexplained"], unexplained_sentence),
    ):
        lines += [f"- {tell(item)}" for item in items[:MOST]]
        if len(items) > MOST:
            lines.append(f"- {len(items) - MOST} more of the same kind, weaker.")
    before, after = (
        {**document["error_percent"][when], **document["error_percent_by_recording"][when]}
        for when in ("before", "after")
    )
    channels = list(next(iter(before.values())))
    lines += ["", "| error in percent, before → after | " + " | ".join(channels) + " |"]
    lines.append("|---" * (len(channels) + 1) + "|")
    for group in before:  # roles, then recordings
        cells = [f"{before[group][channel]:.1f} → {after[group][channel]:.1f}" for channel in channels]
        lines.append(f"| {group} | " + " | ".join(cells) + " |")
    floor = document["noise_floor_percent"]
    cells = [f"{floor[channel]:.1f}" if channel in floor else "" for channel in channels]
    lines.append("| noise floor | " + " | ".join(cells) + " |")
    return [*lines, ""]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", help="studies, without diagnose_ and .yaml; all by default")
    parser.add_argument("-o", "--output", type=Path, default=Path("build/measured"))
    arguments = parser.parse_args()
    diagnose(arguments.names, arguments.output)
    lines = [
        "# Measured robots",
        "Written by `python benchmarks/measured_robots.py > notebooks/measured_robots.md`.",
        "Errors are those of the filtered torque, on the same rows before and after. Runs marked *test* were",
        "used for nothing else; *validate* runs decided what is kept; in a study with neither, recordings",
        "left out in turn decided.",
        "",
    ]
    for path in sorted(arguments.output.glob("*/diagnosis.json")):
        lines += section(path.parent.name, json.loads(path.read_text(encoding="utf-8")))
    print("\n".join(lines))


if __name__ == "__main__":
    main()
