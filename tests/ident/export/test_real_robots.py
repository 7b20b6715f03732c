"""Two measured robots: their bodies can exist, at hardly any cost on runs that were not fitted.

The recordings are not in the project; DYNIDENT_DATA or ../shared/data beside it holds them.
"""

import os
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from ident.estimation.fit import fit_study
from ident.export.bodies import pseudo
from ident.export.consistent import consistent
from ident.export.saved import keep, load_fit
from ident.export.urdf import write_urdf
from ident.prediction.prediction import predict
from ident.recordings.study import load_study
from ident.report.files import fit_document, write_document

DATA = Path(os.environ.get("DYNIDENT_DATA") or Path(__file__).parents[4] / "shared" / "data")
pytestmark = [
    pytest.mark.unexamined,
    pytest.mark.real_data,
    pytest.mark.skipif(
        not DATA.is_dir(), reason=f"the recordings are not at {DATA}; set DYNIDENT_DATA to their folder"
    ),
]


@pytest.fixture(scope="module", params=["ur10e", "staubli_tx40"])
def measured(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    result = fit_study(load_study(str(files("ident").joinpath("studies", f"{request.param}.yaml"))))
    write_document(folder / "fit.json", fit_document(result))
    keep(result, folder)
    return load_fit(folder)


def test_bodies_that_can_exist_cost_at_most_a_twentieth(measured):
    pytest.importorskip("cvxpy", reason="the extra dynident[export] is not installed")
    found = consistent(measured, measured.load_robot())
    assert all(np.linalg.eigvalsh(pseudo(phi))[0] > 0 for phi in found.bodies())
    assert not found.findings
    free, held = (measured.error_percent(chi, "validate")["total"] for chi in (measured.chi, found.chi))
    assert held <= 1.05 * free  # 1.014 and 1.018 when this was written
    pin = pytest.importorskip("pinocchio")
    robot = pin.buildModelFromXML(write_urdf(measured.load_robot(), found, "identified"))
    model = measured.columns.model
    chi = found.chi.copy()
    for k, name in enumerate(found.combination.names):
        if name.startswith(("Iam", "Fv", "Fc", "Off", "Iac")):
            chi -= found.combination.G[:, k] * found.x[k]
    q, dq, ddq = np.random.default_rng(0).uniform(-2, 2, (3, 20, model.n))
    tau = np.array([pin.rnea(robot, robot.createData(), *row) for row in zip(q, dq, ddq)])
    bodies = model.torque(q, dq, ddq, measured.columns.model_chi(chi, None))
    np.testing.assert_allclose(tau, bodies, atol=1e-9 * np.abs(tau).max())


def test_a_load_that_no_study_declares_is_pointed_out(measured):
    if measured.columns.model.robot_name != "ur10e":
        pytest.skip("only the UR10e was recorded with a load")
    clean = predict(measured, DATA / "ur10e" / "excite_a_50s.parquet")
    assert not clean.excursions
    loaded = predict(measured, DATA / "ur10e" / "excite_e_50s_load.parquet")
    lasting = {item.channel for item in loaded.excursions if item.kind == "lasting"}
    assert {"tau_m2", "tau_m3", "tau_m4", "tau_m5", "tau_m6"} <= lasting
