"""Served page in a browser: the optimum follows, infeasible limits are named, and the page outlives its server."""

from __future__ import annotations

import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

import laufruhe
from browser.chromium import PATIENCE, serious
from laufruhe.extensions.served_page import serving
from laufruhe.extensions.served_page.live import decided
from laufruhe.problem.evaluation import evaluate
from problem_files import PROBLEMS, changed

pytestmark = pytest.mark.slow
# on a slow machine too a search is not cut short
LONGEST = 600.0
RUN = (
    "from laufruhe.cli import main; from laufruhe.extensions.served_page import serving; "
    f"serving.FOLLOWED = {LONGEST}; main()"
)
TEXT = (PROBLEMS / "tractor-four-lanchester.toml").read_text(encoding="utf-8")
TEXT += '\n[[constraints]]\nlimit = "maximum mount force"\nmax = "1500 N"\n'
MASS, FORCE = "constraints.1.max", "constraints.2.max"
INPUTS = Path(__file__).parent / "inputs"


CLAIMS = """() => {
  const place = document.getElementById("claim"), seen = window.claimsSeen = [];
  const isEarlier = () => document.body.className === "earlier";
  const now = () => laufruhePage.state.position;
  const note = () => seen.push({ ...place.dataset, text: place.textContent, isEarlier: isEarlier(), now: now() });
  const all = { attributes: true, childList: true, characterData: true, subtree: true };
  new MutationObserver(note).observe(document.body, all);
}"""
# texts that the page shows as a slider moves, before any answer
AT_ONCE = """([control, value]) => {
  const slider = document.querySelector(`[data-control="${control}"]`);
  slider.value = value;
  slider.dispatchEvent(new Event("input", { bubbles: true }));
  return { text: document.getElementById("claim").textContent, isEarlier: document.body.className === "earlier",
    card: document.querySelector("[data-role=regret]").textContent };
}"""
LAST = 'body:not(.earlier) #claim[data-last="true"]'


@contextmanager
def served(path: Path) -> Iterator[str]:
    """Yield the address of a page, which this process serves."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(serving, "FOLLOWED", LONGEST)
        page = serving.Page(path, 0, LONGEST)
    is_ready = threading.Event()
    running = threading.Thread(target=page.serve, args=(None, is_ready.set), daemon=True)
    running.start()
    try:
        assert is_ready.wait(PATIENCE / 1e3)
        yield page.address
    finally:
        page.server.shutdown()
        running.join(PATIENCE / 1e3)


@contextmanager
def commanded(path: Path) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Yield the address of a page, and the command that serves it."""
    words = [sys.executable, "-c", RUN, "page", str(path), "--no-browser", "--time-limit", "600"]
    running = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert running.stdout is not None
    try:
        yield running.stdout.readline().partition(": ")[2].strip(), running
    finally:
        running.terminate()
        running.wait(PATIENCE / 1e3)
        running.stdout.close()


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("served") / "mine.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def address(file: Path) -> Iterator[str]:
    with served(file) as found:
        yield found


@pytest.fixture
def problem_page(still: Page, address: str) -> Page:
    """Return the page as it is loaded; one of the same address keeps its process, which takes long to start."""
    is_loaded = still.url.partition("#")[0] == address.partition("#")[0]
    still.goto(address)
    if is_loaded:
        still.reload()
    settled(still)
    return still


def settled(page: Page) -> float:
    """Return the value of the whole problem after it is solved."""
    place = page.locator(LAST)
    place.wait_for()
    return float(place.get_attribute("data-value") or "nan")


def slide(page: Page, control: str, value: float) -> None:
    """Move a slider as a mouse does."""
    page.locator(f'[data-control="{control}"]').evaluate(
        "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input', { bubbles: true })); }",
        value,
    )


def live(page: Page) -> float:
    """Return the objective of the design that is shown."""
    return float(page.locator('#live [data-measure="objective"]').get_attribute("data-value") or "nan")


