"""A first study as YAML text with comments; what could not be known is marked and holds `ident fit` back."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ident.inspection.proposal import Proposal
from ident.recordings.fill_in import FILL_IN

HELD_OUT = 0.3  # of a single recording, for validation
LEAST_S = 20.0  # a shorter one is not cut


@dataclass(frozen=True, slots=True)
class Source:
    """One recording: a file, or one of its episodes."""

    file: Path
    episode: int | None = None

    @property
    def label(self) -> str:
        return self.file.stem + ("" if self.episode is None else f"_{self.episode}")


OPENING = f"""# A first study, written by ident inspect. Lines with {FILL_IN} hold ident fit back until they
# say what is asked beside them; everything else was read off the recordings and may be changed.
"""


def study_text(
    sources: Sequence[Source],
    spans: Sequence[tuple[float, float] | None],
    proposal: Proposal,
    robot: str | None,
    folder: Path,
    topic: str | None = None,
    exact: bool = False,
) -> str:
    """The whole file. `spans`: first and last second of each recording where its time is known."""
    lines = [OPENING]
    if robot is None:
        lines.append(f"robot: {FILL_IN}   # a built-in name, a robot file (YAML) or a URDF")
    else:
        lines.append(f"robot: {_quoted(_relative(Path(robot), folder) if Path(robot).is_file() else robot)}")
    lines += ["exact: true   # the URDF's angles and lengths as they are written"] if exact else []
    effort = any(line.key == "effort" for line in proposal.lines)
    said = "B where effort is joint_torque" if effort else "torques: A motor, B joint sensor, C both"
    lines += [f"model: {proposal.model}   # {said}", "recordings:"]
    lines += [f"  - {entry}" for entry in _entries(sources, spans, proposal, folder, topic)]
    mapped = dict(proposal.columns)
    asked = {
        line.key.removeprefix("columns."): line for line in proposal.lines if line.key.startswith("columns.")
    }
    if mapped or asked:
        lines.append("columns:")
        lines += [
            f"  {key}: {value if value.startswith('{') else _quoted(value)}" for key, value in mapped.items()
        ]
        lines += [f"  {key}: {line.value}   # {line.why}" for key, line in asked.items()]
    for line in proposal.lines:
        if not line.key.startswith("columns."):
            lines.append(f"{line.key}: {line.value}   # {line.why}")
    return "\n".join(lines) + "\n"


def trial_text(text: str, proposal: Proposal) -> str:
    """The same study with stand-ins for what only the torque's meaning depends on."""
    ones = f"[{', '.join(['1'] * max(proposal.n, 1))}]"
    text = re.sub(rf"^effort: {FILL_IN}.*$", "effort: motor_torque", text, flags=re.MULTILINE)
    return re.sub(rf"^drive_gains: {FILL_IN}.*$", f"drive_gains: {ones}", text, flags=re.MULTILINE)


def _entries(
    sources: Sequence[Source],
    spans: Sequence[tuple[float, float] | None],
    proposal: Proposal,
    folder: Path,
    topic: str | None,
) -> list[str]:
    """One recording is cut in two, the last of several is held out."""
    counted = f", rate_hz: {FILL_IN}" if proposal.counted else ""
    counted += f", topic: {_quoted(topic)}" if topic else ""
    ask = "   # samples a second: the table has no time" if proposal.counted else ""
    names = [_quoted(_relative(its.file, folder)) for its in sources]
    if len(sources) == 1:
        first, last = spans[0] or (0.0, 0.0)
        if not last - first >= LEAST_S or proposal.counted:
            return [f"{{file: {names[0]}, use: identify{counted}}}{ask}"]
        cut = f"{last - HELD_OUT * (last - first):.1f}"  # of the table's own time
        return [
            f"{{file: {names[0]}, name: first, use: identify, to: {cut}{counted}}}",
            f"{{file: {names[0]}, name: last, use: validate, from: {cut}{counted}}}",
        ]
    uses = ["identify"] * (len(sources) - 1) + ["validate"]
    labels = [its.label for its in sources]
    extra = [f", name: run{k + 1}" if labels.count(label) > 1 else "" for k, label in enumerate(labels)]
    extra = [("" if its.episode is None else f", episode: {its.episode}") + more
             for its, more in zip(sources, extra)]  # fmt: skip
    return [
        f"{{file: {name}{more}, use: {use}{counted}}}{ask}" for name, more, use in zip(names, extra, uses)
    ]


def _relative(path: Path, folder: Path) -> str:
    """As seen from the study's folder."""
    try:
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    except ValueError:  # another drive
        return path.resolve().as_posix()


def _quoted(text: str) -> str:
    """As it is where YAML takes it for the same text."""
    plain = re.fullmatch(r"[A-Za-z_./][\w./-]*", text) and text.lower() not in (
        "y",
        "n",
        "yes",
        "no",
        "on",
        "off",
    )
    return text if plain and text.lower() not in ("true", "false", "null") else json.dumps(text)
