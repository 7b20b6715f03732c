"""Filtered blocks that a recording keeps are those that a fresh pass makes; a long recording keeps none."""

from dataclasses import fields, replace

import numpy as np
import pytest

from ident.equations.prepared import prepare_study
from ident.recordings import held
from ident.recordings.study import load_study
from ident.signals.dry_friction import TurnOver
from ident.signals.filtering import filter_stream
from ident.twin import PlannedRun, simulate, write_simulation


@pytest.fixture
def prepared(tmp_path):
    write_simulation(simulate("kuka_kr300", "A", runs=(PlannedRun("run1", "identify", 20.0, 3),)), tmp_path)
    return prepare_study(load_study(tmp_path / "study.yaml"))


def same(one, other):
    assert [index for index, _ in one] == [index for index, _ in other] and len(one) > 1
    for (_, a), (_, b) in zip(one, other):
        for each in fields(a):
            assert np.array_equal(getattr(a, each.name), getattr(b, each.name)), each.name


@pytest.mark.parametrize("first", [False, True])
def test_blocks_that_were_kept_are_the_same(prepared, first):
    stream, bank = prepared.streams[0], prepared.banks[0]
    made = {too: list(filter_stream(replace(stream), bank, torque_too=too)) for too in (False, True)}
    same(made[first], list(filter_stream(stream, bank, torque_too=first)))
    assert stream.held
    for too in (False, True):
        same(made[too], list(filter_stream(stream, bank, torque_too=too)))
    bent = replace(bank, turn_over=(TurnOver(0.02, 0.001),) * len(stream.need.joints))
    same(list(filter_stream(replace(stream), bent)), list(filter_stream(stream, bent)))
    assert len(stream.held) == 1


def test_of_a_long_recording_nothing_is_kept(prepared, monkeypatch):
    stream, bank = prepared.streams[0], prepared.banks[0]
    monkeypatch.setattr(held, "NUMBERS", 100_000)
    same(list(filter_stream(replace(stream), bank)), list(filter_stream(stream, bank)))
    assert not stream.held