def shows(page: Page, value: float, rel: float) -> None:
    """Wait until the page shows a design with this objective."""
    deadline = time.monotonic() + PATIENCE / 1e3
    while live(page) != pytest.approx(value, rel=rel) and time.monotonic() < deadline:
        page.wait_for_timeout(50)
    assert live(page) == pytest.approx(value, rel=rel)


def solved(path: Path, **values: str) -> float:
    problem = laufruhe.load(path).with_values({name.replace("__", "."): value for name, value in values.items()})
    objective = laufruhe.solve(problem).objective
    assert objective is not None
    return objective.value


def test_the_optimum_follows_a_limit_is_proven_when_it_rests_and_is_saved(
    problem_page: Page, file: Path, tmp_path: Path
) -> None:
    free = settled(problem_page)
    assert free == pytest.approx(solved(file), rel=1e-6)
    # the proven answer soon replaces the estimate, so the page itself notes the estimate
    problem_page.evaluate(CLAIMS)
    slide(problem_page, MASS, 0.5)
    tight = settled(problem_page)
    estimates = [
        float(claim["value"]) for claim in problem_page.evaluate("window.claimsSeen") if claim["kind"] == "estimate"
    ]
    assert estimates[-1] == pytest.approx(tight, rel=2e-3)
    assert tight == pytest.approx(solved(file, constraints__1__max="0.5 kg"), rel=1e-6)
    assert tight > 1.5 * free
    expect(problem_page.locator("#claim")).to_contain_text("proven: no design has less than")
    # weights have moved to that design, and the page's own sum of it is that value
    shows(problem_page, tight, 1e-4)
    expect(problem_page.locator(f'.control:has([data-control="{MASS}"]) .said')).to_contain_text("N per kg")
    with problem_page.expect_download() as download:
        problem_page.locator("#save").click()
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    found = laufruhe.evaluate(path).objective
    assert found is not None
    assert found.value == pytest.approx(tight, rel=1e-4)


def test_limits_that_contradict_each_other_are_marked_and_stay_usable(problem_page: Page) -> None:
    slide(problem_page, FORCE, 600.0)
    slide(problem_page, MASS, 0.2)
    expect(problem_page.locator('#claim[data-kind="no design"]')).to_contain_text(
        "'balancer mass' and 'maximum mount force' contradict each other"
    )
    assert problem_page.locator(".control.conflict").count() == 2
    expect(problem_page.locator(f'[data-control="{MASS}"]')).to_be_enabled()
    slide(problem_page, MASS, 4.0)
    assert settled(problem_page) > 0.0
    assert problem_page.locator(".control.conflict").count() == 0


def test_it_is_used_by_keys_alone(problem_page: Page) -> None:
    before = settled(problem_page)
    slider = problem_page.locator('[data-control="operating_points.1.speed"]')
    for _ in range(60):
        problem_page.keyboard.press("Tab")
        if slider.evaluate("own => own === document.activeElement"):
            break
    expect(slider).to_be_focused()
    for _ in range(3):
        problem_page.keyboard.press("PageUp")
    assert settled(problem_page) > before
    problem_page.keyboard.press("Tab")
    problem_page.keyboard.press("Tab")
    problem_page.keyboard.press("Enter")
    expect(problem_page.locator(".control.changed")).to_have_count(0)
    assert settled(problem_page) == pytest.approx(before, rel=1e-6)


def test_the_state_is_in_the_address_and_the_token_is_not(problem_page: Page, address: str) -> None:
    slide(problem_page, "engine.rod_ratio", 0.3)
    tight = settled(problem_page)
    assert address.partition("#t=")[2] not in problem_page.url
    assert "rod_ratio" in problem_page.url
    problem_page.reload()
    assert settled(problem_page) == pytest.approx(tight, rel=1e-9)
    problem_page.locator("#back").click()
    assert settled(problem_page) != pytest.approx(tight, rel=1e-3)
    assert "rod_ratio" not in problem_page.url


def test_a_visitor_without_the_token_gets_a_message(page: Page, address: str) -> None:
    # a tab keeps what it was told
    other = page.context.new_page()
    other.goto(address.partition("#")[0])
    expect(other.locator("#complaint")).to_contain_text("open the page by the address that laufruhe printed")
    other.close()


