"""A new effect is one new file: one is dropped in, in another process, simulated, and looked for."""

import subprocess
import sys
from pathlib import Path

import modelgen.effects

WIND = """
import sympy as sp

from modelgen.effects.effect import SIGNALS, Effect, LinearParameter

EFFECT = Effect(
    name="wind",
    summary="air drags at the link",
    signature="grows with the square of the rate",
    source="Newton 1687",
    terms={"Fw": sp.Abs(SIGNALS.dq) * SIGNALS.dq},
    linear=(LinearParameter("Fw", "N m s^2/rad^2", 0.0, 50.0, "positive"),),
    typical={"Fw": 1.0},
)
"""
PROGRAM = """
import sys
import modelgen.effects.catalogue
from sys import modules
modules['modelgen.effects.catalogue'].__path__.append(sys.argv[1])
from ident.simulate import PlannedRun, simulate
runs = (PlannedRun("run1", "identify", 6.0), PlannedRun("run2", "test", 6.0, 3))
from types import SimpleNamespace
from ident.diagnosis.candidates import all_terms
view = SimpleNamespace(channels=("tau_m1", "tau_m2"), joint_of=(0, 1), n=2)
looked_for = {t.joint for t in all_terms(view, ()) if t.effect.name == "wind"}
assert looked_for == {0, 1}
print(simulate("kuka_lwr4p", effects=("wind:2",), runs=runs).truth["effects"][0]["effect"])
"""


def test_a_new_effect_is_one_new_file(tmp_path):
    (tmp_path / "wind.py").write_text(WIND)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.stdout.strip() == "wind", done.stderr
    assert not (Path(modelgen.effects.__file__).parent / "wind.py").exists()
