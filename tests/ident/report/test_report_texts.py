"""Sentences, numbers and tables of the reports, from documents as contract 5 and 6 write them."""

import numpy as np
import pytest

from ident.report.diagnosis_report import ResidualView, binned_median, diagnosis_page, finding_sentence
from ident.report.diagnosis_report import verdict as diagnosis_verdict
from ident.report.fit_report import Curve, fit_page
from ident.report.page import Table
from ident.report.render import render
from ident.report.wording import meaning, number, percent, readable_rule, with_deviation

FIT = {
    "robot": "kuka_lwr4p",
    "model": "A",
    "base_parameters": 79,
    "essential_parameters": 34,
    "parameters": [
        {"name": "XY2", "value": 0.0, "std": 0.1, "relative_std_percent": None, "essential": False,
         "unit": "kg m^2", "regroups": "XY2"},
        {"name": "ZZ2R", "value": 4.46, "std": 0.18, "relative_std_percent": 4.1, "essential": True,
         "unit": "kg m^2", "regroups": "ZZ2 + Iam2 + 2*rl3*MZ3 + rl3**2*(M3 + M4)"},
        {"name": "ML", "value": 4.6, "std": 0.01, "relative_std_percent": 0.2, "essential": True,
         "unit": "kg", "regroups": "ML"},
    ],
    "relative_error_percent": {"identify": {"total": 9.0, "tau_m1": 8.1},
                               "validate": {"total": 9.4, "tau_m1": 8.8}},
    "tests": {"durbin_watson": 0.4, "kolmogorov_smirnov": {"statistic": 0.02, "p_value": 0.3}, "rows": 1234},
}  # fmt: skip
DIAGNOSIS = {
    "verdict": "effect",
    "findings": [
        {"effect": "stribeck_friction", "joints": [4], "channel": "tau_m",
         "parameters": {"Fs": {"value": 3.12, "std": 0.11, "unit": "N m"}, "recording": {"value": "run2"}},
         "evidence": {"p_value": 1e-30, "error_drop_percent": 61.0},
         "alternatives": [{"effect": "hysteresis", "joints": [4], "error_drop_percent": 55.0},
                          {"effect": "spring", "joints": [4], "error_drop_percent": 5.0},
                          {"effect": "offset", "joints": [2], "error_drop_percent": 60.0}]},
        {"effect": "base_tilt", "joints": [], "channel": "tau_m", "parameters": {}, "evidence": {}},
    ],
    "unexplained": [
        {"joints": [3], "channel": "tau_m", "depends_on": ["q3", "dq3"], "share_of_residual_percent": 55.0}
    ],
    "error_percent": {
        "before": {"identify": {"total": 5.0, "tau_m4": 6.0}, "test": {"total": 5.2, "tau_m4": 6.2}},
        "after": {"identify": {"total": 2.0, "tau_m4": 2.1}, "test": {"total": 2.3, "tau_m4": 2.4}},
    },
    "noise_floor_percent": {"tau_m4": 1.8},
}  # fmt: skip


def tables(page):
    return [block for section in page.sections for block in section.blocks if isinstance(block, Table)]


def test_a_fit_is_told_by_its_error_on_runs_that_were_not_fitted():
    page = fit_page(FIT, [])
    assert page.verdict.replace("\u00a0", " ") == (
        "34 of 79 base parameters explain the torque to 9.4 % on runs that were not fitted "
        "(9.0 % where they were fitted)."
    )
    facts = {fact.label: fact for fact in page.facts}
    assert facts["mass, payload L"].value == "4.600 ± 0.010 kg"
    assert facts["Durbin-Watson, 2 is best, 1 to 3 is fair"].tone == "bad"


def test_essential_parameters_come_first_with_rule_unit_and_meaning():
    parameters = tables(fit_page(FIT, []))[1]
    assert [row[0].text for row in parameters.rows] == ["ZZ2R", "ML", "XY2"]
    texts = [cell.text.replace("\u00a0", " ") for cell in parameters.rows[0]]
    assert "kg m²" in texts and "ZZ2 + Iam2 + 2 rl3 MZ3 + rl3² (M3 + M4)" in texts
    assert "inertia ZZ, at the frame's origin, link 2, with others" in texts


