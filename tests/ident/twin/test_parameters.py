"""Parameters of a twin: the paper's, those of a file, and random ones that can exist."""

import numpy as np
import pytest

import generated
from ident.twin.parameters import (
    ParameterError,
    payload_body,
    random_parameters,
    read_parameters,
    standard_name,
    twin_parameters,
)
from modelgen.geometry.robot_file import load_robot

LWR = load_robot("kuka_lwr4p")
# Table II, model C: some of the values that model A cannot separate
TABLE_II = {
    "Iam1": 3.19,
    "Fvm2": 15.1,
    "Fcm7": 5.91,
    "Fcl5": 0.935,
    "ZZ2R": 1.28,
    "MY4R": -1.35,
    "MY7": 0.006,
}


def pseudo_inertia(p, row):
    v = {name: p[f"{name}{row}"] for name in ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")}
    inertia = np.array(
        [[v["XX"], v["XY"], v["XZ"]], [v["XY"], v["YY"], v["YZ"]], [v["XZ"], v["YZ"], v["ZZ"]]]
    )
    first = np.array([[v["MX"], v["MY"], v["MZ"]]])
    return np.block([[np.trace(inertia) / 2 * np.eye(3) - inertia, first.T], [first, np.array([[v["M"]]])]])


def test_the_default_lwr_is_the_papers_table():
    parameters = twin_parameters(LWR, None, seed=0)
    model = generated.load("kuka_lwr4p", "C")
    chi = dict(zip(model.parameters, model.regroup(parameters.standard)))
    for name, value in TABLE_II.items():
        assert chi[name] == pytest.approx(value), name
    assert chi["ZZ1R"] == 0.0  # not significant in the paper
    assert parameters.payload["M"] == 4.6136
    assert sum(value != 0 for value in chi.values()) == 36  # 44 of the table less 8 of the payload


@pytest.mark.parametrize("name", ["ur10e", "franka_panda", "kuka_kr300", "staubli_tx40"])
def test_random_robots_can_exist(name):
    robot = load_robot(name)
    for seed in range(3):
        p = random_parameters(robot, np.random.default_rng(seed)).standard
        for row in range(1, len(robot.links) + 1):
            assert np.linalg.eigvalsh(pseudo_inertia(p, row)).min() > 0
        assert all(p[f"{kind}{k}"] > 0 for kind in ("Iam", "Fvm", "Fcm") for k in robot.joint_labels)


def test_payload_is_scaled_or_a_ball():
    own = twin_parameters(LWR, None, 0).payload
    assert payload_body(2.3068, own)["MX"] == pytest.approx(0.139)
    ball = payload_body(2.0, None)
    assert (
        ball["M"] == 2.0
        and np.linalg.eigvalsh(pseudo_inertia({f"{k}8": v for k, v in ball.items()}, 8)).min() > 0
    )


def test_a_name_is_standard_or_base():
    assert standard_name("MY2R", LWR) == "MY2" and standard_name("Fcl7", LWR) == "Fcl7"
    assert standard_name("M8", LWR) is None and standard_name("mass", LWR) is None


@pytest.mark.parametrize(
    "text, told",
    [
        ("parameters: {Iam9: 1}", "Iam9 is no parameter of kuka_lwr4p"),
        ("parameters: {Iam1: heavy}", "'heavy' is not a number"),
        ("parameters: {MY2: 1, MY2R: 2}", "both set MY2"),
        ("parameters: [", "not valid YAML"),
        ("just words", "holds no parameters"),
        ("payload: {mass: 3}", "mass is not one of"),
    ],
)
def test_bad_files_are_refused(text, told):
    with pytest.raises(ParameterError, match=told):
        read_parameters(text, LWR, "mine.yaml")
