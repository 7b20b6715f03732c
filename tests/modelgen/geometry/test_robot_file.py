"""Robot files: what they mean, and one sentence with exit status 2 for each way of being wrong."""

import contextlib
import copy
import json
import os

import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from modelgen import cli
from modelgen.errors import RobotFileError
from modelgen.geometry.robot_file import built_in_names, load_robot, parse_robot

GOOD = {
    "name": "arm",
    "convention": "mdh",
    "gravity": [0, 0, -9.81],
    "constants": {"rl3": 0.4},
    "links": [
        {"joint": "revolute", "antecedent": 0, "alpha": 0, "d": 0, "theta": "q1", "r": 0},
        {"joint": "revolute", "antecedent": 1, "alpha": "pi/2", "d": 0, "theta": "q2 - pi/2", "r": 0},
        {"joint": "prismatic", "antecedent": 2, "alpha": "-pi/2", "d": 0, "theta": 0, "r": "q3 + rl3"},
        {"joint": "fixed", "antecedent": 3, "alpha": 0, "d": 0, "theta": 0, "r": 0.1},
    ],
}


def changed(path: str, value: object) -> str:
    """GOOD with one value replaced ("links.1.alpha"), or removed where value is Ellipsis, as text."""
    table = copy.deepcopy(GOOD)
    *way, last = path.split(".")
    place = table
    for key in way:
        place = place[int(key)] if isinstance(place, list) else place[key]
    last = int(last) if isinstance(place, list) else last
    if value is ...:
        del place[last]
    else:
        place[last] = value
    return json.dumps(table)


def test_the_contract_s_example_is_read():
    robot = parse_robot(json.dumps(GOOD))
    assert robot.n == 3 and robot.variables == ("q1", "q2", "q3") and robot.moving == (1, 2, 3)
    assert [link.sigma for link in robot.links] == [0, 0, 1, 2]
    assert robot.link(2).theta == -sp.pi / 2 and robot.link(2).alpha == sp.pi / 2
    assert robot.link(3).r == sp.Symbol("rl3", real=True) and robot.value(robot.link(3).r) == sp.Rational(
        2, 5
    )
    assert robot.link(4).r == sp.Rational(1, 10) and robot.link(4).variable is None
    assert robot.ancestors(4) == (4, 3, 2, 1)
    assert robot.payload_link("L") == 4  # the last link, unless the file says otherwise


def test_built_in_robots():
    assert set(built_in_names()) >= {
        "franka_panda",
        "kuka_kr300",
        "kuka_lwr4p",
        "kuka_lwr4p_ros",
        "rokae_xmate3pro",
        "staubli_tx40",
        "ur10e",
        "ur5e",
        "kuka_iiwa7",
        "scara",
        "two_armed_torso",
    }
    for name in built_in_names():
        robot = load_robot(name)
        assert robot.name == name and robot.n in (4, 6, 7) and len(robot.source_sha256) == 64
        assert robot.remarks == ()
    lwr = load_robot("kuka_lwr4p")
    assert lwr.payloads == {"L": 7} and lwr.constants == {
        "rl3": sp.Rational(2, 5),
        "rl5": sp.Rational(39, 100),
    }


@pytest.mark.parametrize("numbering", ["rows", "order"])
def test_a_joint_behind_a_fixed_link_is_numbered_by_row_or_by_order(numbering):
    table = copy.deepcopy(GOOD)
    last = "q5" if numbering == "rows" else "q4"
    table["links"].append({"joint": "revolute", "antecedent": 4, "alpha": 0, "d": 0, "theta": last, "r": 0})
    robot = parse_robot(json.dumps(table))
    assert robot.moving == (1, 2, 3, 5) and robot.variables[-1] == last


