"""Compiled models against the plain recursion, Pinocchio, and what users hand in by mistake."""

import pickle

import numpy as np
import pytest
from pinocchio_robot import PinocchioRobot

import generated
from generated import GeneratedError
from modelgen.dynamics.models import MODELS, standard_regressor
from modelgen.geometry.kinematics import geometry, state
from modelgen.geometry.robot_file import built_in_names, load_robot

RTOL = 1e-12  # products of some ten factors, sums of some hundred terms, at 1.1e-16 each


def motion(n, rows, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-3, 3, (rows, n)), rng.uniform(-2, 2, (rows, n)), rng.uniform(-5, 5, (rows, n))


def slow_standard_regressor(robot, model, payload, q, dq, ddq, sign):
    """W_st (N, channels, standard parameters) by the plain recursion on NumPy columns."""
    columns = MODELS[model].standard_parameters(robot, payload)
    found = standard_regressor(
        robot, geometry(robot), MODELS[model], state(robot, q, dq, ddq), tuple(sign.T), columns
    )
    entries = [[np.broadcast_to(np.asarray(e, float), len(q)) for e in found[p.name]] for p in columns]
    return np.array(entries).transpose(2, 1, 0), [p.name for p in columns]


@pytest.mark.parametrize("model", "ABCD")
@pytest.mark.parametrize("payload", [None, "L"])
def test_regressor_and_torque_agree_with_the_plain_recursion(model, payload):
    robot, m = load_robot("kuka_lwr4p"), generated.load("kuka_lwr4p", model, payload=payload)
    q, dq, ddq = motion(7, 61)
    W_standard, names = slow_standard_regressor(robot, model, payload, q, dq, ddq, np.sign(dq))
    assert tuple(names) == m.standard_parameters
    rng = np.random.default_rng(1)
    standard = {name: rng.normal() for name in names}
    tau = W_standard @ np.array([standard[name] for name in names])
    chi, scale = m.regroup(standard), np.abs(tau).max()
    np.testing.assert_allclose(m.regressor(q, dq, ddq) @ chi, tau, rtol=RTOL, atol=RTOL * scale)
    np.testing.assert_allclose(m.torque(q, dq, ddq, chi), tau, rtol=RTOL, atol=RTOL * scale)


@pytest.mark.parametrize("model", "AC")
def test_a_base_column_is_the_standard_column_it_keeps(model):
    robot, m = load_robot("kuka_lwr4p"), generated.load("kuka_lwr4p", model)
    q, dq, ddq = motion(7, 33, seed=2)
    sign = np.tanh(3 * dq)
    W_standard, names = slow_standard_regressor(robot, model, None, q, dq, ddq, sign)
    kept = [names.index(p if p in names else p.removesuffix("R")) for p in m.parameters]
    W = m.regressor(q, dq, ddq, sign=sign)
    expected = W_standard[:, :, kept]
    np.testing.assert_allclose(W, expected, rtol=RTOL, atol=RTOL * np.abs(expected).max())


@pytest.mark.parametrize("name", built_in_names())
def test_built_in_robots_agree_with_pinocchio(name):
    robot, m = load_robot(name), generated.load(name, "B")
    peer = PinocchioRobot(robot)
    q, dq, ddq = motion(robot.n, 5, seed=3)
    rng = np.random.default_rng(4)
    inertial = [p for p in m.standard_parameters if not p.startswith(("F", "O"))]
    standard = {p: rng.normal() for p in inertial}
    by_link = {(int(p.lstrip("XYZM")), p.rstrip("0123456789")): value for p, value in standard.items()}
    tau = np.array([peer.torque(*row, by_link) for row in zip(q, dq, ddq)])
    np.testing.assert_allclose(
        m.torque(q, dq, ddq, m.regroup(standard)), tau, rtol=1e-10, atol=1e-10 * np.abs(tau).max()
    )


def test_the_paper_counts():
    counts = [len(generated.load("kuka_lwr4p", model, payload="L").parameters) for model in "ABCD"]
    assert counts == [79, 74, 102, 28]
    m = generated.load("kuka_lwr4p", "A", payload="L")
    assert m.parameters[-10:] == ("XXL", "XYL", "XZL", "YYL", "YZL", "ZZL", "MXL", "MYL", "MZL", "ML")
    assert generated.load("kuka_lwr4p", "A").channels == tuple(f"tau_m{k}" for k in range(1, 8))


