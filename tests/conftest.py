"""Helpers of several tests are modules of tests/support: `from pinocchio_robot import PinocchioRobot`."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent / "support"))


@pytest.fixture(autouse=True, scope="module")
def _effects_of_this_module():
    """A user's effect that one module registers is not searched in the diagnoses of another."""
    from modelgen.effects import registry

    before = dict(registry._own)
    yield
    registry._own.clear()
    registry._own.update(before)
