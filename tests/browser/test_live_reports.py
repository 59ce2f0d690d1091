"""The live page of reports, used as a reader does: slid, typed, by keys alone, linked to, saved and evaluated."""

from __future__ import annotations

import json
import re
from collections.abc import Collection
from pathlib import Path
from urllib.parse import unquote

import pytest
from playwright.sync_api import Page, expect
from typer.testing import CliRunner

from browser import chromium, pages
from extensions.served_page.live_pages import designs, evaluated, model_of, page_of, problem_of
from laufruhe.cli import app
from laufruhe.files.reader import load
from laufruhe.present.numbers import figure
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import FEASIBILITY_TOL

pytestmark = pytest.mark.slow
STATES, SAVED = 50, 10
"""Slider states of each problem, and of which every how many is saved as a file too."""
FOUR = "tractor-four-lanchester"
PROBLEMS = (FOUR, "vee-six-60", "soft-single-run-up", "tractor-four-bearings")
# as a hand does it: every slider is put somewhere and told so
SLIDE = """async values => {
    for (const range of document.querySelectorAll("input[data-decision]")) {
        const shown = Number(range.max) - Number(range.min), name = range.dataset.decision;
        range.value = Number(range.min) + values[name] * shown;
        range.dispatchEvent(new Event("input", { bubbles: true }));
        range.dispatchEvent(new Event("change", { bubbles: true }));
    }
    const page = await laufruheLive.page;
    page.drawNow();
    const limits = [...document.querySelectorAll("tr[data-measure]")].filter(row => row.dataset.met !== "");
    return {
        design: page.design(), text: page.text(),
        objective: document.querySelector("[data-measure=objective]").innerText,
        limits: Object.fromEntries(limits.map(row => [row.dataset.measure, [row.cells[1].innerText, row.dataset.met]])),
    };
}"""


def printed(problem: Problem, found: Evaluation, names: Collection[str]) -> dict[str, list[str]]:
    """Return the value and state of these limits of a design as a report shows them."""
    stands = {limit: found.check_limit(limit) for limit in problem.limits if limit.name in names}
    return {
        limit.name: [figure(stand.value, limit.measure.unit), str(stand.violation <= FEASIBILITY_TOL).lower()]
        for limit, stand in stands.items()
    }


@pytest.mark.parametrize("name", PROBLEMS)
def test_the_page_shows_the_numbers_of_evaluate(name: str, page: Page, tmp_path: Path) -> None:
    problem = problem_of(name)
    model = model_of(problem)
    page.goto(page_of(problem, tmp_path).as_uri())
    page.locator("[data-decision]").first.wait_for()
    for k, at in enumerate(shares(model, STATES)):
        shown = page.evaluate(SLIDE, at)
        own = evaluated(problem, model, shown["design"])
        assert shown["objective"] == figure(objective_value(problem, own), problem.objective_unit or "")
        assert printed(problem, own, shown["limits"]) == shown["limits"]
        if k % SAVED == 0:
            # the file that is saved, read by the command's own reader
            read = load(shown["text"])
            value = objective_value(read, evaluate(read))
            assert figure(value, read.objective_unit or "") == shown["objective"]


def shares(model: object, count: int) -> list[dict[str, float]]:
    """Return the places of all sliders between their ends; among the first are the ends themselves."""
    found = []
    for values in designs(model, count):  # type: ignore[arg-type]
        at = {}
        for slider in model.sliders:  # type: ignore[attr-defined]
            at[slider.name] = (values[slider.name] - slider.lower) / (slider.upper - slider.lower)
            if slider.width > 1:
                low, high = slider.angles
                at[slider.angle] = (values[slider.angle] - low) / (high - low)
        found.append(at)
    found[0], found[1] = dict.fromkeys(at, 0.0), dict.fromkeys(at, 1.0)
    return found


@pytest.fixture
def solved(page: Page) -> Page:
    """Return the report of the ready four as the command writes it."""
    page.goto(pages.made("solve").as_uri())
    page.locator("[data-decision]").first.wait_for()
    return page


def objective_shown(page: Page) -> str:
    return page.locator("[data-measure=objective]").inner_text()


