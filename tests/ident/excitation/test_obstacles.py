"""Boxes are kept out of, by an arm whose places are its own arithmetic; bodies do not touch, by Pinocchio."""

import sys
from pathlib import Path

import numpy as np
import pytest

from ident.excitation.holding import Holding
from ident.excitation.limits import ExcitationError, bounds_of
from ident.excitation.motion import Basis
from ident.excitation.obstacles import keep_out
from ident.excitation.optimal import optimise
from ident.excitation.self_collision import enclosing, nearest, self_collision
from ident.excitation.urdf_shapes import link_places
from modelgen.effects.frames import frames
from modelgen.geometry.robot_file import load_robot, parse_robot

PLANAR = b"""
name: planar
convention: mdh
gravity: [0, 0, -9.81]
links:
  - {joint: revolute, antecedent: 0, alpha: 0, d: 0, theta: q1, r: 0, limits: {q: [-3, 3], dq: 2, ddq: 8}}
  - {joint: revolute, antecedent: 1, alpha: 0, d: 0.5, theta: q2, r: 0, limits: {q: [-2, 2], dq: 2, ddq: 8}}
"""
TIP = ["tip=2:0.4,0,0"]


@pytest.fixture(scope="module")
def planar():
    return parse_robot(PLANAR, "planar.yaml")


def tip(q):
    """(N, 2) of the planar arm's tip."""
    both = q[:, 0] + q[:, 1]
    return 0.5 * np.stack([np.cos(q[:, 0]), np.sin(q[:, 0])], 1) + 0.4 * np.stack(
        [np.cos(both), np.sin(both)], 1
    )


@pytest.mark.parametrize("seed", range(6))
def test_a_point_is_in_its_box_at_no_sample(planar, seed):
    rng = np.random.default_rng(seed)
    side = rng.uniform(0.2, 0.6)
    low = np.array([rng.uniform(-0.9, 0.3), rng.uniform(-0.9, 0.3), -1])
    high = low + np.array([side, side, 2])
    text = "block=" + ",".join(f"{a}..{b}" for a, b in zip(low, high))
    holding = Holding(bounds_of(planar), robot=planar, keep_out=keep_out(planar, TIP, [text], {}))
    basis = Basis(6.0, 4)
    B = basis.at(basis.grid)[1]

    def swing(x):  # moves as much as it can
        v = B @ x.T
        return -float(np.sum(v**2)), np.stack([-2 * B.T @ v[:, k] for k in range(2)])

    best = optimise(holding, basis, 6.0, swing, seed=seed, starts=1, iterations=20)
    p = tip(best.motion.states(np.arange(0, 6, 1e-3))[0])
    assert not np.any(np.all((low[:2] < p) & (p < high[:2]), axis=1))
    assert swing(best.motion.x)[0] < -10  # and it does move


def test_smooth_clearances_are_below_the_exact_ones_and_their_slopes_are_those_of_differences(planar):
    boxes = ["a=0.1..0.5,0.1..0.4,-1..1", "b=-0.6..-0.2,-1..0,-1..1"]
    its = keep_out(planar, ["tip=2:0.4,0,0", "elbow=2:0,0,0"], boxes, {})
    q = np.random.default_rng(1).uniform(-2, 2, (50, 2))
    value, slope = its.smooth(frames(planar, q))
    exact = its.exact(frames(planar, q))
    assert np.all(value <= exact + 1e-12) and np.all(exact - value < 0.01)
    for k in range(2):
        h = 1e-6 * np.eye(2)[k]
        ends = [its.smooth(frames(planar, q + s * h))[0] for s in (1, -1)]
        np.testing.assert_allclose(slope[:, :, k], (ends[0] - ends[1]) / 2e-6, atol=1e-6)


