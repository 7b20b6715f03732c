"""Work on two cores: the order of what was asked, errors where they come, nothing shared twice."""

import threading
import time

import pytest

from ident import cores


@pytest.fixture
def two(monkeypatch):
    monkeypatch.setattr(cores, "available", lambda: 2)


@pytest.mark.parametrize("count", [1, 2])
def test_results_come_in_the_order_of_the_items(monkeypatch, count):
    monkeypatch.setattr(cores, "available", lambda: count)

    def later_ones_are_done_first(k):
        time.sleep(0.02 * (k % 3 == 0))
        return k, threading.current_thread() is threading.main_thread()

    told = list(cores.in_order(later_ones_are_done_first, range(9)))
    assert told == [(k, count == 1) for k in range(9)]


def test_two_are_at_work_at_once_and_few_wait(two):
    both = threading.Barrier(2, timeout=5)
    taken = []

    def items():
        for k in range(20):
            taken.append(k)
            yield k

    results = cores.in_order(lambda k: both.wait() >= 0, items())
    assert next(results)
    assert len(taken) == cores.WAITING + 1
    assert all(results)
    assert len(taken) == 20


def test_what_is_shared_is_not_shared_again(two):
    def threads(_):
        return set(cores.in_order(lambda _: threading.get_ident(), range(4))) == {threading.get_ident()}

    assert all(cores.in_order(threads, range(6)))


def test_an_error_comes_where_its_result_would(two):
    results = cores.in_order(lambda k: 1 // k, [1, 1, 0, 1])
    assert [next(results), next(results)] == [1, 1]
    with pytest.raises(ZeroDivisionError):
        next(results)