def test_refused_settings_keep_the_last_valid_result_and_mark_it(problem_page: Page) -> None:
    value = settled(problem_page)
    figure = problem_page.locator('[data-number-of="engine.rod_ratio"]')
    figure.fill("1.4")
    figure.press("Enter")
    expect(problem_page.locator("#complaint")).to_contain_text("engine.rod_ratio")
    expect(problem_page.locator("#claim")).to_contain_text("Last valid settings: Optimum")
    expect(problem_page.locator("[data-role=regret]")).to_have_text("Last valid settings; the new ones are refused.")
    assert float(problem_page.locator("#claim").get_attribute("data-value") or "nan") == value
    figure.fill("0.27")
    figure.press("Enter")
    expect(problem_page.locator("#complaint")).to_be_hidden()
    assert settled(problem_page) > 0.0


def test_two_designs_stand_side_by_side(problem_page: Page) -> None:
    first = settled(problem_page)
    problem_page.locator("#keep").click()
    assert serious(problem_page) == []
    slide(problem_page, MASS, 0.5)
    second = settled(problem_page)
    shows(problem_page, second, 1e-4)
    row = problem_page.locator("#compared tr").nth(1).inner_text()
    a, b = re.findall(r"([\d.]+) N", row)
    assert (float(a), float(b)) == pytest.approx((first, second), rel=1e-3)
    assert problem_page.locator("#kept svg").count() >= 3
    problem_page.locator("#show-a").click()
    assert settled(problem_page) == pytest.approx(first, rel=1e-6)


def test_the_front_fills_in_and_a_point_is_a_design(problem_page: Page) -> None:
    problem_page.locator("#across").select_option("balancer mass")
    problem_page.locator("#draw").click()
    expect(problem_page.locator("#front-state")).to_contain_text("done")
    assert problem_page.locator("#front circle").count() >= 20
    point = problem_page.locator("#front circle").nth(10)
    label = point.get_attribute("aria-label") or ""
    point.focus()
    problem_page.keyboard.press("Enter")
    value = re.search(r": ([\d.]+) N;", label)
    assert value is not None
    shows(problem_page, float(value[1]), 2e-3)
    expect(problem_page.locator("#follows")).not_to_be_checked()


def test_the_engine_turns(problem_page: Page) -> None:
    before = problem_page.locator("#engine").inner_html()
    problem_page.locator("#turn").click()
    problem_page.wait_for_function("before => document.getElementById('engine').innerHTML !== before", arg=before)
    problem_page.locator("#turn").click()
    assert problem_page.locator("#engine .piston").count() >= 8


def test_it_watches_the_file_and_its_trace_and_outlives_the_server(page: Page, tmp_path: Path) -> None:
    path, trace = tmp_path / "own.toml", tmp_path / "page-trace.csv"
    text = re.sub(r"\[gas\]\n(?:.+\n)+", '[gas]\nmodel = "trace"\nfile = "page-trace.csv"\n', TEXT)
    head, *rows = (INPUTS / trace.name).read_text(encoding="utf-8").splitlines()
    lower = [f"{angle},{0.5 * float(pressure)}" for angle, pressure in (row.split(",") for row in rows)]
    path.write_text(text, encoding="utf-8")
    trace.write_text("\n".join([head, *rows]), encoding="utf-8")
    with commanded(path) as (address, server):
        page.goto(address)
        before = settled(page)
        trace.write_text("\n".join([head, *lower]), encoding="utf-8")
        page.wait_for_function("() => laufruhePage.state.version === 2")
        after = settled(page)
        assert after == pytest.approx(solved(path), rel=1e-6)
        assert after != pytest.approx(before, rel=0.05)
        before = after
        path.write_text(changed(text, '"2500 rpm"', "2500 rpm"), encoding="utf-8")
        expect(page.locator("#banner")).to_contain_text("is no TOML")
        expect(page.locator("#banner")).to_contain_text("line 22")
        slide(page, MASS, 0.9)
        assert settled(page) > 0.0
        path.write_text(changed(text, '"2500 rpm"', '"3000 rpm"'), encoding="utf-8")
        expect(page.locator("#banner")).to_be_hidden()
        expect(page.locator('[data-number-of="operating_points.1.speed"]')).to_have_value("3000")
        assert settled(page) > before
        server.kill()
        expect(page.locator("#banner[data-gone]")).to_contain_text("laufruhe page own.toml")
        expect(page.locator(f'[data-control="{MASS}"]')).to_be_disabled()
        value = live(page)
        weight = page.locator('#live [data-decision="left.unbalance"]')
        weight.focus()
        for _ in range(5):
            page.keyboard.press("PageUp")
        deadline = time.monotonic() + PATIENCE / 1e3
        while live(page) == value and time.monotonic() < deadline:
            page.wait_for_timeout(50)
        assert live(page) > value


