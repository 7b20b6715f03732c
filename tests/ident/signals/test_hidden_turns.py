"""Where the steps of an encoder hide that a joint has turned, friction does not count."""

import numpy as np
import pytest
from recordings import motion, write_parquet, write_study
from small_arm import ARM

import generated
from ident.diagnosis.opening import opened
from ident.equations.prepared import prepare_study
from ident.recordings.study import load_study
from ident.signals.filtering import filter_stream
from ident.signals.travelled import travelled
from modelgen.effects.states import integrate_dahl

RATE, TOP, TRAVEL = 500.0, 0.015, 2.5e-5  # Hz; rad/s; rad over which dry friction gives way
STEP = 3.3e-4  # rad


@pytest.fixture(scope="module")
def slow(tmp_path_factory):
    """Two runs of an arm no faster than TOP whose dry friction is Dahl's, read in steps: its study opened,
    and the states (N, 3) of its friction, run after run."""
    folder = tmp_path_factory.mktemp("slow")
    (folder / "robot.yaml").write_text(ARM)
    model = generated.load(str(folder / "robot.yaml"), "A")
    rng = np.random.default_rng(4)
    chi = 0.3 * rng.normal(size=len(model.parameters))
    for k, name in enumerate(model.parameters):
        if name.startswith(("Fv", "Fc", "Iam")):
            chi[k] = 1.0
    states = []
    for k in range(2):
        t, q, dq, ddq = motion(60, RATE, k, 3, 0.5)
        small = TOP / np.abs(dq).max(axis=0)
        q, dq, ddq = small * q, small * dq, small * ddq
        z = np.stack([integrate_dahl(x, {"width": TRAVEL}, 0.0) for x in q.T], axis=1)
        tau = np.asarray(model.torque(q, dq, ddq, chi, sign=z)) + 0.01 * rng.normal(size=(len(t), 3))
        columns = {"t": t} | {f"q{j + 1}": STEP * np.rint(q[:, j] / STEP) for j in range(3)}
        write_parquet(folder / f"run{k}.parquet", columns | {f"tau_m{j + 1}": tau[:, j] for j in range(3)})
        states.append((t, z))
    entries = [{"file": "run0.parquet"}, {"file": "run1.parquet", "use": "validate"}]
    return prepare_study(load_study(write_study(folder, entries, robot="robot.yaml"))), states


def test_friction_counts_where_the_positions_tell_its_sign(slow):
    prepared, states = slow
    for stream, bank, (t, z) in zip(prepared.streams, prepared.banks, states):
        assert bank.hidden == pytest.approx([STEP] * 3)
        blocks = [block for _, block in filter_stream(stream, bank)]
        told, sure, when = (
            np.concatenate([getattr(b, k) for b in blocks]) for k in ("sign_dq", "certain", "t")
        )
        true = np.stack([np.interp(when, t, x) for x in z.T], axis=1)
        wrong = np.sqrt(np.mean((told - true)[sure > 0.5] ** 2))
        assert wrong < 0.02 and np.mean(sure > 0.5) > 0.7
        assert np.sqrt(np.mean((told - true) ** 2)) > 10 * wrong  # what does not count


def test_nothing_is_left_of_turns(slow):
    state = opened(slow[0]).state
    for c, use in enumerate(state.rows.use):
        left = np.sqrt(np.mean(state.residual[c, use & state.rows.judged] ** 2))
        assert left < 3 * 0.01 * np.sqrt(2 * 10 / RATE)  # white noise behind 10 Hz


def test_a_path_goes_on_from_block_to_block():
    q = np.cumsum(np.random.default_rng(2).integers(-1, 2, 400)).astype(float)
    whole, _ = travelled(q)
    turn, expected = q[0], []
    for k, here in enumerate(q):
        moved = q[: k + 1][np.flatnonzero(np.diff(q[: k + 1]))[-1:]]
        way = np.sign(here - moved[0]) if len(moved) else 0.0
        before = np.sign(np.diff(q[:k]))
        last = before[before != 0][-1] if (before != 0).any() else 0.0
        if k and way and last and way != last and q[k] != q[k - 1]:
            turn = q[k - 1]
        expected.append(abs(here - turn))
    np.testing.assert_array_equal(whole, expected)
    parts, state = [], None
    for first in range(0, 400, 80):
        path, state = travelled(q[first : first + 100], state, 80)
        parts.append(path[:80])
    np.testing.assert_array_equal(np.concatenate(parts), whole)
