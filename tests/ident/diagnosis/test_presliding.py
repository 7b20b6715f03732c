"""Presliding that shows in the error is no nuisance; a little of it is."""

import numpy as np
import pytest
from recordings import motion, write_parquet, write_study
from small_arm import ARM

import generated
from ident.diagnosis.opening import opened
from ident.equations.prepared import prepare_study
from ident.recordings.study import load_study
from modelgen.effects.states import integrate_dahl

WIDTH, RATE = 0.004, 0.03  # rad of travel before the first joint slips; rad/s, of the others' turn-over


@pytest.fixture(scope="module")
def soft(tmp_path_factory):
    """An arm whose first joint gives way over four thousandths of a radian, by Dahl's law."""
    folder = tmp_path_factory.mktemp("soft")
    (folder / "robot.yaml").write_text(ARM)
    model = generated.load(str(folder / "robot.yaml"), "A")
    rng = np.random.default_rng(1)
    chi = 0.3 * rng.normal(size=len(model.parameters))
    for k, name in enumerate(model.parameters):
        if name.startswith(("Fv", "Fc", "Iam")):
            chi[k] = 1.0
    for k, seconds in enumerate((20, 12)):
        t, q, dq, ddq = motion(seconds, 500.0, k, 3, 2.0)
        sign = np.tanh(dq / RATE)
        sign[:, 0] = integrate_dahl(q[:, 0], {"width": WIDTH}, 0.0)
        tau = np.asarray(model.torque(q, dq, ddq, chi, sign=sign)) + 0.02 * rng.normal(size=(len(t), 3))
        columns = {"t": t} | {f"q{j + 1}": q[:, j] for j in range(3)}
        write_parquet(
            folder / f"run{k + 1}.parquet", columns | {f"tau_m{j + 1}": tau[:, j] for j in range(3)}
        )
    entries = [{"file": "run1.parquet"}, {"file": "run2.parquet", "use": "validate"}]
    return opened(prepare_study(load_study(write_study(folder, entries, robot="robot.yaml")))).state


def test_travel_that_the_error_shows_is_left_to_the_search(soft):
    assert [d.travels for d in soft.problem.dry] == [False, True, True]
    assert soft.turns[0].travel == 0.0


def test_what_it_leaves_is_there_to_be_found(soft):
    left = [np.std(soft.residual[c][soft.rows.use[c]]) for c in range(3)]
    assert left[0] > 2 * max(left[1:])
