"""Bodies that can exist: exactly the identified parameters where there are such, the nearest ones elsewhere.

Pinocchio and MuJoCo, which know nothing of base parameters, read the written files and compute the torques.
"""

import numpy as np
import pytest
from recordings import motion, write_parquet, write_study

import generated
from ident.estimation.fit import fit_study
from ident.export.bodies import pseudo, unit_density
from ident.export.carried import delays, left_out, parts
from ident.export.combination import ExportError
from ident.export.consistent import consistent
from ident.export.mjcf import write_mjcf
from ident.export.saved import load_fit
from ident.export.urdf import write_urdf
from ident.recordings.study import load_study
from ident.report.files import write_into
from ident.twin.parameters import random_parameters
from modelgen.geometry.robot_file import load_robot

pytestmark = pytest.mark.unexamined

pytest.importorskip("cvxpy", reason="the extra dynident[export] is not installed")
ROBOT = "kuka_lwr4p"


def fit_of_a_real_robot(folder, noise=0.0, flipped=None, spring=0.0, **keys):
    """A kept fit of a robot with bodies that exist; one motor's torque may have the other sign."""
    model = generated.load(ROBOT, "A")
    standard = random_parameters(load_robot(ROBOT), np.random.default_rng(0)).standard
    chi = model.regroup({k: v for k, v in standard.items() if k in model.standard_parameters})
    rng = np.random.default_rng(3)
    for name, seed in (("a", 11), ("b", 12)):
        t, q, dq, ddq = motion(30, 200, seed)
        tau = model.torque(q, dq, ddq, chi) + noise * rng.normal(size=q.shape)
        tau[:, 1] += spring * q[:, 1]
        if flipped is not None:
            tau[:, flipped] *= -1
        columns = {"t": t} | {f"q{j + 1}": q[:, j] for j in range(7)}
        write_parquet(folder / f"{name}.parquet", columns | {f"tau_m{j + 1}": tau[:, j] for j in range(7)})
    entries = [{"file": "a.parquet", "use": "identify"}, {"file": "b.parquet", "use": "validate"}]
    result = fit_study(load_study(write_study(folder, entries, **keys)))
    (folder / "out").mkdir()
    write_into(result, folder / "out", plots=False)
    return load_fit(folder / "out")


@pytest.fixture(scope="module")
def exact(tmp_path_factory):
    fit = fit_of_a_real_robot(tmp_path_factory.mktemp("exact"), reduction=False)
    return fit, consistent(fit, fit.load_robot())


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    fit = fit_of_a_real_robot(tmp_path_factory.mktemp("noisy"), noise=1.0)
    return fit, consistent(fit, fit.load_robot())


def states(n=7, count=40):
    q, dq, ddq = np.random.default_rng(0).uniform(-2, 2, (3, count, n))
    return q, dq + 0.3 * np.sign(dq), ddq  # away from rest, where MuJoCo's dry friction is not yet whole


def drives(found, kind, n=7):
    return np.array([sum(found.value(f"{kind}{side}{j}{r}") for side in "ml" for r in ("", "R"))
                     for j in range(1, n + 1)])  # fmt: skip


def expected(fit, found, q, dq, ddq):
    model = fit.columns.model
    return model.torque(q, dq, ddq, fit.columns.model_chi(found.chi, None))


def physical(found):
    return all(np.linalg.eigvalsh(pseudo(phi))[0] > 0 for phi in found.bodies())


def test_identified_parameters_of_bodies_that_exist_are_met_exactly(exact):
    fit, found = exact
    assert found.exact and physical(found) and not found.findings
    np.testing.assert_allclose(found.combination.G @ found.x, fit.chi, rtol=1e-11, atol=1e-11)


def test_noise_is_met_by_the_nearest_bodies_at_hardly_any_cost(noisy):
    fit, found = noisy
    assert physical(found) and not found.findings
    free, held = (fit.error_percent(chi, "validate")["total"] for chi in (fit.chi, found.chi))
    assert held <= 1.05 * free
    assert 0 <= found.rise_of_physics <= found.rise
    labels = {name: found.label(k) for k, name in enumerate(found.combination.names)}
    assert labels["Fvm3R"] == labels["MY3"] == "measured" if "MY3" in fit.columns.parameters else True
    assert labels["M1"] == labels["MZ1"] == "from the prior"  # no motion shows them