def test_a_file_says_the_same_as_options(planar, tmp_path):
    file = tmp_path / "cell.yaml"
    file.write_text(
        "points: {tip: {link: link2, at: [0.4, 0, 0]}}\n"
        "keep_out: {block: {low: [0, 0, -1], high: [.inf, 1, 1]}}\n"
    )
    (one,), (other,) = (
        its.pairs
        for its in (
            keep_out(planar, [], [str(file)], {}),
            keep_out(planar, TIP, ["block=0..inf,0..1,-1..1:tip"], {}),
        )
    )
    for a, b in zip(one, other):
        assert a.name == b.name
    np.testing.assert_array_equal(one[0].at, other[0].at)
    np.testing.assert_array_equal(one[1].high, other[1].high)


@pytest.mark.parametrize(
    ("points", "boxes", "told"),
    [
        (["tip"], [], "NAME=LINK"),
        (["tip=9:0,0,0"], [], "no link 9"),
        (["tip=2:0,0"], [], "3 numbers"),
        (TIP, [], "no box"),
        (TIP, ["a=0..1,0..1"], "x..x,y..y,z..z"),
        (TIP, ["a=1..0,0..1,0..1"], "swap"),
        (TIP, ["a=1..1,0..1,0..1"], "not below its upper one; a box is as wide"),
        (TIP, ["a=-inf..inf,-inf..inf,-inf..inf"], "no room outside of it"),
        (TIP, [""], "x..x,y..y,z..z"),
        (TIP, ["a=0..1,0..1,0..1:hand"], "no point hand"),
        (TIP, ["nowhere.yaml"], "cannot be read|no file that can be read"),
        (TIP, ["a=0..1,0..1,0..1", "a=0..1,0..1,0..1"], "twice"),
    ],
)
def test_refusals(planar, points, boxes, told):
    with pytest.raises(ExcitationError, match=told):
        keep_out(planar, points, boxes, {})


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("keep_out:", "holds no box"),
        ("keep_out: {a: {low: [0, 0, 0], high: [1, 1, 1], points: 3}}", "points are a list"),
        ("keep_out: {a: {low: '123', high: '456'}}", "3 numbers"),
        ("keep_out: {a: {low: [0, 0, true], high: [1, 1, 2]}}", "3 numbers"),
    ],
)
def test_refusals_of_files(planar, tmp_path, text, told):
    (tmp_path / "cell.yaml").write_text(text)
    with pytest.raises(ExcitationError, match=told):
        keep_out(planar, [], [str(tmp_path / "cell.yaml")], {})


def test_the_box_that_forbids_is_named(planar):
    boxes = keep_out(planar, TIP, ["cell=-2..2,-2..2,-1..1"], {})
    holding = Holding(bounds_of(planar), robot=planar, keep_out=boxes)
    with pytest.raises(ExcitationError, match="keep-out box cell for the point tip"):
        holding.rest(None, np.random.default_rng(0))
    with pytest.raises(ExcitationError, match="the start is forbidden by the keep-out box cell"):
        holding.rest(np.zeros(2), np.random.default_rng(0))


def test_nearest_points_of_segments():
    rng = np.random.default_rng(2)
    a, b, c, d = rng.normal(size=(4, 40, 3))
    p, q = nearest(a, b, c, d)
    s, t = np.meshgrid(np.linspace(0, 1, 101), np.linspace(0, 1, 101))
    for k in range(40):
        grid = (a[k] + s[..., None] * (b[k] - a[k])) - (c[k] + t[..., None] * (d[k] - c[k]))
        best = np.linalg.norm(grid, axis=-1).min()
        assert best - 0.03 <= np.linalg.norm(p[k] - q[k]) <= best + 1e-12


def test_a_capsule_holds_its_points():
    points = np.random.default_rng(3).normal(size=(200, 3)) * [1, 0.3, 0.2] + [2, 0, 1]
    a, b, r = enclosing(points)
    along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    assert np.linalg.norm(points - a - along[:, None] * (b - a), axis=1).max() <= r * (1 + 1e-9)


@pytest.fixture(scope="module")
def ur5e():
    pytest.importorskip("coal")
    file = Path(pytest.importorskip("airo_models").__file__).parent / "arms" / "ur5e" / "ur5e.urdf"
    robot = load_robot(str(file))
    bounds = bounds_of(robot, ["q=-3..3"])
    return str(file), robot, self_collision(robot, str(file), bounds)


