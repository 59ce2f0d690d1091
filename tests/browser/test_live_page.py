"""The live page in a browser: its numbers are those of the exact model, and its controls do what they say."""

from __future__ import annotations

import math
import re

import pytest
from playwright.sync_api import Page

from browser.chromium import serious
from laufruhe.files.reader import load
from laufruhe.present.numbers import number
from laufruhe.problem.evaluation import objective_value
from live.pages import READY, designs, evaluated, model_of, page_of, problem_of

pytestmark = pytest.mark.slow
MEASURES = "values => laufruheLive.page.then(page => (page.setDesign(values), page.drawNow(), page.measures()))"


@pytest.mark.parametrize("name", ["every norm", *READY])
def test_numbers_are_those_of_the_exact_model(page: Page, tmp_path, name):
    problem = problem_of(name)
    model = model_of(problem)
    page.goto(page_of(problem, tmp_path).as_uri())
    for values in designs(model, 6):
        shown = {each["name"]: each["value"] for each in page.evaluate(MEASURES, values)}
        found = evaluated(problem, model, values)
        if problem.objective:
            assert shown["objective"] == pytest.approx(objective_value(problem, found), rel=1e-11)
        told = {name for name, _ in model.unmoved}
        for limit in problem.limits:
            if limit.name not in told:
                value = found.standing(limit).value
                assert shown[limit.name] == pytest.approx(value, rel=1e-11, abs=1e-12)
    assert page.evaluate("laufruheLive.page.then(page => page.error)") < 1e-11


@pytest.fixture
def shown(page: Page, tmp_path):
    page.goto(page_of(problem_of("every norm"), tmp_path).as_uri())
    page.locator("[data-decision]").first.wait_for()
    return page


def test_a_slider_is_moved_by_keys_and_taken_back(shown):
    value = shown.locator("[data-measure=objective]")
    before = value.inner_text()
    slider = shown.locator('[data-decision="web.mass"]')
    slider.focus()
    for _ in range(8):
        shown.keyboard.press("PageUp")
    shown.wait_for_function(
        "before => document.querySelector('[data-measure=objective]').innerText !== before", arg=before
    )
    shown.wait_for_function("decodeURIComponent(location.hash).includes('web.mass=')")
    shown.keyboard.press("Control+z")
    shown.keyboard.press("Control+y")
    for _ in range(8):
        shown.keyboard.press("Control+z")
    shown.wait_for_function(
        "before => document.querySelector('[data-measure=objective]').innerText === before", arg=before
    )


def test_a_link_shows_the_design_and_the_saved_file_is_it(shown):
    shown.evaluate("laufruheLive.page.then(page => page.setDesign({'web.mass': 1.25, 'left.unbalance': 0.0123}))")
    shown.wait_for_function("location.hash.includes('d=')")
    text = shown.evaluate("laufruheLive.page.then(page => page.text())")
    assert 'mass = "1.25 kg"' in text
    assert load(text).decisions == ()
    objective = "document.querySelector('[data-measure=objective]').dataset.value"
    value = shown.evaluate(objective)
    with shown.context.expect_page() as other:
        shown.evaluate("window.open(location.href)")
    other.value.locator("[data-decision]").first.wait_for()
    assert other.value.evaluate(objective) == value


def test_a_broken_limit_is_said(shown):
    shown.evaluate("laufruheLive.page.then(page => page.setDesign({'web.mass': 2}))")
    row = shown.locator('tr[data-measure="counterweight mass"]')
    row.locator("text=broken").wait_for()
    shown.wait_for_function("document.querySelector('[aria-live]').innerText.includes('counterweight mass')")
    assert re.search("Breaks .*(counterweight mass|and [1-9] more)", shown.locator("[data-role=regret]").inner_text())


def test_another_model_keeps_the_sliders_that_it_still_has(shown):
    kept = shown.evaluate("""async () => {
        const page = await laufruheLive.page, model = JSON.parse(document.getElementById("live-model").textContent);
        page.setDesign({"web.mass": 0.5, "left.unbalance": 0.01});
        await page.setModel(model);
        return page.design();
    }""")
    assert kept["web.mass"] == 0.5
    assert kept["left.unbalance"] == 0.01


def test_figures_follow_every_load(shown):
    for choice in shown.locator('[name="Load shown"]').all():
        choice.check(force=True)
        labels = shown.locator(".live-figure svg").evaluate_all("all => all.map(one => one.getAttribute('aria-label'))")
        assert all(len(label) > 20 for label in labels)


def test_axe_finds_nothing_serious(shown):
    assert serious(shown) == []


NUMBERS = [0.0, 1.0, 999.96, 1234.5678, 0.00012345, 9.99e-5, 12345678.9, -3.14159, 1e6, 9999999.0, 0.5]


def test_numbers_are_written_as_in_the_report(shown):
    asked = "laufruheLive.number"
    assert shown.evaluate(f"all => all.map(value => {asked}(value))", NUMBERS) == [number(each) for each in NUMBERS]
    assert math.isclose(float(number(0.5)), 0.5)
