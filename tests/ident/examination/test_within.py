"""A torque that changes its sign on the way is told where one arm is then left."""

import re

import numpy as np
import pyarrow.parquet as pq
import pytest
from planted import ON_RECORDINGS, measured, parted, planted

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit
from ident.examination.fits.hypothesis import Asked
from ident.examination.fits.quick import quick_of
from ident.examination.fits.samples import take
from ident.examination.torques.within import changed_within

pytestmark = ON_RECORDINGS


def _told(study):
    return [(check.check, check.signals) for check in _changes(study)]


def _changes(study):
    made = prepare_study(study.with_(filter=type(study.filter)()))
    samples = take(made.streams, made.banks, made.columns, "identify")
    quick = quick_of(made.columns, samples)
    how = quick.plain()
    asked = Asked(quick, how, quick.fit(how), dict(study.columns), False, np.ones(len(how.order)))
    return [check for check, _ in changed_within(asked)]


def test_torques_of_an_arm_on_a_wall_do_not_change_their_sign(tmp_path):
    """Of a rokae whose second joint has another zero two were told to, in the place of its base."""
    study = planted(tmp_path, lambda c: c | {"q2": c["q2"] + 0.3}, measured("rokae_xmate3pro"))
    assert _told(study.with_(gravity=(0, 9.81, 0))) == []


def test_one_that_does_is_told_beside_one_that_grows_on_the_way(tmp_path):
    def changed(c):
        later = np.arange(len(c["t"])) > 0.35 * len(c["t"])  # within what is fitted
        return c | {
            "tau_l3": np.where(later, -c["tau_l3"], c["tau_l3"]),
            "tau_l2": np.where(later, 1.2 * c["tau_l2"], c["tau_l2"]),
        }

    assert _told(planted(tmp_path, changed, measured("rokae_xmate3pro"))) == [("torque_sign", ("tau_l3",))]


def test_all_that_do_at_once_are_told_together(tmp_path):
    """Of an LWR4+ so turned at 15.4 s the fifth was told to change its sign at 11.3 s, by itself."""

    def changed(c):
        sign = np.where(np.arange(len(c["t"])) > 0.35 * len(c["t"]), -1.0, 1.0)
        return c | {name: sign * c[name] for name in c if name.startswith("tau_l")}

    study = planted(tmp_path, changed, measured("rokae_xmate3pro"))
    told = _changes(study)
    assert [check.signals for check in told] == [tuple(f"tau_l{j}" for j in range(1, 8))]
    t = pq.read_table(tmp_path / study.recordings[0].file)["t"].to_numpy()
    at = float(re.search(r"at about ([\d.]+) s", told[0].message).group(1))
    assert at == pytest.approx(t[int(0.35 * len(t))] - t[0], abs=0.15)


@pytest.mark.long
def test_of_three_seconds_two_torques_exchanged_and_a_position_turned_are_no_sign_that_changes(tmp_path):
    """Of a Franka the first torque was told to change its sign, which explained nothing of all recordings."""
    exchanged = lambda c: c | {"tau_l1": c["tau_l2"], "tau_l2": c["tau_l1"], "q4": -c["q4"]}  # noqa: E731
    study = planted(tmp_path, lambda c: _rates(exchanged(c)), measured("franka_panda"))
    told = examine_fit(prepare_study(parted(study, 6.5, 9.8)))
    assert not [c for c in told if c.check == "torque_sign"]


@pytest.mark.long
def test_of_positions_of_the_motors_side_no_torque_changes_its_sign(tmp_path):
    """Of a rokae's two were told to, by the fitted recording alone."""
    gears = {f"q{j}": ratio for j, ratio in enumerate((101, -100, 80, -81, 60, 50, -51), 1)}
    study = planted(
        tmp_path,
        lambda c: _rates({k: gears.get(k, 1) * v for k, v in c.items()}),
        measured("rokae_xmate3pro"),
    )
    told = examine_fit(prepare_study(parted(study, 7.0, 9.7)))
    assert not [c for c in told if c.check == "torque_sign"]


def _rates(columns):
    return {k: v for k, v in columns.items() if k[0] != "d"}