def pinocchio(file):
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromUrdf(file)
    geometry = pin.buildGeomFromUrdf(
        model, file, pin.GeometryType.COLLISION, package_dirs=[str(Path(file).parent)]
    )
    geometry.addAllCollisionPairs()
    for pair in list(geometry.collisionPairs):
        a, b = (geometry.geometryObjects[k].parentJoint for k in (pair.first, pair.second))
        if a == b or model.parents[a] == b or model.parents[b] == a:
            geometry.removeCollisionPair(pair)
    data, made = model.createData(), geometry.createData()
    return lambda q: pin.computeCollisions(model, data, geometry, made, q, True)


def test_what_touches_is_what_pinocchio_says(ur5e):
    """Our hulls hold its meshes: what it finds we find; what we find beyond it is rare."""
    file, _, bodies = ur5e
    collides = pinocchio(file)
    q = np.random.default_rng(4).uniform(-3, 3, (150, 6))
    ours = np.array([bodies.touching(row[None]) is not None for row in q])
    its = np.array([collides(row) for row in q])
    assert its.sum() > 10
    assert np.all(ours[its])
    assert np.mean(ours[~its]) < 0.1


def test_no_sample_of_a_motion_is_left_out(ur5e):
    _, _, bodies = ur5e
    rng = np.random.default_rng(5)
    for _ in range(3):
        ends = rng.uniform(-2.5, 2.5, (2, 6))
        q = ends[0] + np.linspace(0, 1, 120)[:, None] * (ends[1] - ends[0])
        each = [bodies.touching(row[None]) is not None for row in q]
        found = bodies.touching(q)
        assert (found is None) == (not any(each))
        assert found is None or found[0] == each.index(True)


def test_slopes_between_capsules(ur5e):
    _, robot, bodies = ur5e
    assert bodies.smooth_pairs
    q = np.random.default_rng(6).uniform(-2, 2, (20, 6))
    _, slope = bodies.smooth(frames(robot, q))
    for k in range(6):
        h = 1e-6 * np.eye(6)[k]
        ends = [bodies.smooth(frames(robot, q + s * h))[0] for s in (1, -1)]
        difference = (ends[0] - ends[1]) / 2e-6
        close = np.isclose(slope[:, :, k], difference, atol=1e-4)
        assert close.mean() > 0.99  # all but where the nearest point jumps


def test_missing_coal_and_shapes_are_said(monkeypatch, ur5e):
    file, robot, _ = ur5e
    bounds = bounds_of(robot)
    with pytest.raises(ExcitationError, match="is no URDF"):
        self_collision(load_robot("scara"), "scara", bounds_of(load_robot("scara")))
    with pytest.raises(ExcitationError, match="<collision>"):
        self_collision(load_robot("ur5e"), "ur5e", bounds_of(load_robot("ur5e")))
    monkeypatch.setitem(sys.modules, "coal", None)
    with pytest.raises(ExcitationError, match=r"dynident\[collision\]"):
        self_collision(robot, file, bounds)


def test_a_missing_mesh_is_named(tmp_path, ur5e):
    text = Path(ur5e[0]).read_text()
    (tmp_path / "arm.urdf").write_text(text)
    robot = load_robot(str(tmp_path / "arm.urdf"))
    with pytest.raises(ExcitationError, match=r"collision/shoulder.obj of link shoulder_link is not there"):
        self_collision(robot, str(tmp_path / "arm.urdf"), bounds_of(robot))


def test_links_stand_where_pinocchio_has_them(ur5e):
    pin = pytest.importorskip("pinocchio")
    file, robot, _ = ur5e
    model = pin.buildModelFromUrdf(file)
    data = model.createData()
    q = np.random.default_rng(7).uniform(-2, 2, 6)
    pin.framesForwardKinematics(model, data, q)
    f = frames(robot, q[None])
    for name, (row, _R, p) in link_places(file).items():
        ours = p if row < 0 else f.p[0, row] + f.R[0, row] @ p
        its = data.oMf[model.getFrameId(name)].translation
        np.testing.assert_allclose(ours, its, atol=1e-6)  # angles beside pi/2 are taken as pi/2
