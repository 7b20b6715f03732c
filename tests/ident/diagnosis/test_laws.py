"""What resembles the rest is no law of it; a law stays one beside a rest of other signals."""

from types import SimpleNamespace

import numpy as np
import pytest

from ident.diagnosis.evidence.nameless import Flexible
from ident.diagnosis.left_over import _is_a_law
from ident.diagnosis.outcome import Unnamed
from modelgen.effects import catalogue
from modelgen.effects.place import Place

TAU = np.log(4000)


def _law(effect, own, rest, alone):
    """own: nats of an effect of joint 2 on judged and fitted rows; rest: signals of what a function finds
    beside it, and its nats; alone: those of the function in its place."""
    term = SimpleNamespace(effect=catalogue()[effect], place=Place(joint=1, side="motor"), free=1)
    evidence, fitted = alone
    learned = Flexible(("q2",), np.zeros(1), fitted, SimpleNamespace(log_e=evidence), fitted=fitted)
    left = Unnamed(1, rest[0], *rest[1:], 0.5, None)
    return _is_a_law(term, SimpleNamespace(log_e=own[0], gain=own[1]), left, learned, TAU)


@pytest.mark.parametrize(
    ("signals", "law"),
    [(("tau",), False), (("q2", "q3"), True)],  # of its own torque; of something else
)
def test_a_gain_is_none_where_functions_of_the_torque_say_more_on_the_rows_that_chose_it(signals, law):
    assert _law("drive_gain_error", (859.0, 289.0), (signals, 77.0, 1940.0), (171.0, 2228.0)) is law


@pytest.mark.parametrize(("signals", "law"), [(("tau",), False), (("q2",), True)])
def test_a_gain_is_none_where_functions_of_the_torque_say_more_beside_it(signals, law):
    assert _law("drive_gain_error", (27.1, 15.1), (signals, 35.5, 77.9), (-14.4, 23.3)) is law


def test_a_gain_beside_a_friction_of_its_own_is_one():
    """Functions of everything learn a joint's gravity from its position."""
    assert _law("drive_gain_error", (133.0, 300.0), (("ddq2",), 15.0, 40.0), (147.0, 330.0))


@pytest.mark.parametrize(("gain", "law"), [(400.0, True), (200.0, False)])
def test_a_spring_says_as_much_as_any_function_of_the_position(gain, law):
    assert _law("spring", (300.0, gain), (("q2",), 20.0, 20.0), (310.0, 405.0)) is law


@pytest.mark.parametrize(("signals", "law"), [(("dq2", "ddq2"), True), (("q2", "dq2"), False)])
def test_a_spring_beside_a_strange_friction_is_one(signals, law):
    """Functions of position and rate learn both."""
    assert _law("spring", (1466.0, 2475.0), (signals, 128.0, 211.0), (1539.0, 2438.0)) is law
