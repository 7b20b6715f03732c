"""Mutated recordings through the examination and the fit: a result of finite numbers, or one sentence."""

from __future__ import annotations

import json
import tempfile
import warnings
from functools import cache
from pathlib import Path

from tests.reliability.recordings import File, cases, columns, written

__all__ = ["CHUNK", "cases", "trial"]
CHUNK = 200
ARM = """\
name: two
convention: mdh
gravity: [0, 0, -9.81]
links:
  - {joint: revolute, antecedent: 0, alpha: pi/2, d: 0, theta: q1, r: 0}
  - {joint: revolute, antecedent: 1, alpha: 0, d: 0.4, theta: q2, r: 0}
"""


@cache
def _folder() -> Path:
    """A robot and an untouched recording that validates."""
    folder = Path(tempfile.mkdtemp(prefix="reliability-"))
    (folder / "two.yaml").write_text(ARM)
    (folder / "plain.csv").write_bytes(written(dict(columns()), "csv"))
    return folder


def trial(file: File) -> None:
    """Fit it, and write the result as fit.json holds it."""
    import ident

    folder = _folder()
    path = folder / f"run.{file.ending}"
    path.write_bytes(file.data)
    entries = [{"file": path.name}, {"file": "plain.csv", "use": "validate"}]
    text = json.dumps({"robot": "two.yaml", "model": "A", "recordings": entries})
    (folder / "study.yaml").write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        json.dumps(ident.fit(folder / "study.yaml").document(), allow_nan=False)