def test_curves_of_a_recording_are_zoomed_together_and_later_ones_folded():
    t = np.arange(100) / 10
    curves = [
        Curve(run, "identify", f"tau_m{j}", "N m", t, t, t - 1, 3.0)
        for run in ("run1", "run2")
        for j in (1, 2)
    ]
    sections = [section for section in fit_page(FIT, curves).sections if section.title.startswith("Torque")]
    assert [section.folded for section in sections] == [False, True]
    assert len({plot.group for plot in sections[0].blocks}) == 1
    error = sections[0].blocks[0].panels[1].traces[0]
    np.testing.assert_allclose(error.y, 1.0, rtol=1e-12)  # t - (t - 1), rounded


def test_a_diagnosis_names_what_is_missing_and_what_nobody_knows():
    assert diagnosis_verdict(DIAGNOSIS) == (
        "The model lacks stribeck friction on joint 4 and base tilt on the whole robot. "
        "Structure is left that no known effect explains, on joint 3 (tau_m)."
    )
    nothing = DIAGNOSIS | {"findings": [], "unexplained": [], "verdict": "none"}
    assert "looks like noise" in diagnosis_verdict(nothing)
    unknown = DIAGNOSIS | {"findings": [], "verdict": "unexplained"}
    assert "no known effect explains" in diagnosis_verdict(unknown) and "lacks" not in diagnosis_verdict(
        unknown
    )


def test_many_findings_are_grouped_by_effect_and_only_close_rivals_are_named():
    def found(name, *joints):
        return DIAGNOSIS["findings"][1] | {"effect": name, "joints": list(joints)}

    names = [found("hysteresis", 4), found("spring", 1), found("hysteresis", 6), found("offset", 2),
             found("backlash", 3), found("offset_drift", 5)]  # fmt: skip
    text = diagnosis_verdict(DIAGNOSIS | {"findings": names, "unexplained": []})
    assert text == (
        "The model lacks hysteresis on joints 4 and 6, spring on joint 1, offset on joint 2 "
        "and 2 more effects."
    )
    sentence = finding_sentence(DIAGNOSIS, DIAGNOSIS["findings"][0])
    assert "Nearly as good on these runs: hysteresis on joint 4." in sentence


def test_a_diagnosis_page_is_complete_without_a_view_and_renders_with_one():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(2, 4000))
    view = ResidualView(("findings", 0), "tau_m4", "dq4", "rad/s", "N m", x, y, y / 2)
    html = render(diagnosis_page(DIAGNOSIS, "kuka_lwr4p, model A", [view]))
    assert "Fs = 3.12 ± 0.11" in html.replace("\u00a0", " ")
    assert "hysteresis on joint 4" in html and "5.2\u00a0%" in html
    assert "Test runs were used neither for the fit nor to choose what is kept." in html
    assert len(tables(diagnosis_page(DIAGNOSIS, "title"))) == 5


def test_medians_follow_a_step_that_noise_hides():
    rng = np.random.default_rng(1)
    x = rng.uniform(-1, 1, 20_000)
    centres, medians = binned_median(x, np.sign(x) + rng.normal(0, 2, len(x)))
    # a median over 333 samples of noise 2 has a standard deviation of 0.14
    assert abs(medians[centres < -0.1] + 1).max() < 0.7 and abs(medians[centres > 0.1] - 1).max() < 0.7


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("Fvm3R", "viscous friction, motor side, joint 3, with others"),
        ("Offl2", "offset of torque sensor, joint 2"),
        ("Fcm10", "Coulomb friction, motor side, joint 10"),
        ("MXL", "first moment along x, payload L"),
        ("M3", "mass, link 3"),
        ("something", ""),
    ],
)
def test_every_parameter_says_what_it_is(name, text):
    assert meaning(name) == text


def test_numbers_are_short_and_keep_their_digits():
    assert [number(x) for x in (0.0, 4.6136, 123456.7, 1.23456e-7, None, float("inf"))] == [
        "0", "4.614", "123457", "1.235e-07", "–", "–"]  # fmt: skip
    assert [percent(x) for x in (9.04, 0.382, 12.34, None)] == [
        "9.0\u00a0%", "0.38\u00a0%", "12.3\u00a0%", "–"]  # fmt: skip
    assert with_deviation(3.1234, 0.0312, "N m") == "3.123 ± 0.031 N\u00a0m"
    assert (
        with_deviation(3.0, 0.0, "kg") == "3.000 kg"
        and with_deviation(0.061, 0.002, "-") == "0.0610 ± 0.0020"
    )
    assert readable_rule("rl3**2*(M3 + M4)") == "rl3²\u00a0(M3 + M4)"
