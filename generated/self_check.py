"""Does a compiled kernel give the numbers that its C says? Asked once per library, in a process of its own.

A compiler, or the flags in CC, may break a kernel: -ffast-math removes the rounding trick of cos and sin, a
wrong -march stops the process. So each new library is run in a child on a few random states, and W, its
blocks and the torque are compared with NumPy on the model's own C, whose statements are plain enough for
Python (`modelgen/emit/c_code.py` refuses to write others). Only a library that agrees enters the cache.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

Array = np.ndarray
ROWS = 37  # whole groups of every vector width, and a rest
TOLERANCE = 1e-9  # of the largest number: rounding in thousands of operations stays far below
SECONDS = 120


def problem(library: Path, description: Mapping[str, Any], model_c: str) -> str:
    """Why the library must not be used; "" when it agrees with NumPy."""
    if not sys.executable:  # Python inside another program: no child can be started
        return compare(str(library), description, model_c)
    question = json.dumps([str(library), description, model_c])
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-m", "generated.self_check"]
    try:
        done = subprocess.run(
            command,
            input=question,
            capture_output=True,
            text=True,
            timeout=SECONDS,
            env=environment,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"did not end in {SECONDS} s"
    if done.returncode < 0:
        return f"stopped the process (signal {-done.returncode})"
    if done.returncode:
        return (done.stderr.strip().splitlines() or ["failed"])[-1][:200]
    return done.stdout.strip()


def evaluate(model_c: str, function: str, inputs: Mapping[str, Any], outputs: int) -> list[Any]:
    """What a function of a model's C stores, by NumPy: `inputs` are its arguments by name."""
    start = model_c.index(f"static inline void {function}(")
    body = model_c[model_c.index("\n{\n", start) + 3 : model_c.index("\n}\n", start)]
    lines = [line.strip().rstrip(";") for line in body.split("\n")]
    statements = [line for line in lines if re.match(r"a\d+ = |STORE\(", line)]
    stored: list[Any] = [0.0] * outputs

    def store(_: None, k: int, value: Any) -> None:
        stored[k] = value

    names = {
        **inputs, "W": None, "tau": None, "STORE": store, "CONSTANT": float, "CALL_exp": np.exp,
        "CALL_sin": np.sin, "CALL_cos": np.cos, "CALL_tanh": np.tanh, "CALL_abs": np.abs,
        "CALL_sqrt": np.sqrt, "CALL_sign": np.sign, "CALL_pow": np.power,
    }  # fmt: skip
    exec(compile("\n".join(statements), function, "exec"), names)
    return stored


def compare(library: str, description: Mapping[str, Any], model_c: str) -> str:
    """The first thing that differs, as half a sentence; "" when all agree."""
    from generated.kernel import Kernel
    from generated.model import Model

    model = Model(description, Kernel(Path(library), description["columns"]), (), dict)
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.uniform(-3, 3, (3, ROWS, model.n))
    q[1], q[2, 0], dq[3] = 2e4 * q[1], 1e-9, 0.0
    chi = rng.uniform(-1, 1, len(model.parameters))
    extra = {name: rng.uniform(0.1, 1, ROWS) for name in model.extra_inputs}
    turning = np.array([not joint["prismatic"] for joint in description["joints"]])
    q = np.where(turning, q, np.clip(q, -3, 3))
    signals = {"c": np.cos(q).T, "s": np.sin(q).T, "q": q.T, "dq": dq.T, "ddq": ddq.T, "sign": np.sign(dq).T}
    inputs = {**signals, "extra": [extra[name] for name in model.extra_inputs]}
    prefix = description["prefix"]
    with np.errstate(all="ignore"):
        entries = evaluate(model_c, f"{prefix}_columns", inputs, description["columns"])
        torques = evaluate(model_c, f"{prefix}_inverse_dynamics", {**inputs, "chi": chi}, len(model.channels))
    W = np.zeros((ROWS, len(model.channels), len(model.parameters)))
    for channel, parameter, source in description["nonzeros"]:
        W[:, channel, parameter] = _source(source, entries, signals)
    tau = np.stack([np.broadcast_to(t, ROWS) for t in torques], axis=1)
    blocks = [block.copy() for _, block in model.regressor_blocks(q, dq, ddq, extra=extra)]
    found = {
        "W": (model.regressor(q, dq, ddq, extra=extra), W),
        "its blocks": (np.concatenate(blocks), W),
        "the torque": (model.torque(q, dq, ddq, chi, extra=extra), tau),
    }
    for what, (got, expected) in found.items():
        known = np.isfinite(expected)  # an effect may overflow at a random state
        worst = np.abs(got - expected).max(initial=0.0, where=known)
        if not worst <= TOLERANCE * max(np.abs(expected).max(initial=0.0, where=known), 1.0):
            return f"gives wrong numbers: {what} differs from NumPy by {worst:.1e}"
    return ""


def _source(source: int | str, entries: list[Any], signals: Mapping[str, Any]) -> Any:
    if isinstance(source, int):
        return entries[source]
    if source == "one":
        return 1.0
    name = source.rstrip("0123456789")
    return signals[name][int(source[len(name) :])]


if __name__ == "__main__":
    print(compare(*json.load(sys.stdin)))
