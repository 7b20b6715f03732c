"""Torques that read zero wherever they are small: what is not measured has no weight, and is named."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, planted, refused, strangers_log, ur10e

from ident.equations.prepared import prepare_study
from ident.estimation.fit import fit_study
from ident.examination.examine import examine_fit, examine_tables
from ident.examination.tables.spikes import dead_band


def swinging(seed=0, middle=0.0):
    rng = np.random.default_rng(seed)
    t = np.arange(4000) / 500.0
    return middle + 10 * np.sin(2.1 * t) + 4 * np.sin(5.3 * t + 1) + 0.1 * rng.normal(size=len(t))


@pytest.mark.parametrize("size", [0.5, 2.0, 6.0])
def test_a_band_about_zero_is_told_wherever_it_stands(size):
    x = swinging()
    small = np.abs(x) <= size
    least = np.abs(x[~small]).min()
    assert dead_band(np.where(small, 0.0, x), 0.0) == least
    assert dead_band(np.where(small, 3.0, x + 3.0), 3.0) == pytest.approx(least)  # an offset's column


@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
@pytest.mark.parametrize("size", [0.9, 1.0, 1.1])
def test_a_band_that_a_torque_steps_over_where_its_joint_turns_is_told(tmp_path, size):
    """Of a KR 300's fourth torque at 100 Hz a logger's marks for no value were told."""

    def small(log):
        for name, table in log.tables.items():
            x = table["tau_m4"]
            log.tables[name] = table | {"tau_m4": np.where(np.abs(x) > size * np.std(x), x, 0.0)}

    _, checks = refused(strangers_log(tmp_path, "kuka_kr300", (100, False, False, False), small))
    assert checks == {"dead_band"}


@pytest.mark.parametrize("middle", [0.0, 40.0])
@pytest.mark.parametrize("length", [1, 20])
def test_lost_messages_and_whole_steps_are_none(middle, length):
    x = swinging(middle=middle)
    lost = x.copy()
    for begin in range(100, 3900, 190):
        lost[begin : begin + length] = 0.0
    assert not dead_band(lost, 0.0)
    assert not dead_band(np.round(x / 3.0) * 3.0, 0.0)
    assert not dead_band(np.maximum(x, 0.0), 0.0)


@pytest.mark.long
@ON_RECORDINGS[0]
@ON_RECORDINGS[1]
def test_of_a_measured_robot(tmp_path):
    """Nothing was said of a UR10e's third current, and its torque was learned with the zeros."""

    def small(c):
        return c | {"i3": np.where(np.abs(c["i3"]) > 0.2 * np.std(c["i3"]), c["i3"], 0.0)}

    there = planted(tmp_path, small)
    prepared = prepare_study(there)
    told = [*examine_tables(prepared), *examine_fit(prepared)]
    assert {(c.check, c.signals, c.outcome) for c in told} == {("dead_band", ("i3",), "warned")}
    errors = [fit_study(study).relative_error["validate"]["total"] for study in (there, ur10e())]
    assert errors[0] < 1.02 * errors[1]
