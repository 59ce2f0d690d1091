"""Live page in a browser: its numbers are those of the exact model, and its controls work."""

from __future__ import annotations

import math
import re

import pytest
from playwright.sync_api import Browser, Page, expect

from browser import chromium
from browser.chromium import serious
from extensions.served_page.live_pages import designs, evaluated, model_of, page_of, problem_of, with_unknown_norm
from laufruhe.present.numbers import number
from laufruhe.problem.evaluation import objective_value

pytestmark = pytest.mark.slow
MEASURES = "values => laufruheLive.page.then(page => (page.setDesign(values), page.drawNow(), page.measures()))"


@pytest.mark.parametrize("name", ["every norm", "geared-inertia"])
def test_numbers_are_those_of_the_exact_model(page: Page, tmp_path, name):
    problem = problem_of(name)
    model = model_of(problem)
    page.goto(page_of(problem, tmp_path).as_uri())
    for values in designs(model, 4):
        live_page = {each["name"]: each["value"] for each in page.evaluate(MEASURES, values)}
        result = evaluated(problem, model, values)
        if problem.objective:
            assert live_page["objective"] == pytest.approx(objective_value(problem, result), rel=1e-11)
        exact_limits = {name for name, _ in model.without_slider}
        for limit in problem.limits:
            if limit.name not in exact_limits:
                value = result.check_limit(limit).value
                assert live_page[limit.name] == pytest.approx(value, rel=1e-11, abs=1e-12)
    assert page.evaluate("laufruheLive.page.then(page => page.checked)") < 1e-11


@pytest.fixture(scope="module")
def every(browser: Browser, tmp_path_factory):
    """Yield one page for all tests; a new model removes what a test changed."""
    with chromium.watched(browser) as seen:
        seen.page.goto(page_of(problem_of("every norm"), tmp_path_factory.mktemp("live")).as_uri())
        seen.page.locator("[data-decision]").first.wait_for()
        yield seen.page
        assert seen.refused == []


@pytest.fixture
def live_page(every: Page):
    every.evaluate("laufruheLive.page.then(page => (page.set(page.given), page.drawNow()))")
    return every


@pytest.mark.parametrize("width", [420, 500, 700, 1280])
def test_paths_of_all_mounts_are_of_one_size(live_page, width):
    """Check equal sizes of all paths, also in a last row with fewer."""
    usual = live_page.viewport_size
    live_page.set_viewport_size({"width": width, "height": 900})
    widths = live_page.evaluate("[...document.querySelectorAll('.live-polar svg')].map(svg => svg.clientWidth)")
    live_page.set_viewport_size(usual)
    assert len(widths) > 2
    assert max(widths) - min(widths) <= 1


def test_a_broken_limit_is_said(live_page):
    live_page.evaluate("laufruheLive.page.then(page => page.setDesign({'web.mass': 2}))")
    row = live_page.locator('tr[data-measure="counterweight mass"]')
    row.locator("text=broken").wait_for()
    live_page.wait_for_function("document.querySelector('[aria-live]').innerText.includes('counterweight mass')")
    assert re.search(
        "Breaks .*(counterweight mass|and [1-9] more)", live_page.locator("[data-role=regret]").inner_text()
    )


@pytest.mark.parametrize(("mass", "met"), [(1.0 + 9e-6, "true"), (1.0 + 2e-5, "false")])
def test_a_limit_is_broken_beyond_the_tolerance_of_solvers(live_page, mass, met):
    live_page.evaluate(f"laufruheLive.page.then(page => page.setDesign({{'web.mass': {mass!r}}}))")
    live_page.locator(f'tr[data-measure="counterweight mass"][data-met={met}]').wait_for()


def test_limits_that_do_not_follow_stand_as_in_the_design_of_the_report(page: Page, tmp_path):
    page.goto(page_of(problem_of("soft-single-run-up"), tmp_path).as_uri())
    twist = page.locator('tr[data-measure="run-up twist"]')
    twist.locator("text=broken").wait_for()
    page.locator("text=/Breaks run-up twist/").wait_for()
    page.evaluate("laufruheLive.page.then(page => page.setDesign({'web.mass': 0.4}))")
    twist.locator("text=cannot be followed live").wait_for()


