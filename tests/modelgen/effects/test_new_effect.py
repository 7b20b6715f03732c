"""A user's own effect: a file or class outside the package, simulated, generated, listed, refused."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import generated
import modelgen.effects
from modelgen import cli
from modelgen.effects import (
    SIGNALS,
    Effect,
    EffectError,
    LinearParameter,
    catalogue,
    register,
    register_folder,
    registry,
)

WIND = """
import sympy as sp

from modelgen.effects import SIGNALS, Effect, LinearParameter


class Wind(Effect):
    name = "wind"
    summary = "air drags at the link"
    signature = "grows with the square of the rate"
    source = "Newton 1687"
    remedy = "shut the window"
    terms = {"Fw": sp.Abs(SIGNALS.dq) * SIGNALS.dq}
    linear = (LinearParameter("Fw", "N m s^2/rad^2", 0.0, 50.0, "positive"),)
    typical = {"Fw": 1.0}
"""
PROGRAM = """
import sys
from modelgen.effects import register_folder
register_folder(sys.argv[1])
from ident.twin import PlannedRun, simulate
runs = (PlannedRun("run1", "identify", 6.0), PlannedRun("run2", "test", 6.0, 3))
print(simulate("kuka_lwr4p", effects=("wind:2",), runs=runs).truth["effects"][0]["effect"])
"""


@pytest.fixture(autouse=True)
def _only_for_this_test(monkeypatch):
    monkeypatch.setattr(registry, "_own", {})


def test_a_file_is_simulated_without_touching_the_package(tmp_path):
    (tmp_path / "wind.py").write_text(WIND)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.stdout.strip() == "wind", done.stderr
    assert not list(Path(modelgen.effects.__file__).parent.rglob("wind.py"))


def test_a_folder_is_listed_and_generated(tmp_path, capsys):
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "wind.py").write_text(WIND)
    (tmp_path / "own" / "_helper.py").write_text("raise RuntimeError\n")
    folder = ["--effects-folder", str(tmp_path / "own")]
    assert cli.run([*folder, "--list-effects"]) == 0
    told = capsys.readouterr().out
    assert "wind: air drags" in told and "remedy      shut the window" in told
    assert cli.run(["kuka_lwr4p", "-m", "D", "--effect", "wind:2", *folder, "-o", str(tmp_path / "c")]) == 0
    assert "Fw2" in (tmp_path / "c" / "D_wind_2.h").read_text()


def test_a_class_is_compiled_and_its_next_version_compiled_anew():
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, 5, 7))
    for power in (3, 5):  # the name stays, the term does not

        class Wind(Effect):
            name, summary, signature, source = "wind", "air", "drag", "me"
            terms = {"Fw": SIGNALS.dq**power}
            linear = (LinearParameter("Fw", "N m", 0.0, 50.0),)

        register(Wind)
        m = generated.load("kuka_lwr4p", "D", effects=("wind:2",))
        column = m.regressor(q, dq, ddq)[:, 1, m.parameters.index("Fw2")]
        assert column == pytest.approx(dq[:, 1] ** power)


def named(**given):
    base = {"name": "wind", "summary": "a", "signature": "b", "source": "c"}
    return Effect(**{**base, **given})


@pytest.mark.parametrize(
    "wrong, told",
    [
        (3, "is no effect"),
        (Effect(name="wind", summary="air"), "has no signature"),
        (named(name="spring"), "is an effect of the catalogue; choose another name"),
        (named(name="my wind"), "is no name"),
        (named(linear=(LinearParameter("F", "N", 0, 1),), terms={"G": sp.Integer(1)}), "name them alike"),
        (named(linear=(LinearParameter("F", "N", 0, 1),) * 2), "have one name"),
    ],
)
def test_an_incomplete_effect_is_refused(wrong, told):
    with pytest.raises(EffectError, match=told):
        register(wrong)
    assert "wind" not in catalogue()


@pytest.mark.parametrize(
    "text, told",
    [
        ("x = 1 +\n", "bad.py: SyntaxError"),
        ("x = 1\n", "defines 0 effects"),
        ("EFFECT = 2\n", "bad.py: 2 is no"),
    ],
)
def test_a_wrong_file_is_named(tmp_path, text, told):
    (tmp_path / "bad.py").write_text(text)
    with pytest.raises(EffectError, match=told):
        register_folder(tmp_path)


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(EffectError, match="is no folder of effects"):
        register_folder(tmp_path / "nowhere")


def test_an_attribute_that_no_effect_has_is_refused():
    with pytest.raises(EffectError, match="no attribute colour"):
        Effect(colour="red")
