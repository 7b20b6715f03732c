"""Small linear problems as the diagnosis reads them, and a simulated arm of three joints."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "support"))

from small_arm import ARM

from ident.diagnosis.evidence.metric import metric, stacked
from ident.diagnosis.opening import opened
from ident.diagnosis.rows.rows import Rows
from ident.diagnosis.rows.whitened import Whitener
from ident.equations.prepared import prepare_study
from ident.recordings.study import load_study
from ident.twin import PlannedRun, Sensors, simulate, write_simulation


def tiny_rows(columns, Y, hop=0.05, piece=None, use=None):
    """One channel, columns (M, b), Y (M,): the first half is fitted, the second judged."""
    M, b = columns.shape
    half = np.arange(M) < M // 2
    used = np.ones(M, bool) if use is None else use
    return Rows(
        np.arange(M) * hop,
        np.where(half, 0, 1),
        np.where(half, 0, 1) if piece is None else piece,
        Y[None, :],
        used[None, :],
        half,
        ~half,
        ((np.arange(b), columns),),
        b,
        ("run1", "run2"),
        ("identify", "validate"),
        (None, None),
        used[None, :].astype(float),
        hop,
        True,
    )


def white(rows, sigma=1.0):
    return [Whitener.white(use, sigma) for use in rows.use]


def white_metric_of(rows, sigma=1.0):
    design, B = stacked(rows, [])
    return metric(rows, design, B, white(rows, sigma), slow=False)  # white whatever the rows say


@pytest.fixture(scope="session")
def tiny():
    """The functions above, for test files that cannot import this one."""
    return {"rows": tiny_rows, "white": white, "metric": white_metric_of}


RUNS = (PlannedRun("run1", "identify", 14.0), PlannedRun("run2", "validate", 10.0))


@pytest.fixture(scope="session")
def arm(tmp_path_factory):
    """study(*effects): an arm of three joints with effects that its study does not declare."""
    folder = tmp_path_factory.mktemp("arm")
    (folder / "robot.yaml").write_text(ARM)

    def study(*effects, change=None):
        made = simulate(
            folder / "robot.yaml", "A", effects, seed=3, sensors=Sensors(rate_hz=200.0), runs=RUNS
        )
        if change is not None:
            for run in made.recordings:
                change(run.columns)
        out = folder / ("_".join(effects) or "clean").replace(":", "-").replace("=", "-").replace(",", "-")
        out = out.with_name(out.name + (f"_{change.__name__}" if change else ""))
        return load_study(write_simulation(made, out))

    return study


@pytest.fixture(scope="session")
def clean_arm(arm):
    """The arm without effects, opened: first state, layout."""
    return opened(prepare_study(arm()))
