"""A position that stands still in a part of a recording: an encoder that stopped, or a brake."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, measured, planted, ur10e

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit, examine_tables

pytestmark = [*ON_RECORDINGS, pytest.mark.long]


@pytest.mark.parametrize("braked", [False, True])
def test_an_encoder_that_stops_midway_and_a_joint_that_is_braked(tmp_path, braked):
    """Of a UR10e whose second position stopped all torques were left, and nothing was said."""
    joint = 6 if braked else 2

    def change(c):
        t = c["t"] - c["t"][0]
        at = np.flatnonzero(t > 15.0)
        out = {k: np.array(x, float) for k, x in c.items()}
        out[f"q{joint}"][at] = c[f"q{joint}"][at[0]]
        out[f"dq{joint}"][at] = 0.0
        if braked:  # within a tenth of a second
            soon = at[t[at] < 15.1]
            rate = np.gradient(c["q6"], t)[at[0]]
            way = rate * (t[soon] - 15.0) * (1 - 5 * (t[soon] - 15.0))
            out["q6"][at] = c["q6"][at[0]] + way[-1]
            out["q6"][soon] = c["q6"][at[0]] + way
            out["i6"][at] = 0.1 * np.random.default_rng(5).normal(size=len(at))
        return out

    (fitted, judged) = ur10e().recordings
    study = ur10e().with_(recordings=(fitted.model_copy(update={"to_s": 30.0}), judged))
    made = prepare_study(planted(tmp_path, change, study))
    told = {(c.check, c.signals, c.recording) for c in (*examine_tables(made), *examine_fit(made))}
    assert told == (set() if braked else {("dead_channel", ("q2",), r.label) for r in study.recordings})


def test_a_position_that_one_of_two_fitted_runs_lacks(tmp_path):
    """Of a UR10e's third 19 % of a torque were left for 4, and that it rests was all that was said."""

    def change(c):
        later = c["t"] > 25.0
        return c | {
            name: np.where(later, c[name][0] if name == "q3" else 0.0, c[name]) for name in ("q3", "dq3")
        }

    study = planted(tmp_path, change, ur10e())
    (fitted, judged) = study.recordings
    parts = (("one", None, 25.0), ("other", 25.0, None))
    runs = [fitted.model_copy(update={"name": n, "from_s": a, "to_s": b}) for n, a, b in parts]
    made = prepare_study(study.with_(recordings=(*runs, judged.model_copy(update={"to_s": 25.0}))))
    (told,) = examine_fit(made)
    assert (told.check, told.signals, told.recording) == ("dead_channel", ("q3",), "other")
    assert "all along" in told.message and told.remedy == "leave the recording out"


@pytest.mark.parametrize("slow", [False, True])
def test_a_position_that_stops_within_a_row(tmp_path, slow):
    """Short stretches of the other torques do not tell it: of a Franka's first one nothing was said."""

    def change(c):
        t = c["t"] - c["t"][0]
        at = int(np.argmin(np.where(t > 15.0, np.abs(c["dq1"]), np.inf) if slow else -np.abs(c["dq1"])))
        out = {k: np.array(x, float) for k, x in c.items()}
        out["q1"][at:], out["dq1"][at:] = c["q1"][at], 0.0
        return out

    study = planted(tmp_path, change, measured("franka_panda"))
    said = [c for c in examine_tables(prepare_study(study)) if c.check == "dead_channel"]
    assert [c.signals for c in said] == ([] if slow else [("q1",)] * len(said)) and bool(said) != slow
