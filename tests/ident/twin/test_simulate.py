"""The twin: its torques are Pinocchio's, its effects act where they should, its seeds repeat."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from scipy.integrate import solve_ivp

import generated
from ident.errors import IdentError
from ident.twin import PlannedRun, Sensors, simulate, write_simulation
from ident.twin.parameters import random_parameters
from ident.twin.requests import parse_effect
from ident.twin.sizing import activate
from ident.twin.trajectories import fourier, reach
from ident.twin.twin import make_twin, run_twin
from modelgen.effects import Place, catalogue, effect
from modelgen.errors import ModelgenError
from modelgen.geometry.robot_file import load_robot

SHORT = (
    PlannedRun("run1", "identify", 8.0, 4),
    PlannedRun("run2", "identify", 12.0),
    PlannedRun("run3", "test", 8.0),
)
EXACT = Sensors(noise_percent=0.0, noise_floor=0.0, encoder_step=1e-9, torque_step=1e-9)
TERMS = ("coulomb_friction", "viscous_friction", "offset", "rotor_inertia")  # hidden by leaving them out


def table(recording, robot, name):
    return np.stack([recording.columns[f"{name}{k}"] for k in robot.joint_labels], axis=1)


def test_true_torques_are_pinocchios():
    """A random UR10e, eq. (1) and (2): bodies by Pinocchio, drives and friction written out here."""
    pytest.importorskip("pinocchio")
    from pinocchio_robot import PinocchioRobot

    robot = load_robot("ur10e")
    p = dict(random_parameters(robot, np.random.default_rng(2)).standard)
    twin = make_twin(robot, "ur10e", p)
    t = np.arange(0, 6, 0.1)
    q, dq, ddq = fourier(reach(robot), 6.0, np.random.default_rng(3)).at(t)
    run = run_twin(twin, t, (q, dq, ddq))
    bodies = {
        (j, kind): p[f"{kind}{j}"]
        for j in range(1, 7)
        for kind in ("M", "MX", "MY", "MZ", "XX", "XY", "XZ", "YY", "YZ", "ZZ")
    }
    other = PinocchioRobot(robot)
    rigid = np.array([other.torque(*state, bodies) for state in zip(q, dq, ddq)])

    def friction(side):
        Fv, Fc, Off = (
            np.array([p[f"{kind}{side}{k}"] for k in robot.joint_labels]) for kind in ("Fv", "Fc", "Off")
        )
        return Fv * dq + Fc * np.sign(dq) + Off

    Iam = np.array([p[f"Iam{k}"] for k in robot.joint_labels])
    assert run.tau_l == pytest.approx(rigid + friction("l"), abs=1e-9)
    assert run.tau_m == pytest.approx(rigid + friction("l") + friction("m") + Iam * ddq, abs=1e-9)


def test_seeds_repeat_bit_for_bit(tmp_path):
    one, two, other = (
        simulate("kuka_lwr4p", "C", ("hysteresis:2",), 4.6136, seed=s, runs=SHORT[:2]) for s in (5, 5, 6)
    )
    for a, b, c in zip(one.recordings, two.recordings, other.recordings):
        assert all(np.array_equal(a.columns[name], b.columns[name]) for name in a.columns)
        assert not np.array_equal(a.columns["q1"], c.columns["q1"])
    assert json.dumps(one.truth) == json.dumps(two.truth)
    for name, simulated in (("a", one), ("b", two)):
        write_simulation(simulated, tmp_path / name)
    for file in ("run1.parquet", "study.yaml", "truth.json"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_the_study_does_not_tell_what_is_hidden(tmp_path):
    hidden = ("stribeck_friction:4", "payload_change::m=1.2,recording=run2")
    write_simulation(simulate("kuka_lwr4p", effects=hidden), tmp_path / "twin")
    text = (tmp_path / "twin" / "study.yaml").read_text()
    assert not any(word in text for word in ("stribeck", "payload", "truth", "effect"))
    study = yaml.safe_load(text)
    assert [entry["use"] for entry in study["recordings"]] == ["identify", "identify", "validate", "test"]
    truth = json.loads((tmp_path / "twin" / "truth.json").read_text())
    assert [e["effect"] for e in truth["effects"]] == ["stribeck_friction", "payload_change"]
    run = pq.read_table(tmp_path / "twin" / "run1.parquet")
    assert run.column_names == ["t", *(f"q{k}" for k in range(1, 8)), *(f"tau_m{k}" for k in range(1, 8))]
    assert run.num_rows == 90001


def test_study_of_a_robot_file_is_complete_in_its_folder(tmp_path):
    from ident.recordings.study import load_study

    (tmp_path / "arm.yaml").write_text(
        "name: arm\nconvention: mdh\ngravity: [0, 0, -9.81]\nlinks:\n"
        "  - {joint: revolute, antecedent: 0, alpha: pi/2, d: 0, theta: q1, r: 0}\n"
        "  - {joint: prismatic, antecedent: 1, alpha: pi/2, d: 0.2, theta: 0, r: q2 + 0.3}\n"
    )
    simulated = simulate(tmp_path / "arm.yaml", "C", ("spring:1",), 1.0, runs=SHORT[:2])
    study = load_study(write_simulation(simulated, tmp_path / "twin"))
    assert generated.load(study.robot_source, "A").n == 2
    assert all(study.recording_path(entry).is_file() for entry in study.recordings)
    assert list(simulated.recordings[0].columns) == ["t", "q1", "q2", "tau_m1", "tau_m2", "tau_l1", "tau_l2"]


@pytest.mark.parametrize("name", sorted(set(catalogue()) - set(TERMS)))
def test_every_effect_of_the_catalogue_can_be_simulated(name):
    """And acts: on its joint's channel, by an amount that the study's model cannot absorb."""
    e = effect(name)
    model = "C" if e.channel == "sensor" else "A"
    text = name if e.joints == "robot" or e.shared else f"{name}:2"
    robot = load_robot("kuka_lwr4p")
    free, hidden = (
        simulate("kuka_lwr4p", model, x, seed=1, sensors=EXACT, runs=SHORT[:2]) for x in ((), (text,))
    )
    (told,) = hidden.truth["effects"]
    assert told["effect"] == name and told["joints"] == ([] if ":" not in text else [2])
    if e.size_names:  # aimed at 3 to 10, less where the model absorbs most
        assert 0.3 < told["visible_percent"] < 13
    assert {q.name for q in e.quantities} <= set(told["parameters"])
    channel = "tau_l" if e.channel == "sensor" else "tau_m"
    added = table(hidden.recordings[1], robot, channel) - table(free.recordings[1], robot, channel)
    if "encoder" in e.stages(Place(1, side="link")):
        added = table(hidden.recordings[1], robot, "q") - table(free.recordings[1], robot, "q")
    assert np.abs(added[:, 1]).max() > 0
    if e.kind == "column":
        assert not np.delete(added, 1, axis=1).any()
    if e.windowed:
        first = table(hidden.recordings[0], robot, channel) - table(free.recordings[0], robot, channel)
        begins = 0.0 if e.all_along else told["parameters"]["from"]
        assert not first.any() and not added[: int(1000 * begins)].any()


@pytest.mark.parametrize("name", TERMS)
def test_terms_of_the_model_are_left_out_of_the_study(name):
    parameter = {"coulomb_friction": "Fc", "viscous_friction": "Fv", "offset": "off", "rotor_inertia": "Ia"}[
        name
    ]
    simulated = simulate("kuka_lwr4p", "A", (f"{name}:3:{parameter}=2.5",), runs=SHORT[:1])
    assert simulated.study["without"] == [f"{name}:3"]
    (told,) = simulated.truth["effects"]
    assert told["joints"] == [3] and told["parameters"] == {parameter: 2.5}


def test_an_elastic_joint_obeys_its_own_differential_equation():
    """Forward in time: the link of a one-joint arm, driven through the spring by the recorded motor.

    I ddq_l = k (q_m - q_l) - (gravity + viscous friction of the link), integrated with a step control of
    1e-10. The twin goes the other way, from the link to the motor; its 6 ms filter on the spring's torque is
    what is left (and excites the joint's own vibration, hence the damping of the comparison's link).
    """
    robot = load_robot_text()
    standard = {"ZZ1": 0.8, "MX1": 1.5, "Iam1": 0.3, "Fvm1": 1.0, "Fvl1": 0.5}
    twin = make_twin(robot, ARM, standard)
    motion = fourier(reach(robot), 10.0, np.random.default_rng(0))
    request = parse_effect("joint_elasticity:1:k=400", robot)
    e = activate(request, twin, "A", {"run1": motion})
    t = np.arange(0, 10, 1e-3)
    run = run_twin(twin, t, motion.at(t), (e,))
    gravity = 1.5 * 9.81

    def link(now, y):
        q_m = np.interp(now, t, run.q[:, 0])
        return [y[1], (400 * (q_m - y[0]) - gravity * np.cos(y[0]) - 0.5 * y[1]) / 0.8]

    start = [run.q_link[0, 0], 0.0]
    solved = solve_ivp(link, (0, t[-1]), start, t_eval=t, rtol=1e-8, atol=1e-10, max_step=2e-3)
    wind_up = np.abs(run.q - run.q_link).max()
    assert wind_up > 0.02
    assert np.abs(solved.y[0] - run.q_link[:, 0]).max() < 0.02 * wind_up
    spring = 400 * (run.q - run.q_link)[:, 0]
    assert np.abs(spring - run.tau_l[:, 0]).max() < 0.02 * np.abs(run.tau_l).max()


def test_hysteresis_replaces_the_joints_own_dry_friction():
    """Dahl's friction less no dry friction at all: inside [-Fc, Fc], and Fc after a long slide."""
    robot = load_robot("kuka_lwr4p")
    standard = {"Fcm2": 8.0, "Iam2": 1.0}
    motion = fourier(reach(robot), 20.0, np.random.default_rng(0))
    e = activate(
        parse_effect("hysteresis:2:sigma=200", robot),
        make_twin(robot, "kuka_lwr4p", standard),
        "A",
        {"run1": motion},
    )
    assert e.reported == {"sigma": 200.0, "Fc": 8.0}
    t = np.arange(0, 20, 1e-3)
    with_dahl = run_twin(make_twin(robot, "kuka_lwr4p", standard), t, motion.at(t), (e,))
    without = run_twin(make_twin(robot, "kuka_lwr4p", {"Iam2": 1.0}), t, motion.at(t))
    F = (with_dahl.tau_m - without.tau_m)[:, 1]
    assert np.abs(F).max() <= 8.0 + 1e-9 and np.abs(F).max() > 7.9
    dF, dq = np.diff(F), np.diff(motion.at(t)[0][:, 1])
    moving = np.abs(dq) > 1e-6
    assert (
        np.abs(dF[moving] / dq[moving]).max() < 2.02 * 200.0
    )  # Dahl: at most 2 sigma, just after a reversal


