"""Reports and the documentation in a browser: read by weak eyes, by ear, in the dark and on paper."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Page

from browser import pages
from browser.chromium import Watched, serious

pytestmark = pytest.mark.slow

# width of A4 paper inside margins of 15 mm [CSS pixels]: upright, and lying for wide tables
UPRIGHT, LYING = 680, 1009
BEYOND = f"""() => [...document.querySelectorAll("main *")].flatMap(element => {{
    const edge = element.closest(".wide") ? {LYING} : {UPRIGHT};
    const right = element.getBoundingClientRect().right;
    return right > edge + 1 ? [`${{element.tagName}} ${{right}} ${{element.textContent.slice(0, 60)}}`] : [];
}})"""
COLOURS = """selector => {
    const colour = text => text.match(/[\\d.]+/g).map(Number);
    const linear = v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
    const lit = rgb => [0.2126, 0.7152, 0.0722].reduce((sum, share, k) => sum + share * linear(rgb[k] / 255), 0);
    return [...document.querySelectorAll(selector)].map(element => {
        const own = getComputedStyle(element);
        return [lit(colour(own.color)), lit(colour(getComputedStyle(document.body).backgroundColor))];
    });
}"""


@pytest.fixture(params=pages.MAKERS, scope="module")
def loaded(request: pytest.FixtureRequest, opened: Watched) -> str:
    """Return a page of every kind that commands make."""
    opened.page.goto(pages.made(request.param).as_uri())
    return opened.page.url


@pytest.fixture
def report_page(loaded: str, still: Page) -> Page:
    if still.url != loaded:
        still.goto(loaded)
    return still


def test_reports_have_no_serious_finding(report_page: Page) -> None:
    for scheme in ("light", "dark"):
        report_page.emulate_media(color_scheme=scheme)
        assert serious(report_page) == [], scheme


def test_reports_fit_on_paper(report_page: Page) -> None:
    report_page.set_viewport_size({"width": UPRIGHT, "height": 1000})
    report_page.emulate_media(media="print")
    assert report_page.evaluate(BEYOND) == []


def test_paper_is_white_and_its_letters_dark(report_page: Page) -> None:
    """Check the printed page on a dark screen too."""
    report_page.emulate_media(media="print", color_scheme="dark")
    seen = report_page.evaluate(COLOURS, "h1, h2, p, a, th, td, figcaption")
    assert seen
    for ink, paper in seen:
        assert paper == 1.0
        assert (paper + 0.05) / (ink + 0.05) >= 7.0
    # grounds of their own that are printed are light too
    assert serious(report_page) == []
    assert report_page.evaluate("() => [...document.images].map(image => getComputedStyle(image).filter)") == [
        "none"
    ] * len(report_page.locator("img").all())


def test_the_dark_page_is_dark(report_page: Page) -> None:
    report_page.emulate_media(color_scheme="dark")
    for ink, ground in report_page.evaluate(COLOURS, "h1, p, a"):
        assert (ink + 0.05) / (ground + 0.05) >= 4.5


def test_a_phone_moves_nothing_but_tables_and_pictures(report_page: Page) -> None:
    report_page.set_viewport_size({"width": 390, "height": 800})
    assert report_page.evaluate("document.documentElement.scrollWidth") <= 390


def test_wide_tables_lie_on_paper_of_their_own(page: Page, tmp_path: Path) -> None:
    page.goto(pages.made("everything").as_uri())
    sheet = page.pdf(prefer_css_page_size=True)
    boxes = {part.split(b"]")[0].strip() for part in sheet.split(b"/MediaBox [")[1:]}
    sizes = {tuple(float(number) > 700 for number in box.split()[2:]) for box in boxes}
    assert sizes == {(False, True), (True, False)}


@pytest.mark.parametrize("name", pages.SITE)
def test_the_documentation_has_no_serious_finding(name: str, page: Page) -> None:
    pytest.importorskip("furo", reason="the tools of the documentation are not installed")
    page.goto((pages.site() / f"{name}.html").as_uri())
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        assert serious(page) == [], scheme


def test_only_what_is_wider_than_the_screen_says_so(report_page: Page) -> None:
    """Check that on a phone each wide picture and table, and nothing else, says that it scrolls."""
    report_page.emulate_media(media="screen")
    report_page.set_viewport_size({"width": 390, "height": 800})
    # a timeline of scrolling is measured with the next frame
    report_page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    words = "part => parseFloat(getComputedStyle(part, '::before').fontSize) > 0"
    moved = "part => part.scrollWidth > part.clientWidth"
    said, wide = (report_page.evaluate(f"[...document.querySelectorAll('.scroll')].map({f})") for f in (words, moved))
    assert said == wide
    assert any(wide)
