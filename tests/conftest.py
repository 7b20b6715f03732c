"""Helpers of several tests are modules of tests/support: `from pinocchio_robot import PinocchioRobot`."""

import os
import sys
from pathlib import Path

import pytest

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")  # two workers on two cores: more threads wait for each other
sys.path.insert(0, str(Path(__file__).parent / "support"))


def pytest_addoption(parser):
    parser.addoption("--long", action="store_true", help="also the tests that `make long` runs")


def pytest_collection_modifyitems(config, items):
    """The slow ones first: at the end one process would wait for the other's. Second looks at what another
    test asks, on measured robots, are left to `make long`, and of some tests of measured robots all cases but
    the first: with them `make test` takes more than a quarter of an hour."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)
    if not config.getoption("--long"):
        later = pytest.mark.skip(reason="`make long` runs it: ten seconds of a processor or more")
        begun = set()
        for item in items:
            case = item.get_closest_marker("first_case") and (item.path, item.originalname)
            if item.get_closest_marker("long") or case in begun:
                item.add_marker(later)
            elif case:
                begun.add(case)


@pytest.fixture(autouse=True, scope="module")
def _effects_of_this_module():
    """A user's effect that one module registers is not searched in the diagnoses of another."""
    from modelgen.effects import registry

    before = dict(registry._own)
    yield
    registry._own.clear()
    registry._own.update(before)


@pytest.fixture(autouse=True, scope="module")
def _fits_of_this_module(request):
    """`pytestmark = pytest.mark.unexamined`: fits of this file are not held against physics first, which
    takes ten times as long as a fit of these recordings, and is what tests/ident/examination asks."""
    if request.node.get_closest_marker("unexamined") is None:
        yield
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ident.estimation.fit.examine_fit", lambda prepared: ())
        yield


@pytest.fixture
def examined(monkeypatch):
    """In such a file: of a test that asks what a fit says of its data."""
    from ident.examination.examine import examine_fit

    monkeypatch.setattr("ident.estimation.fit.examine_fit", examine_fit)