def test_limits_of_a_run_up_are_measured_when_sliders_rest(page: Page) -> None:
    path = PROBLEMS / "soft-single-run-up.toml"
    with served(path) as address:
        page.goto(address)
        settled(page)
        twist = page.locator('tr[data-measure="run-up twist"]')
        expect(twist).to_contain_text("kept")
        weight = page.locator('#live [data-decision="web.mass"]')
        weight.focus()
        for _ in range(6):
            page.keyboard.press("PageUp")
        expect(twist).to_contain_text("broken")
        expect(page.locator("[data-role=regret]")).to_contain_text("Breaks run-up twist")
        design = page.evaluate("laufruhePage.state.handle.design()")
        shown_value = float(twist.get_attribute("data-value") or "nan")
    problem = laufruhe.load(path)
    values = decided(problem, design)
    built = evaluate(problem, problem.design([values[decision.name] for decision in problem.decisions]))
    assert shown_value == pytest.approx(built.check_limit(problem.limits[0]).value, rel=1e-9)


def test_on_a_phone_the_optimum_stays_in_sight_groups_are_folded_and_pictures_keep_their_letters(
    page: Page, address: str
) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    page.goto(address)
    settled(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    speed = page.locator('[data-control="operating_points.1.speed"]')
    expect(speed).to_be_hidden()
    page.get_by_text("3 numbers").click()
    expect(speed).to_be_visible()
    page.evaluate("scrollTo(0, 1500)")
    expect(page.locator("#claim")).to_be_in_viewport()
    page.locator("#picture").click()
    # all of them, however many a result has
    expect(page.locator("#pictures-state")).to_contain_text(re.compile(r"^(\d+) of \1$"))
    image = page.locator("#drawn img").first
    image.scroll_into_view_if_needed()
    assert image.evaluate("(drawn) => drawn.clientWidth") > 600
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert serious(page) == []


def test_a_crank_is_clicked_and_given_back_and_a_ranking_says_what_it_is_about(page: Page) -> None:
    with served(PROBLEMS / "vee-eight-open.toml") as address:
        page.goto(address)
        best = settled(page)
        expect(page.locator("#ranking li")).to_have_count(5)
        chosen = page.locator("#ranking li").nth(1).locator("button").first
        chosen.click()
        second = settled(page)
        assert second > 1.05 * best
        expect(chosen).to_have_attribute("aria-pressed", "true")
        assert "star" in page.url
        page.locator("#crank-free").click()
        assert settled(page) == pytest.approx(best, rel=1e-6)
        said = page.locator("fieldset:has(#ranking) .said")
        expect(said).to_have_text("Best cranks found, each with its best values of all other open numbers:")
        slide(page, "engine.rod_ratio", 0.2)
        expect(said).to_have_text("Ranked for earlier settings:")
        settled(page)
        expect(said).to_have_text("Best cranks found, each with its best values of all other open numbers:")


def test_claims_of_earlier_settings_are_marked_in_the_moment_a_slider_moves(problem_page: Page) -> None:
    assert problem_page.locator("#claim").inner_text().startswith("Optimum ")
    for control, values in ((MASS, (0.5, 3.0)), ("operating_points.1.speed", (2600.0, 3000.0))):
        for value in values:
            seen = problem_page.evaluate(AT_ONCE, [control, value])
            assert seen["isEarlier"]
            assert seen["text"].startswith("Earlier settings: ")
            assert seen["card"].startswith("Earlier settings; ")
        settled(problem_page)
        assert problem_page.locator("#claim").inner_text().startswith("Optimum ")
        assert "proven optimum" in problem_page.locator("[data-role=regret]").inner_text()


def test_no_claim_is_shown_for_settings_that_it_is_not_about(problem_page: Page) -> None:
    """Check claims while a slider moves faster than answers come."""
    problem_page.evaluate(CLAIMS)
    for k in range(12):
        slide(problem_page, "engine.rod_ratio", 0.2 + 0.01 * k)
        problem_page.wait_for_timeout(25)
    settled(problem_page)
    seen = problem_page.evaluate("window.claimsSeen")
    assert {claim["isEarlier"] for claim in seen} == {True, False}
    assert all(claim["text"].startswith("Earlier settings: ") == claim["isEarlier"] for claim in seen)
    # a strong claim that bears no mark is about the settings that stood in that moment
    strong = [claim for claim in seen if claim["kind"] == "proven" and not claim["isEarlier"]]
    assert strong
    assert all(int(claim["position"]) == claim["now"] for claim in strong)
    weak = [claim["text"] for claim in seen if claim["kind"] in ("estimate", "held")]
    assert weak
    assert not any(word in text for text in weak for word in ("ptimum", "no design", "proven", "gap"))


def typed(page: Page, text: str) -> Locator:
    """Enter a limit on the mass as a hand does."""
    figure = page.locator(f'[data-number-of="{MASS}"]')
    figure.click()
    figure.press("Control+a")
    page.keyboard.press("Delete")
    page.keyboard.type(text)
    page.keyboard.press("Enter")
    return figure


def test_a_comma_is_a_decimal_sign(problem_page: Page) -> None:
    for text, taken in (("2,5", "2.5"), ("3", "3"), ("2.5", "2.5"), (",5", "0.5"), ("0,125", "0.125")):
        expect(typed(problem_page, text)).to_have_value(taken)
        assert problem_page.evaluate("name => laufruhePage.state.edits.get(name)[2]", MASS) == f"{taken} kg"


def test_ambiguous_and_unreadable_numbers_are_refused(problem_page: Page) -> None:
    value = settled(problem_page)
    for text, said in (
        ("1,500", '"1,500" can be read as 1500 or as 1.500'), ("2..5", '"2..5" is no number'),
        ("2 kg", '"2 kg" is no number'), ("", '"" is no number'), ("1,5,0", '"1,5,0" is no number'),
    ):  # fmt: skip
        figure = typed(problem_page, text)
        expect(problem_page.locator("#complaint")).to_contain_text(said)
        expect(problem_page.locator("#complaint")).to_contain_text("It stays at 4 kg")
        expect(figure).to_have_attribute("aria-invalid", "true")
        assert problem_page.evaluate("laufruhePage.state.edits.size") == 0
        assert settled(problem_page) == value


def test_a_broken_limit_is_marked_as_soon_as_the_slider_has_moved(page: Page) -> None:
    with served(INPUTS / "held-mounts-break-sag.toml") as address:
        page.goto(address)
        claim = page.locator("#claim")
        expect(claim).to_have_attribute("data-kind", "held")
        expect(claim).to_contain_text("breaks static sag (2.501 mm, at most 1.800 mm)")
        expect(page.locator('tr[data-measure="static sag"]')).to_contain_text("broken")
        expect(page.locator(".control.broken .said")).to_have_text("broken: 2.501 mm, at most 1.800 mm")
        slide(page, "constraints.2.max", 2.6)
        expect(claim).not_to_contain_text("breaks")
        expect(page.locator('tr[data-measure="static sag"]')).to_contain_text("kept")
        slide(page, "constraints.2.max", 2.4)
        expect(claim).to_contain_text("breaks static sag (2.501 mm, at most 2.400 mm)")
        expect(page.locator('tr[data-measure="static sag"]')).to_contain_text("broken")