def test_keys_alone_are_enough(solved: Page) -> None:
    """Check that the keyboard alone reaches and moves a slider, a button and a field."""
    best = objective_shown(solved)

    def to(selector: str) -> None:
        for _ in range(80):
            solved.keyboard.press("Tab")
            if solved.evaluate("selector => document.activeElement.matches(selector)", selector):
                return
        pytest.fail(f"{selector} is reached by no key")

    def back_to(selector: str) -> None:
        for _ in range(80):
            solved.keyboard.press("Shift+Tab")
            if solved.evaluate("selector => document.activeElement.matches(selector)", selector):
                return
        pytest.fail(f"{selector} is reached by no key")

    to('[data-decision="left.unbalance"]')
    for _ in range(3):
        solved.keyboard.press("PageUp")
    expect(solved.locator("[data-measure=objective]")).not_to_have_text(best)
    chromium.drawn(solved)
    worse = objective_shown(solved)
    solved.keyboard.press("End")
    expect(solved.locator("[data-measure=objective]")).not_to_have_text(worse)
    solved.keyboard.press("Control+z")
    expect(solved.locator("[data-measure=objective]")).to_have_text(worse)
    for _ in range(3):
        solved.keyboard.press("Control+z")
    expect(solved.locator("[data-measure=objective]")).to_have_text(best)
    solved.keyboard.press("Control+Shift+z")
    expect(solved.locator("[data-measure=objective]")).not_to_have_text(best)
    back_to('[data-do="given"]')
    solved.keyboard.press("Enter")
    expect(solved.locator("[data-measure=objective]")).to_have_text("893.3 N")
    back_to('[data-do="optimum"]')
    solved.keyboard.press("Space")
    expect(solved.locator("[data-measure=objective]")).to_have_text(best)
    to('[data-number="left.unbalance"]')
    solved.keyboard.press("Control+a")
    solved.keyboard.type("0.02")
    solved.keyboard.press("Enter")
    expect(solved.locator("[data-measure=objective]")).not_to_have_text(best)
    assert solved.evaluate("laufruheLive.page.then(page => page.design()['left.unbalance'])") == pytest.approx(0.02)


def test_a_link_is_the_design(solved: Page) -> None:
    slider = solved.locator('[data-decision="right.unbalance"]')
    slider.focus()
    for _ in range(4):
        slider.press("PageDown")
    name = "right.unbalance"
    last = solved.evaluate("name => laufruheLive.page.then(page => `${name}=${page.design()[name]}`)", name)
    solved.wait_for_function("last => decodeURIComponent(location.hash).includes(last)", arg=last)
    chromium.drawn(solved)
    link, shown = solved.url, objective_shown(solved)
    assert "right.unbalance" in unquote(link)
    other = solved.context.new_page()
    other.goto(link)
    expect(other.locator("[data-measure=objective]")).to_have_text(shown)
    # the same page with another link
    other.goto(link.partition("#")[0] + "#d=right.unbalance=0")
    expect(other.locator("[data-measure=objective]")).not_to_have_text(shown)
    other.close()


def test_a_broken_link_shows_a_design_within_the_bounds(page: Page) -> None:
    """Check a page that is opened by such a link, and links that follow on the open page."""
    for wrong in ("#d=left.unbalance=1e9", "#d=", "#d=left.unbalance=NaN", "#d=%E0%A4%A", "#s3"):
        page.goto(pages.made("solve").as_uri() + wrong)
        page.locator("[data-decision]").first.wait_for()
        chromium.drawn(page)
        assert re.fullmatch(r"[\d.]+ N", objective_shown(page))
        assert 0.0 <= page.evaluate("laufruheLive.page.then(page => page.design()['left.unbalance'])") <= 0.05


def test_the_report_opens_at_the_optimum_and_its_saved_file_is_evaluated_alike(solved: Page, tmp_path: Path) -> None:
    """Check the page as it opens, and that the file of a moved slider evaluates to the values of the page."""
    result = json.loads((pages.made("solve").parent / "result.json").read_text())
    assert objective_shown(solved) == figure(result["objective"]["value"], "N")
    regret = solved.locator("[data-role=regret]")
    assert "optimum" in regret.inner_text()
    assert "proven" in regret.inner_text()
    assert abs(float(regret.get_attribute("data-value") or "nan")) < 5e-5
    slider = solved.locator('[data-decision="front web.mass"]')
    slider.focus()
    for _ in range(6):
        slider.press("PageUp")
    expect(solved.locator("[data-measure=objective]")).not_to_have_text("227.3 N")
    with solved.expect_download() as waiting:
        solved.locator('[data-do="save"]').click()
    path = tmp_path / waiting.value.suggested_filename
    waiting.value.save_as(path)
    answer = CliRunner().invoke(
        app, ["evaluate", str(path), "--no-plots", "--json", str(tmp_path / "x.json"), "--out", str(tmp_path / "out")]
    )
    assert answer.exit_code == 0, answer.output
    result = json.loads((tmp_path / "x.json").read_text())
    assert figure(result["objective"]["value"], "N") == objective_shown(solved)
    own = float(solved.locator("[data-measure=objective]").get_attribute("data-value") or "nan")
    assert result["objective"]["value"] == pytest.approx(own, rel=1e-11)
    row = solved.locator('tr[data-measure="balancer mass"]')
    assert float(row.get_attribute("data-value") or "nan") == pytest.approx(
        result["constraints"][0]["value"], rel=1e-11
    )


def test_without_scripts_the_report_says_what_is_missing(browser: object) -> None:
    context = browser.new_context(java_script_enabled=False)  # type: ignore[attr-defined]
    page = context.new_page()
    page.goto(pages.made("solve").as_uri())
    expect(page.locator("noscript p, main")).to_contain_text(["Scripts are switched off"])
    assert page.locator("table").count() > 3
    context.close()
