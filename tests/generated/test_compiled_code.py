"""The committed C: what the generator writes, plain C99, and the same numbers in every build."""

import ctypes
import json
import re
import shutil
import subprocess
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import generated
from generated import compiling
from modelgen.base_parameters.regrouping import exact_geometry
from modelgen.dynamics.models import MODELS, standard_regressor
from modelgen.emit import regenerate
from modelgen.emit.description import derive
from modelgen.geometry.kinematics import State
from modelgen.geometry.robot_file import load_robot
from modelgen.terminal import silent

FOLDER = Path(generated.__file__).parent / "kuka_lwr4p"
CC = shutil.which("cc") or shutil.which("gcc")
needs_compiler = pytest.mark.skipif(CC is None, reason="no C compiler")


def test_committed_files_are_what_the_generator_writes():
    plan = regenerate.plan("kuka_lwr4p", "ABCD", (), True, silent)
    stale = regenerate.difference(regenerate.files(plan, silent), FOLDER, 40, complete=True)
    assert not stale, f"run regenerate-model kuka_lwr4p and read the diff:\n{stale}"


def test_generated_files_carry_no_date_and_no_path():
    for path in FOLDER.iterdir():
        text = path.read_text()
        assert not re.search(r"20\d\d-\d\d|/home/|/work/|/usr/|/tmp/", text), path.name
    assert "robot file sha256: " in (FOLDER / "A.c").read_text()


@pytest.mark.parametrize("stem", ["A", "B", "C", "D", "A_L", "B_L", "C_L"])
def test_the_counted_operations_are_those_of_the_c(stem):
    code = (FOLDER / f"{stem}.c").read_text()
    found = []
    for name in ("columns", "inverse_dynamics"):
        start = code.index(f"_{name}(const REAL")
        body = code[start : code.index("\n}", start)]
        statements = re.findall(r"= (?:CONSTANT)?\((.*)\);", body)
        signs = "".join(re.sub(r"^-|e[-+]\d+|chi\[\d+\]", "", s) for s in statements)
        found.append({"add": len(re.findall(r"[-+]", signs)), "mul": signs.count("*")})
    operations = json.loads((FOLDER / f"{stem}.json").read_text())["operations"]
    assert found == [{"add": operations["add"], "mul": operations["mul"]}, operations["torque"]]


@needs_compiler
@pytest.mark.parametrize("stem", ["A", "B", "C", "D", "A_L", "C_L"])
def test_plain_c99_compiles_without_a_warning(stem, tmp_path):
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O0"]
    subprocess.run([CC, *flags, "-c", FOLDER / f"{stem}.c", "-o", tmp_path / "model.o"], check=True)


