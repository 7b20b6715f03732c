"""What judged rows cannot show: a law of friction at speeds that the judging run does not reach."""

import numpy as np
import pytest
from recordings import motion, write_parquet, write_study
from small_arm import ARM

import generated
from ident.diagnosis import diagnose_study
from ident.recordings.study import load_study

RATE_HZ = 200.0
RUNS = (("identify", 20, 2.0), ("identify", 20, 1.7), ("validate", 20, 0.35))  # use, s, speed


@pytest.fixture
def slowly_judged(tmp_path):
    """Diagnose two fast runs and a slow one that judges, with this more torque (N,) of q, dq on joint 2."""

    def diagnosed(law):
        (tmp_path / "robot.yaml").write_text(ARM)
        model = generated.load(str(tmp_path / "robot.yaml"), "A")
        rng = np.random.default_rng(4)
        chi = 0.3 * rng.normal(size=len(model.parameters))
        for k, name in enumerate(model.parameters):
            if name.startswith(("Fv", "Fc", "Iam")):
                chi[k] = 1.0
        entries = []
        for k, (use, seconds, speed) in enumerate(RUNS):
            t, q, dq, ddq = motion(seconds, RATE_HZ, k, 3, speed)
            tau = np.asarray(model.torque(q, dq, ddq, chi)) + 0.05 * rng.normal(size=(len(t), 3))
            tau[:, 1] += law(q[:, 1], dq[:, 1])
            columns = {"t": t} | {f"q{j + 1}": q[:, j] for j in range(3)}
            columns |= {f"tau_m{j + 1}": tau[:, j] for j in range(3)}
            write_parquet(tmp_path / f"run{k}.parquet", columns)
            entries.append({"file": f"run{k}.parquet", "use": use})
        return diagnose_study(load_study(write_study(tmp_path, entries, robot="robot.yaml")))

    return diagnosed


@pytest.mark.long
def test_a_law_that_fast_runs_show_and_a_slow_one_cannot(slowly_judged):
    told = slowly_judged(lambda q, dq: -0.03 * dq**3)
    assert [(f.effect, f.joints) for f in told.findings] == [("nonlinear_viscous_friction", (2,))]
    assert told.findings[0].parameters["Fv3"]["value"] == pytest.approx(-0.03, rel=0.1)
    error = [fit.full_rate_error["validate"]["tau_m2"] for fit in (told.first, told.last)]
    assert error[1] < error[0] and told.findings[0].error_drop_percent < 100


@pytest.mark.long
def test_what_only_looks_like_one_in_them_is_not_named(slowly_judged):
    """A wave over the rate: no law of the catalogue says what it does, and none is told."""
    told = slowly_judged(lambda q, dq: 0.5 * np.sin(4.0 * dq))
    assert not told.findings and told.verdict == "unexplained"
