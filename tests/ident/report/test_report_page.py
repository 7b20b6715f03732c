"""The report in a real browser, opened from disk: nothing from the network, plots drawn, tables sorted."""

import browser
import numpy as np
import pytest

from ident.report.page import Cell, Column, Fact, Panel, Plot, Remark, ReportPage, Section, Table, Trace
from ident.report.render import render
from ident.report.thinning import envelope, stretches_for, with_gaps

needs_browser = pytest.mark.skipif(browser.chromium() is None, reason="no chromium on this machine")


def small_page() -> ReportPage:
    t = np.arange(4000) / 100
    plots = []
    for joint in (1, 2):
        measured = 20 * np.sin(t / joint)
        panels = (
            Panel(
                "N m", (Trace("measured", t, measured, "measured"), Trace("model", t, measured - 1, "model"))
            ),
            Panel("error", (Trace("error", t, np.ones_like(t), "error"),)),
        )
        plots.append(Plot(f"tau_m{joint}", "t [s]", panels, group="run1"))
    values = [("ZZ2R", 4.46), ("MX2R", -1.2), ("Fcm1", 11.9), ("XX2R", 0.001)]
    rows = tuple((Cell(name), Cell(f"{value:.3g}", value), Cell("kg m²")) for name, value in values)
    columns = (Column("name"), Column("value", number=True), Column("unit"))
    bars = Plot("histogram", "error", (Panel("", (Trace("error", t[:20], t[:20], "error", kind="bars"),)),))
    return ReportPage(
        title="<robot> & co",
        kind="Identification",
        verdict="A verdict with </script> in it.",
        tone="good",
        sections=(
            Section("Torques", tuple(plots), text="text"),
            Section("Parameters", (Table("values", columns, rows), bars), folded=True),
        ),
        facts=(Fact("3.2 %", "error"),),
        checks=(Remark("warning: run1: tau_m3 has the other sign"), Remark("mended: one spike", False)),
        warnings=("12 samples were dropped",),
    )


@pytest.fixture(scope="module")
def tab():
    if browser.chromium() is None:
        pytest.skip("no chromium on this machine")
    with browser.browser_page() as page:
        yield page


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(render(small_page()), encoding="utf-8")
    return path


def test_what_was_found_in_the_data_comes_first(report):
    text = report.read_text(encoding="utf-8")
    assert text.index("tau_m3 has the other sign") < text.index("<h1>")
    assert '<ul class="checks">' in text


def test_text_is_escaped_and_the_page_is_one_file(report):
    text = report.read_text(encoding="utf-8")
    assert "<title>&lt;robot&gt; &amp; co" in text
    assert text.count("<script src") == 0 and '<link rel="stylesheet"' not in text
    assert report.stat().st_size < 8e6


@needs_browser
def test_opens_from_disk_without_a_complaint_and_draws(tab, report):
    tab.open(report)
    assert tab.evaluate("document.querySelectorAll('.canvas[data-drawn] svg.main-svg').length") >= 2
    assert (
        tab.evaluate(
            "document.querySelectorAll('.canvas[data-drawn] .scatterlayer .trace path.js-line').length"
        )
        == 6
    )
    tab.evaluate("document.querySelector('details').open = true")
    tab.wait("document.querySelectorAll('.canvas[data-drawn]').length === 3")
    assert tab.problems == []


@needs_browser
def test_a_click_sorts_by_value_and_a_second_one_turns_it_round(tab, report):
    tab.open(report)
    tab.evaluate("document.querySelector('details').open = true")
    names = "[...document.querySelectorAll('tbody tr')].map((row) => row.cells[0].textContent).join(' ')"
    click = "document.querySelectorAll('th button')[1].click()"
    assert tab.evaluate(names) == "ZZ2R MX2R Fcm1 XX2R"
    tab.evaluate(click)
    assert tab.evaluate(names) == "MX2R XX2R ZZ2R Fcm1"
    tab.evaluate(click)
    assert tab.evaluate(names) == "Fcm1 ZZ2R XX2R MX2R"
    assert tab.problems == []


@needs_browser
def test_plots_of_one_recording_zoom_together(tab, report):
    tab.open(report)
    canvases = "document.querySelectorAll('.canvas')"
    tab.evaluate(
        f"Plotly.relayout({canvases}[0], {{'xaxis.range[0]': 5, 'xaxis.range[1]': 7}}).then(() => 1)"
    )
    tab.wait(f"JSON.stringify({canvases}[1].layout.xaxis.range) === '[5,7]'")


@needs_browser
def test_paper_hides_nothing(tab, report):
    tab.open(report)
    tab.evaluate("document.querySelectorAll('tbody tr')[1].hidden = true")
    tab.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert tab.evaluate("document.querySelectorAll('details:not([open])').length") == 0
    assert tab.evaluate("document.querySelectorAll('.canvas svg.main-svg').length") >= 3
    tab.send("Emulation.setEmulatedMedia", media="print")
    paper = {"width": 680, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
    tab.send("Emulation.setDeviceMetricsOverride", **paper)
    parts = "[...document.querySelectorAll('tbody tr, td, figure')]"
    assert tab.evaluate(f"{parts}.filter((part) => !part.getClientRects().length).length") == 0
    assert tab.evaluate("document.documentElement.scrollWidth") <= 680
    tab.send("Emulation.setEmulatedMedia", media="")
    tab.evaluate("dispatchEvent(new Event('afterprint'))")
    assert tab.evaluate("document.querySelectorAll('details:not([open])').length") == 1
    printed = tab.send("Page.printToPDF")["data"]
    assert len(printed) > 10_000 and tab.problems == []


@needs_browser
def test_dark_and_phone(tab, report):
    background = "getComputedStyle(document.body).backgroundColor"
    tab.open(report)
    light = tab.evaluate(background)
    tab.open(report, dark=True)
    assert tab.evaluate(background) != light
    tab.open(report, width=390, phone=True)
    assert tab.evaluate("document.documentElement.scrollWidth") <= 390
    assert tab.problems == []


def test_a_thinned_series_keeps_its_extremes_and_its_gaps():
    rng = np.random.default_rng(5)
    t = np.arange(50_000) / 1000
    y = rng.normal(size=len(t))
    y[12_345], y[40_000:40_200] = 50.0, np.nan
    thin_t, thin_y = envelope(t, y, 300)
    assert len(thin_t) <= 3 * 300
    assert np.nanmax(thin_y) == 50.0 and np.nanmin(thin_y) == np.nanmin(y)
    assert np.isnan(thin_y).any()
    assert np.all(np.diff(thin_t) > 0)
    assert np.isin(thin_t, t).all()


def test_short_series_come_back_whole_and_jumps_are_not_bridged():
    t = np.array([0.0, 0.1, 0.2, 5.0, 5.1])
    assert envelope(t, t, 10)[0] is t
    _, y = with_gaps(t, t)
    assert np.isnan(y).sum() == 1
    assert stretches_for(10_000) == 120
