"""Sentences and tables with the names that a robot gives its joints; keys and commands stay as they are."""

import numpy as np
import pytest

from ident.report.joints import joint_of, named, names_in, page_with_names, with_names
from ident.report.page import Cell, Column, Fact, Panel, Plot, Remark, ReportPage, Section, Table, Trace

NAMES = names_in([{"joint": "1", "row": 1, "name": "pan"}, {"joint": "2", "row": 3, "name": "elbow"}])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "The model lacks spring on joint 2, and on joint 2.",
            "The model lacks spring on joint 2 (elbow), and on joint 2.",
        ),
        ("Joints 1 and 2, tau_m2: worse.", "Joints 1 (pan) and 2 (elbow), tau_m2: worse."),
        ("error of tau_l1 on runs, of dq2.", "error of tau_l1 (pan) on runs, of dq2 (elbow)."),
        ("most in tau_m2 (4.6 %).", "most in tau_m2 (elbow, 4.6 %)."),
        ("on joint 2 (tau_m2).", "on joint 2 (elbow, tau_m2)."),
        ("hold link 3, and link 2 (so)", "hold link 3 (moved by elbow), and link 2 (so)"),
        ("columns: {tau_m2: {sign: -1}}, [tau_m1]", "columns: {tau_m2: {sign: -1}}, [tau_m1]"),
        ("joint 7 of 12, joint 1.5, q17, run/q1/x", "joint 7 of 12, joint 1.5, q17, run/q1/x"),
    ],
)  # fmt: skip
def test_names_stand_behind_numbers_once(text, said):
    assert named(text, NAMES) == said
    assert named(text, {}) == text


def test_channels_parameters_and_effects_know_their_joint():
    known = dict.fromkeys(("tau_m2", "Fvm2R", "spring:2.k"), "elbow")
    known |= {"XX3R": "moved by elbow", "MX1": "moved by pan"}
    assert {name: joint_of(name, NAMES) for name in known} == known
    assert not any(
        joint_of(name, NAMES) for name in ("total", "ML", "XX2", "tau_m7", "run2", "time_delay.delay")
    )
    header, rows = with_names(("channel", "%"), [("total", "1"), ("tau_m2", "2")], NAMES)
    assert header == ("channel", "%", "joint") and rows == [("total", "1", ""), ("tau_m2", "2", "elbow")]
    assert with_names(("channel",), [("tau_m2",)], {}) == (("channel",), [("tau_m2",)])


def test_every_text_of_a_page_that_is_read():
    curve = Trace("q2", np.zeros(2), np.zeros(2), "model")
    plot = Plot("tau_m2", "q2 [rad]", (Panel("torque", (curve,)),), caption="joint 1")
    table = Table("", (Column("channel"), Column("n", True)), ((Cell("tau_m1", "tau_m1"), Cell("3", 3.0)),))
    page = ReportPage(
        "q2", "Fit", "Joint 2.", "plain", (Section("Joint 1", (plot, table), "tau_m2"),),
        (Fact("1", "joint 1"),), (Remark("warning: joint 2 (elbow); columns: {q2: 1}"),), ("joint 1",),
    )  # fmt: skip
    told = page_with_names(page, NAMES)
    assert (told.verdict, told.warnings, told.checks) == ("Joint 2 (elbow).", ("joint 1 (pan)",), page.checks)
    (section,) = told.sections
    assert (section.title, section.text) == ("Joint 1 (pan)", "tau_m2 (elbow)")
    assert section.blocks[0].title == "tau_m2 (elbow)" and section.blocks[0].panels == plot.panels
    assert section.blocks[1].rows[0] == (Cell("tau_m1 (pan)", "tau_m1"), Cell("3", 3.0))
    assert page_with_names(page, {}) is page
