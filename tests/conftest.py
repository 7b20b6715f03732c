"""Helpers of several tests are modules of tests/support: `from pinocchio_robot import PinocchioRobot`."""

import os
import sys
from pathlib import Path

import pytest

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")  # two workers on two cores: more threads wait for each other
sys.path.insert(0, str(Path(__file__).parent / "support"))


def pytest_collection_modifyitems(items):
    """The slow ones first: at the end one process would wait for the other's."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


@pytest.fixture(autouse=True, scope="module")
def _effects_of_this_module():
    """A user's effect that one module registers is not searched in the diagnoses of another."""
    from modelgen.effects import registry

    before = dict(registry._own)
    yield
    registry._own.clear()
    registry._own.update(before)
