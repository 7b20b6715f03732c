"""Torques that are clipped, planted in measured recordings: that alone is said of them."""

import numpy as np
import pytest
from planted import ON_RECORDINGS, measured, parted, planted, refused, strangers_log

from ident.equations.prepared import prepare_study
from ident.examination.examine import examine_fit, examine_tables

pytestmark = ON_RECORDINGS


def _clipped(low, high):
    return lambda x: np.clip(x, *np.quantile(x, [low, high]))


@pytest.mark.long
@pytest.mark.parametrize(("name", "low", "high"), [("tau_m3", 0.25, 0.75)])
def test_a_clipped_torque_has_no_other_fault(tmp_path, name, low, high):
    """Of an AIRBOT's the fit asked for a factor of 1.3 to 2.7 in its place, of another torque as well."""
    study = measured("airbot_play")
    clip = _clipped(low, high)
    prepared = prepare_study(planted(tmp_path, lambda c: c | {name: clip(c[name])}, study))
    said = [*examine_tables(prepared), *examine_fit(prepared)]
    assert {(check.check, check.signals) for check in said} == {("saturation", (name,))}


def test_steps_of_more_than_one_size_are_no_clipped_torque(tmp_path):
    """A rokae's seventh torque, rounded by its logger and once more: its largest value stands by itself,
    three of the smaller steps above the next, and 4.2 % of a run's samples were told to be clipped."""
    study = parted(measured("rokae_xmate3pro"), 7.0, 9.7)

    def rounded(c):
        step = 0.02 * np.std(c["tau_l7"])
        return c | {"tau_l7": np.round(c["tau_l7"] / step) * step}

    prepared = prepare_study(planted(tmp_path, rounded, study))
    assert "saturation" not in {check.check for check in examine_tables(prepared)}


def test_a_torque_that_is_held_at_what_was_least_may_be_that(tmp_path):
    """A TX40's fifth, for the second half of a run: it was told to be clipped."""

    def change(log):
        tau = log.tables["run2"]["tau_m5"]
        at = int(np.argmin(tau[:80]))
        tau[at:] = tau[at]

    prepared = prepare_study(strangers_log(tmp_path, "staubli_tx40", (100, False, True, False), change))
    (said,) = [check for check in examine_tables(prepared) if "tau_m5" in check.signals]
    assert said.check == "saturation" and "or a value that is held" in said.message


def test_what_a_late_torque_begins_with_is_no_clipped_one(tmp_path):
    """A rokae's, 0.03 s late: its fourth torque of one run, which is least where that begins."""

    def change(log):
        for table in log.tables.values():
            for k in (f"tau_l{j}" for j in range(1, 8)):
                table[k] = np.interp(table["t"] - 0.03, table["t"], table[k])

    prepared = prepare_study(strangers_log(tmp_path, "rokae_xmate3pro", (0, False, False, True), change))
    assert "saturation" not in {check.check for check in examine_tables(prepared)}


def test_a_run_at_the_end_of_a_torque_s_range_is_said_to_be_perhaps_that(tmp_path):
    """A Barrett's short recording whose second torque stays beyond what a clipped one gives."""
    clipped = lambda c: c | {"tau_m2": np.minimum(c["tau_m2"], c["tau_m2"].min())}  # noqa: E731
    study = planted(tmp_path, clipped, measured("barrett_wam_2dof"))
    message, checks = refused(study)
    assert "dead_channel" in checks and "held at the end of its range" in message


def test_a_torque_of_few_steps_is_no_clipped_one(tmp_path):
    """An LWR4+'s fifth in steps of 0.8 N m: half of its samples were told to be clipped."""
    coarse = lambda c: c | {"tau_l5": 0.8 * np.round(c["tau_l5"] / 0.8)}  # noqa: E731
    prepared = prepare_study(planted(tmp_path, coarse, measured("kuka_lwr4plus")))
    assert {check.check for check in examine_tables(prepared)} == {"coarse_signal", "time_stamps"}


@pytest.mark.parametrize("size", [0.5, 1.0])
def test_a_dead_band_is_no_lost_message(tmp_path, size):
    """A KR 300's second torque was refused as a logger's mark for no value; a smaller band was not told."""
    band = lambda c: c | {"tau_m2": np.where(abs(c["tau_m2"]) > size * c["tau_m2"].std(), c["tau_m2"], 0.0)}  # noqa: E731
    prepared = prepare_study(planted(tmp_path, band, measured("kuka_kr300")))
    said = {(check.check, check.signals) for check in examine_tables(prepared)}
    assert ("dead_band", ("tau_m2",)) in said and "missing_values" not in {check for check, _ in said}


def test_a_torque_that_saturates_softly_in_what_judges(tmp_path):
    """Of a Barrett a factor of 0.15 or a load was told of it."""

    def soft(log):
        tau = log.tables["run3"]["tau_m2"]
        log.tables["run3"]["tau_m2"] = tau.std() * np.tanh(tau / tau.std())

    study = strangers_log(tmp_path, "barrett_wam_2dof", (100, False, False, True), soft)
    (check,) = examine_fit(prepare_study(study))
    assert "tau_m2 of run3 is recorded too small where it is large (it saturates)" in check.message


def test_a_sensor_with_play_is_not_clipped(tmp_path):
    """Of an LWR4+'s sixth, which stands still wherever it turns back, a wider range was asked for."""

    def with_play(log):
        for table in log.tables.values():
            x = table["tau_l6"]
            half, out = 0.4 * x.std(), x.copy()
            for i in range(1, len(x)):
                out[i] = min(max(out[i - 1], x[i] - half), x[i] + half)
            table["tau_l6"] = out

    streams = prepare_study(
        strangers_log(tmp_path, "kuka_lwr4plus", (0, False, False, False), with_play)
    ).streams
    said = {c.check for s in streams for c in s.checks if c.signals == ("tau_l6",)}
    assert said == {"held_signal"}