@pytest.mark.parametrize("which", ["exact", "noisy"])
def test_pinocchio_computes_the_same_torque_from_the_urdf(which, request):
    pin = pytest.importorskip("pinocchio")
    fit, found = request.getfixturevalue(which)
    robot = pin.buildModelFromXML(write_urdf(fit.load_robot(), found, "a note -- with dashes"))
    data = robot.createData()
    q, dq, ddq = states()
    tau = np.array([pin.rnea(robot, data, *row) for row in zip(q, dq, ddq)])
    tau += (
        drives(found, "Ia") * ddq + robot.damping * dq + robot.friction * np.sign(dq) + drives(found, "Off")
    )
    scale = np.abs(tau).max()
    np.testing.assert_allclose(tau, expected(fit, found, q, dq, ddq), atol=1e-9 * scale)


def test_mujoco_computes_the_same_torque_from_the_mjcf(noisy):
    mujoco = pytest.importorskip("mujoco")
    fit, found = noisy
    robot = mujoco.MjModel.from_xml_string(write_mjcf(fit.load_robot(), found, "a note"))
    data = mujoco.MjData(robot)
    q, dq, ddq = states()
    tau = []
    for data.qpos[:], data.qvel[:], data.qacc[:] in zip(q, dq, ddq):
        mujoco.mj_inverse(robot, data)
        tau.append(data.qfrc_inverse + drives(found, "Off"))
    np.testing.assert_allclose(tau, expected(fit, found, q, dq, ddq), atol=1e-9 * np.abs(tau).max())


def test_what_a_file_cannot_hold_is_told_with_its_size(noisy):
    fit, found = noisy
    lost = {item.term: item for item in left_out(fit, found, "urdf")}
    assert (
        set(lost) <= {"rotor inertia", "offset"}
        and lost["rotor inertia"].error_without > lost["rotor inertia"].error_with
    )
    assert "rotor inertia" not in {item.term for item in left_out(fit, found, "mjcf")}
    whole = sum(parts(fit, found).values())
    bodies = np.concatenate([found.x[:70], np.zeros(len(found.x) - 70)])
    np.testing.assert_allclose(fit.chi * 0 + found.combination.G @ bodies + whole, found.chi, atol=1e-9)


@pytest.mark.long
def test_an_effect_of_the_study_is_told_with_its_size(tmp_path):
    effects = [{"effect": "spring", "joint": 2}, {"effect": "time_delay", "joint": 3}]
    fit = fit_of_a_real_robot(tmp_path, noise=0.5, spring=30.0, effects=effects)
    found = consistent(fit, fit.load_robot())
    assert physical(found)
    lost = {item.term: item for item in left_out(fit, found, "mjcf")}
    label, late = (term.label for term in fit.terms)
    assert delays(fit) == {2: fit.chi[fit.columns.parameters.index(f"{late}.delay")]}
    assert late not in lost and late in {item.term for item in left_out(fit, found, "urdf")}
    assert lost[label].channel == "tau_m2" and lost[label].error_without > 1.5 * lost[label].error_with
    q = motion(30, 200, 12)[1][:, 1]
    assert lost[label].rms == pytest.approx(30.0 * np.sqrt(np.mean(q**2)), rel=0.3)


@pytest.mark.long
def test_a_torque_of_the_other_sign_is_named(tmp_path):
    fit = fit_of_a_real_robot(tmp_path, noise=0.5, flipped=3)
    found = consistent(fit, fit.load_robot())
    assert physical(found)
    assert any("no physical robot has these parameters together" in finding for finding in found.findings)
    assert all("the sign of a torque" in finding for finding in found.findings)


def test_a_made_prior_has_bodies_that_exist_for_every_built_in_robot():
    for name in ("ur10e", "staubli_tx40", "kuka_lwr4p", "franka_panda"):
        made = unit_density(load_robot(name))
        assert all(np.linalg.eigvalsh(P)[0] > 0 for P in made), name


def test_drives_alone_are_no_robot(tmp_path, kept):
    from dataclasses import replace

    with pytest.raises(ExportError, match="model D has the drives alone"):
        consistent(replace(kept, study=kept.study.with_(model="D")), kept.load_robot())