@pytest.mark.parametrize(
    "arguments, told",
    [
        ({"model": "E"}, "there is no such model"),
        ({"payload_kg": -1.0}, "a mass is positive"),
        ({"seed": -1}, "a seed is not negative"),
        (
            {"effects": ("sensor_crosstalk:2",)},
            "sensor_crosstalk does not show in the torques of model A; use --model B or C",
        ),
        ({"effects": ("payload_change::recording=run9",)}, "there is no run9"),
        ({"effects": ("payload_change::from=50",)}, "is no window of run2, which lasts 12 s"),
        ({"effects": ("stribeck_friction:2:Fs=-1",)}, "Fs would be negative"),
        (
            {"effects": ("cable_coupling:3:source_joint=2,k_cross=5,k_own=2,k_source=3",)},
            "k_own k_source has to be k_cross",
        ),
        ({"effects": ("joint_elasticity:2:k=0",)}, "values other than zero"),
        ({"effects": ("joint_elasticity:2",), "model": "D"}, "does not show in the torques of model D"),
        ({"effects": ("rotor_inertia:2",), "model": "B"}, "model B does not see rotor_inertia"),
    ],
)
def test_what_cannot_be_simulated_is_told(arguments, told):
    with pytest.raises((IdentError, ModelgenError), match=told):
        simulate("kuka_lwr4p", runs=SHORT, **arguments)


ARM = ""


def load_robot_text():
    return load_robot(ARM)


@pytest.fixture(autouse=True, scope="module")
def _one_joint_arm(tmp_path_factory):
    global ARM
    file = tmp_path_factory.mktemp("arm") / "pendulum.yaml"
    file.write_text(
        "name: pendulum\nconvention: mdh\ngravity: [0, 0, -9.81]\nlinks:\n"
        "  - {joint: revolute, antecedent: 0, alpha: pi/2, d: 0, theta: q1, r: 0}\n"
    )
    ARM = str(file)