@pytest.mark.parametrize("rows", [0, 1, 7, 8, 9, 255, 256, 257, 2048, 2049, 4500])
@pytest.mark.parametrize("threads", [1, 2])
def test_every_way_gives_the_same_numbers_for_every_remainder(rows, threads):
    m = generated.load("kuka_lwr4p", "A")
    q, dq, ddq = motion(7, rows)
    W = m.regressor(q, dq, ddq)
    assert W.shape == (rows, 7, 69) and W.flags.c_contiguous
    out = np.full_like(W, np.nan)
    assert m.regressor(q, dq, ddq, out, threads=threads) is out
    np.testing.assert_array_equal(out, W)
    seen = 0
    for rows_of, block in m.regressor_blocks(q, dq, ddq):
        assert rows_of.start == seen and block.shape == (rows_of.stop - rows_of.start, 7, 69)
        np.testing.assert_array_equal(block, W[rows_of])
        seen = rows_of.stop
    assert seen == rows
    at = m.nonzeros
    for rows_of, values in m.nonzero_blocks(q, dq, ddq):
        np.testing.assert_array_equal(values, W[rows_of, at[:, 0], at[:, 1]].T)
    mask = np.ones(W.shape[1:], bool)
    mask[at[:, 0], at[:, 1]] = False
    assert not W[:, mask].any()
    chi = np.random.default_rng(0).normal(size=69)
    np.testing.assert_array_equal(m.torque(q, dq, ddq, chi, threads=threads), m.torque(q, dq, ddq, chi))


def test_arrays_of_any_strides_and_kinds():
    m = generated.load("kuka_lwr4p", "B")
    q, dq, ddq = motion(7, 40)
    W = m.regressor(q, dq, ddq)
    wide = np.zeros((80, 21))
    wide[::2, ::3] = q
    for same in (np.asfortranarray(q), wide[::2, ::3], q[::-1].copy()[::-1], q.tolist(), q.astype(object)):
        np.testing.assert_array_equal(m.regressor(same, dq, ddq), W)
    packed = np.zeros(40, dtype=[("pad", "i1"), ("q", "f8", 7)])
    packed["q"] = q
    np.testing.assert_array_equal(m.regressor(packed["q"], dq, ddq), W)
    np.testing.assert_array_equal(m.regressor(q.astype(">f8"), dq, ddq), W)
    short = q.astype(np.float32)
    np.testing.assert_array_equal(m.regressor(short, dq, ddq), m.regressor(short.astype(float), dq, ddq))
    integers = np.ones((40, 7), dtype=int)
    np.testing.assert_array_equal(
        m.torque(q, dq, integers, np.ones(64)), m.torque(q, dq, integers * 1.0, np.ones(64))
    )