@needs_compiler
def test_the_c_example_runs_and_agrees_with_python(tmp_path):
    example = FOLDER.parent / "example.c"
    command = [CC, "-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", f"-I{FOLDER}", example, FOLDER / "A.c"]
    subprocess.run([*command, "-lm", "-o", tmp_path / "example"], check=True)
    lines = subprocess.run(
        [tmp_path / "example"], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    printed = np.array(
        [[float(x) for x in re.findall(r"= (\S+) N m.*?regressor (\S+) N m", line)[0]] for line in lines]
    )
    m = generated.load("kuka_lwr4p", "A")
    chi = np.zeros(69)
    chi[m.parameters.index("MY2R")], chi[m.parameters.index("MY4R")] = 3.45, -1.35
    q = np.array([[0.3, 0.6, -0.2, 1.1, 0.4, -0.5, 0.1]])
    tau = m.torque(q, 0 * q, 0 * q, chi)[0]
    np.testing.assert_allclose(
        printed, np.stack([tau, tau], 1), rtol=1e-11, atol=1e-11
    )  # 12 digits are printed


def _exact_regressor(robot, model, q, dq, ddq):
    """W at one state by exact rational arithmetic on the doubles' cos and sin, kept columns only."""
    geometry, exact = exact_geometry(robot)
    from sympy.polys.domains import QQ

    def rational(values):
        fractions = [Fraction(float(v)) for v in values]
        return [QQ(f.numerator, f.denominator) for f in fractions]

    constants = {name: QQ(int(v.p), int(v.q)) for name, v in robot.constants.items()}
    state = State(*(rational(x) for x in (np.cos(q), np.sin(q), q, dq, ddq)))
    columns = MODELS[model].standard_parameters(robot)
    W = standard_regressor(robot, geometry, MODELS[model], state, [int(s) for s in np.sign(dq)], columns)

    def number(x):
        x = x if isinstance(x, int) else exact.expression(x)
        x = x if isinstance(x, int) else robot.value(x)
        return float(x)

    assert constants
    return {name: [number(x) for x in entries] for name, entries in W.items()}


@pytest.mark.parametrize("seed", [0, 1])
def test_simd_agrees_with_exact_arithmetic(seed):
    robot, m = load_robot("kuka_lwr4p"), generated.load("kuka_lwr4p", "B")
    rng = np.random.default_rng(seed)
    q, dq, ddq = rng.uniform(-3, 3, 7), rng.uniform(-2, 2, 7), rng.uniform(-5, 5, 7)
    W = m.regressor(*(np.tile(x, (9, 1)) for x in (q, dq, ddq)))[8]
    exact = _exact_regressor(robot, "B", q, dq, ddq)
    for b, name in enumerate(m.parameters):
        expected = np.array(exact[name if name in exact else name.removesuffix("R")])
        np.testing.assert_allclose(W[:, b], expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


def test_the_committed_expressions_are_the_sympy_intermediates():
    """The slow way: SymPy substitutes its own named intermediates, in 30 digits."""
    derived = derive(load_robot("kuka_lwr4p"), "B")
    m = generated.load("kuka_lwr4p", "B")
    rng = np.random.default_rng(2)
    q, dq, ddq = (rng.uniform(-1, 1, 7) for _ in range(3))
    named, outputs = derived.columns.intermediates()
    known = {}
    for k in range(7):
        known |= {
            f"c{k + 1}": np.cos(q[k]),
            f"s{k + 1}": np.sin(q[k]),
            f"dq{k + 1}": dq[k],
            f"ddq{k + 1}": ddq[k],
        }

    def value(expression):
        return expression.evalf(30, subs={s: known[s.name] for s in expression.free_symbols})

    for symbol, expression in named:
        known[symbol.name] = value(expression)
    entries = np.array([float(value(e)) for e in outputs])
    W = m.regressor(q[None], dq[None], ddq[None])[0]
    for channel, parameter, source in derived.description["nonzeros"]:
        if isinstance(source, int):
            assert W[channel, parameter] == pytest.approx(entries[source], rel=1e-12, abs=1e-12)


@pytest.mark.first_case
@needs_compiler
@pytest.mark.parametrize("flags", [("-mno-avx512f",), ("-mno-avx512f", "-mno-avx")])
def test_every_vector_width_gives_the_same_numbers(flags, tmp_path, monkeypatch):
    import platform

    if platform.machine() not in ("x86_64", "AMD64"):
        pytest.skip("these widths are x86's")
    monkeypatch.setenv("DYNIDENT_CACHE", str(tmp_path))
    monkeypatch.setattr(compiling, "FLAGS", (*compiling.FLAGS, *flags))
    monkeypatch.setattr(compiling, "NATIVE", flags[-1])
    from generated import loading

    robot = loading._robot_file("kuka_lwr4p")
    narrow = loading._load(loading.Question(*robot, "B"))
    m = generated.load("kuka_lwr4p", "B")
    rng = np.random.default_rng(3)
    q, dq, ddq = (rng.uniform(-3, 3, (21, 7)) for _ in range(3))
    chi = rng.normal(size=64)
    W = m.regressor(q, dq, ddq)
    np.testing.assert_allclose(narrow.regressor(q, dq, ddq), W, rtol=1e-12, atol=1e-12 * np.abs(W).max())
    np.testing.assert_allclose(narrow.torque(q, dq, ddq, chi), W @ chi, rtol=1e-11, atol=1e-11)


def test_cos_and_sin_are_within_two_ulp():
    m = generated.load("kuka_lwr4p", "D")
    rng = np.random.default_rng(4)
    near = np.arange(-2000, 2000) * (np.pi / 2)
    x = np.concatenate(
        [
            rng.uniform(-4, 4, 40_000),
            rng.uniform(-1e4, 1e4, 40_000),
            near,
            near * (1 + 2.2e-16),
            [0.0, -0.0, 5e-324],
        ]
    )
    x = np.concatenate([x, [1e4, 1.1e5, 1e22, -3e8, 1e300], np.zeros(-(len(x) + 5) % 8)])
    c, s = m._kernel.cos_sin(x)
    wide = x.astype(np.longdouble)
    if np.finfo(np.longdouble).nmant < 63:
        pytest.skip("no wider floating point to compare with")
    # long double reduces the argument with a 66-bit pi: compare where that is enough
    ok = np.abs(x) < 1e4
    for got, exact in ((c, np.cos(wide)), (s, np.sin(wide))):
        ulp = np.spacing(np.abs(exact).astype(float))
        error = np.abs(got.astype(np.longdouble) - exact) / ulp
        tiny = np.abs(exact) < 1e-5  # there the 66 bits are too few
        assert error[ok & ~tiny].max() < 2
    np.testing.assert_array_equal(c[~ok], np.cos(x[~ok]))
    np.testing.assert_array_equal(s[~ok], np.sin(x[~ok]))
    np.testing.assert_allclose(s[ok], np.sin(x[ok]), rtol=1e-15, atol=0)
    np.testing.assert_allclose(c[ok], np.cos(x[ok]), rtol=1e-15, atol=0)


@needs_compiler
@pytest.mark.parametrize("stem", ["A", "C_L"])
def test_scalar_c_agrees_with_simd(stem, tmp_path):
    command = [
        CC,
        "-std=c99",
        "-O1",
        "-shared",
        "-fPIC",
        FOLDER / f"{stem}.c",
        "-lm",
        "-o",
        tmp_path / "model.so",
    ]
    subprocess.run(command, check=True)
    library = ctypes.CDLL(str(tmp_path / "model.so"))
    model, _, payload = stem.partition("_")
    m = generated.load("kuka_lwr4p", model, payload=payload or None)
    rng = np.random.default_rng(7)
    q, dq, ddq = (rng.uniform(-3, 3, (16, 7)) for _ in range(3))
    chi = rng.normal(size=len(m.parameters))
    W, tau = np.empty((16, len(m.channels), len(m.parameters))), np.empty((16, len(m.channels)))
    for i in range(16):
        state = [ctypes.c_void_p(x[i].ctypes.data) for x in (q, dq, ddq)]
        getattr(library, f"kuka_lwr4p_{stem}_regressor")(*state, ctypes.c_void_p(W[i].ctypes.data))
        out = (ctypes.c_void_p(chi.ctypes.data), ctypes.c_void_p(tau[i].ctypes.data))
        getattr(library, f"kuka_lwr4p_{stem}_torque")(*state, *out)
    np.testing.assert_allclose(W, m.regressor(q, dq, ddq), rtol=1e-12, atol=1e-12 * np.abs(W).max())
    np.testing.assert_allclose(tau, m.torque(q, dq, ddq, chi), rtol=1e-12, atol=1e-12 * np.abs(tau).max())
