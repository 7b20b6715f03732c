"""Rules of the four models: the paper's counts and names, payloads, order, and torques of Pinocchio."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pinocchio_robot import ORDER, PinocchioRobot
from random_robots import robots

from modelgen.base_parameters.rules import declared_payload, derive_all, derive_rules
from modelgen.dynamics.models import MODELS, standard_regressor
from modelgen.dynamics.newton_euler import INERTIAL
from modelgen.dynamics.standard_parameters import standard_parameters
from modelgen.errors import ModelgenError
from modelgen.geometry.kinematics import geometry, state
from modelgen.geometry.robot_file import load_robot

LWR = load_robot("kuka_lwr4p")


def test_the_paper_s_counts():
    counts = {m: len(r.base) for m, r in derive_all(LWR, declared_payload(LWR)).items()}
    assert counts == {"A": 79, "B": 74, "C": 102, "D": 28}
    counts = {m: len(r.base) for m, r in derive_all(LWR).items()}
    assert counts == {"A": 69, "B": 64, "C": 92, "D": 28}


def test_names_and_order():
    rules = derive_rules(LWR, "A", "L")
    assert rules.parameters[:2] == ("ZZ1R", "XX2R")
    assert rules.parameters[-10:] == tuple(f"{kind}L" for kind in INERTIAL)
    assert {"Fvm1R", "Fcm7R", "Offm4R", "Iam3", "MY7"} <= set(rules.parameters)
    assert rules.unidentifiable == ("XX1", "XY1", "XZ1", "YY1", "YZ1", "MX1", "MY1", "MZ1", "M1", "MZ2", "M2")
    assert rules.channels == tuple(f"tau_m{k}" for k in range(1, 8))
    assert derive_rules(LWR, "C").channels[7:] == tuple(f"tau_l{k}" for k in range(1, 8))
    assert derive_rules(LWR, "D").channels[0] == "tau_d1"


def test_standard_parameters_of_the_paper():
    names = [p.name for p in standard_parameters(LWR)]
    assert len(names) == 17 * 7  # Ns
    assert names[:17] == [
        "Iam1", "Fvm1", "Fcm1", "Offm1", "XX1", "XY1", "XZ1", "YY1", "YZ1", "ZZ1",
        "MX1", "MY1", "MZ1", "M1", "Fvl1", "Fcl1", "Offl1",
    ]  # fmt: skip
    units = {p.kind: p.unit for p in standard_parameters(LWR)}
    assert units["ZZ"] == "kg m^2" and units["MX"] == "kg m" and units["M"] == "kg"
    assert units["Iam"] == "kg m^2" and units["Fvl"] == "N m s/rad" and units["Offm"] == "N m"


@settings(max_examples=25, deadline=None, derandomize=True)
@given(robots(6), st.sampled_from("ABCD"), st.sampled_from([None, "L"]), st.integers(0, 99))
def test_base_parameters_give_the_torques_of_standard_parameters(robot, model, payload, seed):
    """W_st chi_st = W chi in floats, and its rigid part is Pinocchio's RNEA."""
    rng = np.random.default_rng(seed)
    q, dq, ddq = rng.uniform(-2, 2, (3, robot.n))
    rules = derive_rules(robot, model, payload)
    chi_st = {p.name: rng.normal() for p in rules.standard}
    W = standard_regressor(
        robot, geometry(robot), MODELS[model], state(robot, q, dq, ddq), np.sign(dq), rules.standard
    )
    tau = sum(chi_st[name] * np.array(column, dtype=float) for name, column in W.items())
    base = np.zeros(len(rules.channels))
    for b in rules.base:
        value = sum(float(robot.value(c)) * chi_st[name] for name, c in b.combination.items())
        base += value * np.array(W[b.keeps.name], dtype=float)
    np.testing.assert_allclose(base, tau, rtol=1e-9, atol=1e-8)
    if model == "B":
        bodies = {(p.row, p.kind): 0.0 for p in rules.standard if p.kind in INERTIAL}
        for p in rules.standard:
            if p.kind in INERTIAL:
                bodies[p.row, p.kind] += chi_st[p.name]
        friction = [
            chi_st[f"Fvl{k}"] * v + chi_st[f"Fcl{k}"] * np.sign(v) + chi_st[f"Offl{k}"]
            for k, v in zip(robot.joint_labels, dq, strict=True)
        ]
        rigid = PinocchioRobot(robot).torque(q, dq, ddq, bodies)
        np.testing.assert_allclose(tau, rigid + friction, rtol=1e-9, atol=1e-8)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(robots(5), st.integers(0, 99))
def test_payload_parameters_are_those_that_loaded_runs_can_show(robot, seed):
    """Their number is the rank of the carrying link's ten columns, from Pinocchio."""
    rng = np.random.default_rng(seed)
    independent, row = PinocchioRobot(robot), len(robot.links)
    blocks = []
    for _ in range(30):
        columns = independent.regressor(*rng.uniform(-2, 2, (3, robot.n)))
        blocks.append(np.column_stack([columns[row, kind] for kind in ORDER]))
    W = np.vstack(blocks)
    shown = [b for b in derive_rules(robot, "B", "L").base if b.keeps.payload]
    assert len(shown) == (np.linalg.matrix_rank(W, tol=1e-9 * np.linalg.norm(W)) if W.any() else 0)


def test_refusals():
    with pytest.raises(ModelgenError, match="choose A, B, C or D"):
        derive_rules(LWR, "E")
    for label in ("", "1", "LR", "L L", "../x"):
        with pytest.raises(ModelgenError, match="rename"):
            derive_rules(LWR, "A", label)