@pytest.mark.parametrize("name", ["q", "dq", "ddq", "sign"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("threads", [1, 2])
def test_what_is_not_finite_is_refused_with_its_place(name, value, threads):
    m = generated.load("kuka_lwr4p", "D")  # which does not even read q
    arrays = dict(zip(("q", "dq", "ddq", "sign"), np.random.default_rng(0).normal(size=(4, 3001, 7))))
    chi = np.ones(len(m.parameters))
    arrays[name][2049, 6] = value
    says = rf"{name} holds {value} in row 2049, column 6"
    for evaluate in (
        lambda: m.regressor(**arrays, threads=threads),
        lambda: m.torque(**arrays, chi=chi, threads=threads),
        lambda: list(m.regressor_blocks(**arrays)),
        lambda: list(m.nonzero_blocks(**arrays)),
    ):
        with pytest.raises(GeneratedError, match=says):
            evaluate()
    arrays[name][2049, 6] = 1e300  # large is not infinite
    assert m.regressor(**arrays).shape == (3001, 7, len(m.parameters))


def test_blocks_are_read_only():
    m = generated.load("kuka_lwr4p", "B")
    x = np.ones((600, 7))
    for blocks in (m.regressor_blocks(x, x, x), m.nonzero_blocks(x, x, x)):
        for _, values in blocks:
            with pytest.raises(ValueError, match="read-only"):
                values *= 2.0


def test_out_over_an_input_is_refused():
    m = generated.load("kuka_lwr4p", "B")
    memory = np.zeros(9 * 7 * 64 + 9 * 7)
    out = memory[: 9 * 7 * 64].reshape(9, 7, 64)
    beside, over = memory[9 * 7 * 64 :].reshape(9, 7), memory[100 : 100 + 63].reshape(9, 7)
    x = np.ones((9, 7))
    assert m.regressor(x, beside, x, out) is out
    for arguments in ({"q": over}, {"dq": over}, {"ddq": over}, {"sign": over}):
        with pytest.raises(GeneratedError, match="out lies over an input"):
            m.regressor(**({"q": x, "dq": x, "ddq": x, "out": out} | arguments))


def test_the_coulomb_column_is_the_sign_of_the_rate_or_what_is_given():
    m = generated.load("kuka_lwr4p", "B")
    q, dq, ddq = motion(7, 9)
    dq[0, 0] = 0.0
    column = m.parameters.index("Fcl1")
    np.testing.assert_array_equal(m.regressor(q, dq, ddq)[:, 0, column], np.sign(dq[:, 0]))
    smooth = np.tanh(dq)
    np.testing.assert_array_equal(m.regressor(q, dq, ddq, sign=smooth)[:, 0, column], smooth[:, 0])
    chi = np.zeros(64)
    chi[column] = 2.0
    np.testing.assert_array_equal(m.torque(q, dq, ddq, chi, sign=smooth)[:, 0], 2 * smooth[:, 0])


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"q": np.zeros(7)}, r"q has shape \(7,\); kuka_lwr4p needs \(N, 7\)"),
        ({"q": np.zeros((4, 6))}, r"q has shape \(4, 6\)"),
        ({"dq": np.zeros((3, 7))}, "dq has 3 rows and q has 4"),
        ({"ddq": np.zeros((4, 7), complex)}, "ddq is not an array of real numbers"),
        ({"q": [["a"] * 7] * 4}, "q is not an array of real numbers"),
        ({"q": [[None] * 7] * 4}, "q is not an array of real numbers"),
        ({"q": [[1.0] * 7, [1.0]]}, "q is not an array of real numbers"),
        ({"sign": np.zeros((4, 1))}, "sign has shape"),
        ({"out": np.zeros((4, 7, 63))}, "out is not a writable C-contiguous float64 array"),
        ({"out": np.zeros((4, 7, 64), np.float32)}, "out is not"),
        ({"out": np.zeros((4, 64, 7)).transpose(0, 2, 1)}, "out is not"),
        ({"q": np.ones((4, 7), bool)}, "q is not an array of real numbers"),
        ({"q": np.full((4, 7), "1.5", dtype=object)}, "q is not an array of real numbers"),
        ({"q": np.ma.masked_less(np.arange(28.0).reshape(4, 7), 3)}, "q has masked values"),
        ({"dq": np.zeros((4, 7), "datetime64[s]")}, "dq is not an array of real numbers"),
        ({"extra": [1.0]}, "extra is no mapping"),
        ({"threads": 0}, "threads is 0"),
        ({"threads": 1.5}, "threads is 1.5"),
        ({"extra": {"t": 0.0}}, "extra has t; this model needs none"),
    ],
)
def test_wrong_input_is_refused_in_one_sentence(change, says):
    m = generated.load("kuka_lwr4p", "B")
    arguments = {name: np.zeros((4, 7)) for name in ("q", "dq", "ddq")} | change
    with pytest.raises(GeneratedError, match=says) as refused:
        m.regressor(**arguments)
    assert "\n" not in str(refused.value)


def test_wrong_parameters_and_names_are_refused():
    m = generated.load("kuka_lwr4p", "B")
    x = np.zeros((2, 7))
    with pytest.raises(GeneratedError, match=r"chi has shape \(3,\)"):
        m.torque(x, x, x, np.zeros(3))
    with pytest.raises(GeneratedError, match="no standard parameter Iam1"):
        m.regroup({"Iam1": 1.0})
    for value in (np.nan, np.inf, "0.1", [1.0], None, True):
        with pytest.raises(GeneratedError, match="XX2"):
            m.regroup({"XX2": value})
    with pytest.raises(GeneratedError, match="no mapping"):
        m.regroup([1.0])
    with pytest.raises(GeneratedError, match="chi holds a value of XX2R that is not finite"):
        m.torque(x, x, x, np.where(np.array(m.parameters) == "XX2R", np.nan, 1.0))
    for arguments, says in (
        (("kuka_lwr4p", "E"), "no model 'E'"),
        (("no_such_robot",), "built in are"),
        (("kuka_lwr4p", "A", "LR"), "label"),
        ((3,), "3 is no robot"),
        (("x" * 5000,), r"x \.\.\. is neither a readable robot file"),
        (("kuka_lwr4p", "A", 3), "the payload is 3"),
        (("kuka_lwr4p", "A", None, (3,)), "the effect 3 is no text"),
        (("kuka_lwr4p", "A", None, 3), "the effect 3 is no text"),
        (("",), "'' is no robot"),
    ):
        with pytest.raises(GeneratedError, match=says):
            generated.load(*arguments)
    with pytest.raises(GeneratedError, match="choose 'regressor' or 'torque'"):
        m.casadi("inertia")