LAUGHS = (
    "a: &a [x, x]\n"
    + "\n".join(f"{y}: &{y} [*{x}, *{x}]" for x, y in zip("abcdefgh", "bcdefghi", strict=True))
    + "\nname: *i\n"
)
BAD = {
    "10,000 whole links": (changed("links", GOOD["links"][:1] * 10000), "at most 64 links"),
    "missing key": (changed("gravity", ...), "gravity"),
    "missing link key": (changed("links.1.alpha", ...), "alpha"),
    "unknown key": (changed("gravitas", [0, 0, 0]), "did you mean gravity"),
    "unknown link key": (changed("links.0.alhpa", 0), "did you mean alpha"),
    "wrong convention": (changed("convention", "dh"), "mdh"),
    "cycle": (changed("links.1.antecedent", 3), "cycle"),
    "own antecedent": (changed("links.1.antecedent", 2), "cycle"),
    "antecedent out of range": (changed("links.1.antecedent", 9), "antecedent"),
    "antecedent not a number": (changed("links.1.antecedent", "base"), "antecedent"),
    "antecedent true": (changed("links.1.antecedent", True), "antecedent"),
    "unknown symbol": (changed("links.2.r", "q3 + rl4"), "rl4"),
    "code": (changed("links.0.d", "__import__('os').system('true')"), "arithmetic"),
    "huge power": (changed("links.0.d", "9**9**9"), "power"),
    "NaN length": (changed("links.0.d", float("nan")).replace("NaN", ".nan"), "finite"),
    "infinite constant": (changed("constants.rl3", float("inf")).replace("Infinity", ".inf"), "finite"),
    "division by a constant that is zero": (
        changed("links.2.r", "q3 + 1/rl3").replace("0.4", "0.0"),
        "not a finite number",
    ),
    "gravity divided by zero": (changed("gravity", [0, 0, "1/rl3"]).replace("0.4", "0.0"), "gravity"),
    "constant is a list": (changed("constants.rl3", [1]), "rl3"),
    "constant named like a joint": (changed("constants", {"q1": 1, "rl3": 1}), "q1"),
    "constant named like a parameter": (changed("constants", {"MX2": 1, "rl3": 1}), "MX2"),
    "constant that is no name": (changed("constants", {"r l": 1, "rl3": 1}), "identifier"),
    "10,000 links": (changed("links", [{}] * 10000), "10000 links"),
    "no links": (changed("links", []), "links"),
    "only fixed links": (changed("links", [{**GOOD["links"][3], "antecedent": 0}]), "no moving joint"),
    "link is a number": (changed("links.1", 3), "link 2"),
    "duplicate names": (
        changed("links.0.name", "link2"),
        "both named link2",
    ),
    "joint variable twice": (changed("links.1.theta", "q1"), "q1"),
    "joint variable skipped": (changed("links.2.r", "q4"), "number them q1, q2, q3"),
    "joint variable in the wrong key": (changed("links.0.d", "q1"), "only theta"),
    "joint variable on a fixed link": (changed("links.3.r", "q4"), "fixed"),
    "no joint variable": (changed("links.0.theta", 0), "write theta: q1"),
    "reversed joint variable": (changed("links.0.theta", "-q1"), "plus a constant"),
    "scaled joint variable": (changed("links.0.theta", "2*q1"), "plus a constant"),
    "two joint variables": (changed("links.0.theta", "q1 + q2"), "2 joint variables"),
    "unknown joint": (changed("links.0.joint", "spherical"), "revolute, prismatic or fixed"),
    "gravity of two": (changed("gravity", [0, -9.81]), "three numbers"),
    "gravity of words": (changed("gravity", [0, 0, "down"]), "gravity"),
    "name with a slash": (changed("name", "../arm"), "name"),
    "payload nowhere": (changed("payloads", {"L": 8}), "link 8"),
    "payload named badly": (changed("payloads", {"1": 2}), "rename"),
    "limits upside down": (changed("links.0.limits", [1, -1]), "below"),
    "limits of words": (changed("links.0.limits", {"q": "wide"}), "limits"),
    "billion laughs": (LAUGHS, "aliases"),
    "duplicate key": ("name: a\nname: b\n", "twice"),
    "a list as key": ("[1, 2]: 3\n", "YAML"),
    "a number beyond reason": (f"name: {'9' * 5000}\n", "YAML"),
    "python object": ("!!python/object/apply:os.system ['true']", "YAML"),
    "broken YAML": ("name: [unclosed", "YAML"),
    "a list": ("- 1\n- 2\n", "mapping"),
    "empty": ("", "mapping"),
    "deep nesting": ("[" * 5000, "nested"),
    "not text": (b"\xff\xfe\x00", "UTF-8"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_is_refused_in_one_sentence(case):
    text, hint = BAD[case]
    with pytest.raises(RobotFileError) as error:
        parse_robot(text, "arm.yaml")
    message = str(error.value)
    assert message.startswith("arm.yaml: ") and hint in message and "\n" not in message and len(message) < 300


@pytest.mark.parametrize("case", ["cycle", "code", "billion laughs", "NaN length", "10,000 links"])
def test_the_command_says_so_and_leaves_with_2(case, tmp_path, monkeypatch, capsys):
    path = tmp_path / "arm.yaml"
    path.write_text(BAD[case][0])
    monkeypatch.setattr("sys.argv", ["regenerate-model", str(path), "--rules-only"])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    out, err = capsys.readouterr()
    assert stopped.value.code == 2 and not out
    assert err.count("\n") == 1 and BAD[case][1] in err and "Traceback" not in err


def test_a_missing_file_suggests_the_robot_that_was_meant(tmp_path):
    with pytest.raises(RobotFileError, match="did you mean kuka_lwr4p"):
        load_robot("kuka_lwr4")
    with pytest.raises(RobotFileError, match="built-in robots are"):
        load_robot(tmp_path / "zzz.yaml")
    with pytest.raises(RobotFileError, match="is a folder"):
        load_robot(tmp_path)
    large = tmp_path / "large.yaml"
    large.write_bytes(b"# " + b"x" * 300_000)
    with pytest.raises(RobotFileError, match="at most 64 links"):
        load_robot(large)


def test_an_angle_beside_a_right_angle_is_remarked():
    robot = parse_robot(changed("links.1.alpha", 1.5708))
    assert len(robot.remarks) == 1 and "link 2, alpha is not exactly pi/2" in robot.remarks[0]
    assert parse_robot(json.dumps(GOOD)).remarks == ()
    assert parse_robot(changed("links.1.alpha", 0.3)).remarks == ()


def test_line_endings_do_not_change_the_robot_s_hash():
    text = json.dumps(GOOD, indent=1)
    assert parse_robot(text).source_sha256 == parse_robot(text.replace("\n", "\r\n")).source_sha256


json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-9, 9) | st.floats() | st.text(max_size=8) | st.just("q1"),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=5,
)
PLACES = ["name", "convention", "gravity", "constants", "links", "payloads", "links.0", "links.1.limits"]
PLACES += [
    f"links.2.{key}" for key in ("joint", "antecedent", "alpha", "d", "theta", "r", "gamma", "b", "name")
]


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.sampled_from(PLACES), json_values)
def test_no_content_raises_anything_but_a_refusal(place, value):
    with contextlib.suppress(RobotFileError):
        parse_robot(changed(place, value).replace("NaN", ".nan").replace("Infinity", ".inf"))


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.binary(max_size=60))
def test_no_bytes_raise_anything_but_a_refusal(data):
    with contextlib.suppress(RobotFileError):
        parse_robot(data)


