"""Page of a report: one file that loads no others, for screens, screen readers and paper."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from itertools import pairwise

import pytest

from cli import scenes
from laufruhe.present.tables import Table
from laufruhe.report.document import Bullets, Code, Document, Heading, Illustration, Paragraph
from laufruhe.report.result_report import result_document
from laufruhe.report.web_page import as_html

SVG = '<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"/>'
VOID = {"meta", "img", "br", "link"}


class _Page(HTMLParser):
    """Elements and words of a page; an element that is not closed is an error."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self._open: list[str] = []
        self.feed(text)
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data.strip())

    def all(self, *tags: str) -> list[tuple[str, dict[str, str | None]]]:
        return [element for element in self.elements if element[0] in tags]


@pytest.fixture(scope="module")
def page() -> _Page:
    result = scenes.solved(scenes.TIGHT)
    document = result_document(result, ["polar", "bars"], "laufruhe solve scene.toml")
    return _Page(as_html(document, {"polar": SVG, "bars": SVG}))


def test_the_page_declares_its_language(page: _Page) -> None:
    assert page.elements[0] == ("html", {"lang": "en"})
    assert len(page.all("title")) == len(page.all("main")) == len(page.all("h1")) == 1


def test_headings_are_in_order_and_can_be_gone_to(page: _Page) -> None:
    levels = [int(tag[1]) for tag, _ in page.all("h1", "h2", "h3", "h4")]
    assert levels[0] == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))
    targets = [attrs["id"] for tag, attrs in page.all("h2")]
    assert len(set(targets)) == len(targets)
    assert [attrs["href"] for _, attrs in page.all("a")] == [f"#{target}" for target in targets]


def test_tables_say_what_their_heads_are_of(page: _Page) -> None:
    scopes = [attrs.get("scope") for _, attrs in page.all("th")]
    assert set(scopes) == {"col", "row"}
    assert scopes.count("row") == sum(1 for tag, _ in page.all("tr")) - len(page.all("table"))


def test_pictures_are_described(page: _Page) -> None:
    assert len(page.all("img")) == 2
    for _, attrs in page.all("img"):
        assert (attrs["src"] or "").startswith("data:image/svg+xml;base64,")
        assert len(attrs["alt"] or "") > 20


def test_nothing_is_loaded(page: _Page) -> None:
    for tag, attrs in page.elements:
        assert tag not in {"script", "link", "iframe", "object"}
        for key in ("src", "href", "srcset"):
            assert (attrs.get(key) or "#").startswith(("#", "data:"))
    style = " ".join(page.words)
    assert "url(" not in style
    assert "@import" not in style


def test_light_dark_and_paper_are_provided_for(page: _Page) -> None:
    style = " ".join(page.words)
    assert "prefers-color-scheme: dark" in style
    assert "@media print" in style


def test_both_pages_say_the_same() -> None:
    """Check that every cell and sentence of the Markdown page is on the web page."""
    result = scenes.solved(scenes.TIGHT)
    document = result_document(result, [], "laufruhe solve scene.toml")
    words = " ".join(" ".join(_Page(as_html(document, {})).words).split())
    for line in result_document(result, (), "laufruhe solve scene.toml").as_markdown("").splitlines():
        for cell in line.strip("| ").split(" | "):
            cell_text = re.sub(r"\\(.)", r"\1", cell).lstrip("#- ").strip()
            if cell_text and not cell_text.startswith("```") and not set(cell_text) <= set("-:| "):
                assert cell_text in words, cell_text


def test_tags_in_texts_are_escaped() -> None:
    blocks = (
        Heading("<b>"), Paragraph("<script>alert(1)</script>"), Paragraph("**yes** `a<b`", marked=True),
        Bullets("x", ["<i>"]), Code("a && b"), Illustration("p", 'a "picture"'),
        Table(("<u>",), [("**no**",)], title="t"),
        Table(("h",), [("**no**",)], marked=True),
    )  # fmt: skip
    text = as_html(Document("<h1>", blocks), {"p": SVG})
    assert "<script>" not in text
    assert "<title>&lt;h1&gt;</title>" in text
    assert "<strong>yes</strong> <code>a&lt;b</code>" in text
    assert ">**no**</th>" in text
    assert "<strong>no</strong></th>" in text
    _Page(text)
    assert "\\*\\*no\\*\\*" in Document("t", blocks).as_markdown(".png")