def test_casadi_functions_agree():
    m = generated.load("kuka_lwr4p", "C")
    q, dq, ddq = motion(7, 3)
    chi = np.random.default_rng(5).normal(size=len(m.parameters))
    for i in range(3):
        W = np.array(m.casadi("regressor")(q[i], dq[i], ddq[i]).full())
        tau = np.array(m.casadi("torque")(q[i], dq[i], ddq[i], chi).full())[:, 0]
        expected = m.regressor(q, dq, ddq)[i]
        np.testing.assert_allclose(W, expected, rtol=RTOL, atol=RTOL * np.abs(expected).max())
        np.testing.assert_allclose(tau, expected @ chi, rtol=1e-11, atol=1e-11)


def test_effects_bring_their_columns_and_inputs():
    m = generated.load("kuka_lwr4p", "A", effects=("stribeck_friction:2", "offset_drift:3"))
    plain = generated.load("kuka_lwr4p", "A")
    assert m.parameters == (*plain.parameters, "Fs2", "slope3") and m.extra_inputs == ("vs2", "t")
    q, dq, ddq = motion(7, 20)
    t = np.linspace(0, 1, 20)
    W = m.regressor(q, dq, ddq, extra={"vs2": 0.2, "t": t})
    np.testing.assert_array_equal(W[:, :, :69], plain.regressor(q, dq, ddq))
    np.testing.assert_allclose(W[:, 1, 69], np.exp(-((dq[:, 1] / 0.2) ** 2)) * np.sign(dq[:, 1]), rtol=1e-12)
    np.testing.assert_array_equal(W[:, 2, 70], t)
    chi = np.random.default_rng(6).normal(size=71)
    np.testing.assert_allclose(
        m.torque(q, dq, ddq, chi, extra={"vs2": 0.2, "t": t}), W @ chi, rtol=1e-11, atol=1e-11
    )
    with pytest.raises(GeneratedError, match="this model needs vs2, t"):
        m.regressor(q, dq, ddq)


def test_gravity_can_be_replaced_and_survives_a_pickle(tmp_path):
    text = "name: two\nconvention: mdh\ngravity: [0, 0, -9.81]\nlinks:\n"
    text += "  - {joint: revolute, antecedent: 0, alpha: 0.3, d: 0, theta: q1, r: 0}\n"
    text += "  - {joint: revolute, antecedent: 1, alpha: pi/2, d: 0.5, theta: q2, r: 0.1}\n"
    (tmp_path / "two.yaml").write_text(text)
    (tmp_path / "wall.yaml").write_text(text.replace("[0, 0, -9.81]", "[9.81, 0.5, 0]"))
    wall = generated.load(tmp_path / "wall.yaml", "B")
    turned = generated.load(tmp_path / "two.yaml", "B", gravity=np.array([9.81, 0.5, 6e-16]))
    plain = generated.load(tmp_path / "two.yaml", "B")
    assert turned.parameters == wall.parameters
    x = np.random.default_rng(0).normal(size=(3, 9, 2))
    np.testing.assert_array_equal(turned.regressor(*x), wall.regressor(*x))
    assert np.abs(turned.regressor(*x) - plain.regressor(*x)).max() > 0.1
    assert pickle.loads(pickle.dumps(turned)) is turned and turned is not plain
    assert generated.load(tmp_path / "two.yaml", "B", gravity=[9.81, 0.5, 0]) is turned
    peer = PinocchioRobot(load_robot(tmp_path / "wall.yaml"))
    standard = {"XX1": 1.0, "M1": 1.0, "MX2": 0.4, "MY2": -0.7, "M2": 2.0, "ZZ2": 0.3}
    by_link = {(int(p[-1]), p[:-1]): value for p, value in standard.items()}
    expected = [peer.torque(*rows, by_link) for rows in zip(*x)]
    np.testing.assert_allclose(turned.torque(*x, turned.regroup(standard)), expected, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("gravity", [(0, 0), "down", 9.81, (0, 0, np.nan), (0, 0, -9810), (0, 0, "x")])
def test_a_gravity_that_is_none_is_refused(gravity):
    with pytest.raises(GeneratedError, match=r"gravity is .* give three numbers in m/s\^2"):
        generated.load("kuka_lwr4p", "D", gravity=gravity)