IMPLAUSIBLE = {
    "twist in degrees": (changed("links.1.alpha", 90), "link 2, alpha is 90 rad, 14.3 turns; pi/2?"),
    "negative twist in degrees": (changed("links.1.alpha", -90), "-pi/2?"),
    "theta in degrees": (changed("links.1.theta", "q2 - 90"), "link 2, theta is -90 rad"),
    "twist of a named constant": (
        changed("links.1.alpha", "rl3").replace("0.4", "180"),
        "alpha is 180 rad, 28.6 turns; pi?",
    ),
    "lengths in mm": (changed("constants.rl3", 400), "link 3, r is 400 m, longer"),
    "d in mm": (changed("links.1.d", 612.7), "0.6127? Lengths are in m"),
    "limits in degrees": (changed("links.0.limits", [-170, 170]), "27.1 turns; write rad"),
    "speed in degrees": (changed("links.0.limits", {"dq": 410}), "speed 410"),
    "slide's limits in mm": (changed("links.2.limits", [0, 400]), "write m, not mm"),
    "gravity in mm/s^2": (changed("gravity", [0, 0, -9810]), "has the size 9810 m/s^2"),
    "gravity with a shifted point": (changed("gravity", [0, 0, -98.1]), "98.1 m/s^2, Earth's is 9.81"),
    "gravity in g": (changed("gravity", [0, 0, -1]), "write for example [0, 0, -9.81]"),
    "nested powers": (changed("links.0.d", "((2**8)**8)**8"), "number outside"),
    "nested powers of a name": (changed("links.0.d", "((rl3**8)**8)**8"), "power of a power"),
    "products that grow": (changed("links.0.d", "*".join(["999999999999"] * 14)), "number outside"),
    "payload that reads as a first moment": (changed("payloads", {"X1": 4}), "first moment"),
    "name of 5,000 characters": (changed("name", "a" * 5000), "..."),
    "link's name of two lines": (changed("links.0.name", "a\nb"), "on one line"),
    "timestamp that is none": ("name: !!timestamp x\n", "YAML"),
    "a tag before a mapping": ("!!bool {a: 1}\n", "YAML"),
}


@pytest.mark.parametrize("case", IMPLAUSIBLE)
def test_a_number_in_another_unit_is_refused_with_the_right_one(case):
    text, hint = IMPLAUSIBLE[case]
    with pytest.raises(RobotFileError) as error:
        parse_robot(text, "arm.yaml")
    message = str(error.value)
    assert hint in message and "\n" not in message and len(message) < 300


def test_gravity_that_is_not_earth_s_is_remarked():
    """Zero is a robot in orbit, and the moon has robots: allowed, and said."""
    for gravity, hint in (([0, 0, 0], "in orbit"), ([0, 0, -1.62], "not Earth's")):
        assert hint in parse_robot(changed("gravity", gravity)).remarks[0]


def test_what_is_no_regular_file_is_refused_at_once(tmp_path):
    pipe = tmp_path / "pipe.yaml"
    os.mkfifo(pipe)
    for path, hint in (
        (pipe, "pipe or a device"),
        ("/dev/zero", "pipe or a device"),
        ("a" * 5000, "too long"),
        ("a\0b", "no path"),
    ):
        with pytest.raises(RobotFileError, match=hint) as error:
            load_robot(path)
        assert len(str(error.value)) < 250 and "\n" not in str(error.value)