def test_a_norm_that_the_page_does_not_know_leaves_the_rest_at_work(still: Page, tmp_path):
    problem = with_unknown_norm(problem_of("every norm"))
    model = model_of(problem)
    still.goto(page_of(problem, tmp_path).as_uri())
    still.locator("[data-decision]").first.wait_for()
    for values in designs(model, 3):
        live_page = {each["name"]: each["value"] for each in still.evaluate(MEASURES, values)}
        result = evaluated(problem, model, values)
        assert live_page["objective"] is None
        for limit in problem.limits[1:]:
            assert live_page[limit.name] == pytest.approx(result.check_limit(limit).value, rel=1e-11, abs=1e-12)
    expect(still.locator("[data-role=regret]")).to_contain_text("The objective cannot be followed live.")
    row = still.locator('tr[data-measure="worst twentieth mount force"]')
    expect(row).to_contain_text("cannot be followed live")
    expect(still.locator(".live-notes")).to_contain_text("worst twentieth mount force: cannot be followed live")
    assert still.locator(".live-polar path.now").count() == 4


@pytest.mark.parametrize(
    ("typed", "taken"), [("1,5", 1.5), ("0,125", 0.125), (" 1.25 ", 1.25), ("1e0", 1.0), ("9", 2.0)]
)
def test_a_typed_comma_is_a_decimal_sign(live_page, typed, taken):
    field = live_page.locator('[data-number="web.mass"]')
    field.fill(typed)
    field.press("Enter")
    assert live_page.evaluate("laufruheLive.page.then(page => page.design()['web.mass'])") == pytest.approx(taken)
    expect(field).not_to_have_attribute("aria-invalid", "true")


def test_a_redraw_keeps_the_text_of_a_field_that_is_being_typed_in(live_page):
    field = live_page.locator('[data-number="web.mass"]')
    field.fill("1.25")
    live_page.evaluate("laufruheLive.page.then(page => (page.setDesign({'web.mass': 0.5}), page.drawNow()))")
    assert field.input_value() == "1.25"
    field.press("Enter")
    assert live_page.evaluate("laufruheLive.page.then(page => page.design()['web.mass'])") == pytest.approx(1.25)


def test_a_field_left_as_it_was_shows_the_design(live_page):
    field = live_page.locator('[data-number="web.mass"]')
    before = field.input_value()
    field.fill("1.25")
    field.fill(before)
    live_page.evaluate("laufruheLive.page.then(page => (page.setDesign({'web.mass': 0.5}), page.drawNow()))")
    field.blur()
    assert float(field.input_value()) == 0.5


@pytest.mark.parametrize("typed", ["1,500", "1,2,3", "one", "", "1.2.3", "NaN", "0x10", "Infinity"])
def test_a_typed_text_that_is_no_number_is_refused_in_one_line(live_page, typed):
    before = live_page.evaluate("laufruheLive.page.then(page => page.design()['web.mass'])")
    field = live_page.locator('[data-number="web.mass"]')
    field.fill("1.1")
    field.fill(typed)
    field.press("Enter")
    expect(live_page.locator(".live-controls > .live-note")).to_contain_text(f'web.mass: "{typed}"')
    expect(field).to_have_attribute("aria-invalid", "true")
    assert live_page.evaluate("laufruheLive.page.then(page => page.design()['web.mass'])") == before


def test_another_model_keeps_the_sliders_that_it_still_has(live_page):
    numbers = live_page.evaluate("""async () => {
        const page = await laufruheLive.page, model = JSON.parse(document.getElementById("live-model").textContent);
        page.setDesign({"web.mass": 0.5, "left.unbalance": 0.01});
        await page.setModel(model);
        return page.design();
    }""")
    assert numbers["web.mass"] == 0.5
    assert numbers["left.unbalance"] == 0.01


def test_figures_follow_every_load(live_page):
    for choice in live_page.locator('[name="Load shown"]').all():
        choice.check(force=True)
        labels = live_page.locator(".live-figure svg").evaluate_all(
            "all => all.map(one => one.getAttribute('aria-label'))"
        )
        assert all(len(label) > 20 for label in labels)


def test_axe_finds_nothing_serious(live_page):
    assert serious(live_page) == []


NUMBERS = [0.0, 1.0, 999.96, 1234.5678, 0.00012345, 9.99e-5, 12345678.9, -3.14159, 1e6, 9999999.0, 0.5]


def test_numbers_are_written_as_in_the_report(live_page):
    script = "laufruheLive.number"
    assert live_page.evaluate(f"all => all.map(value => {script}(value))", NUMBERS) == [
        number(each) for each in NUMBERS
    ]
    assert math.isclose(float(number(0.5)), 0.5)
