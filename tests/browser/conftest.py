"""A page of a headless Chromium. Playwright's loop runs as long as its browser does, and other tests have loops of
their own: so a browser lives for a module, not for all of them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from browser import chromium


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if chromium.executable() is None:
        pytest.skip(chromium.MISSING)
    with chromium.launched() as started:
        yield started


@pytest.fixture
def reached(browser: Browser) -> Iterator[tuple[Page, list[str]]]:
    """A page, and the addresses that it asked for and was refused."""
    with chromium.watched(browser) as both:
        yield both


@pytest.fixture
def page(reached: tuple[Page, list[str]]) -> Iterator[Page]:
    """A page that fails its test if it asks for anything but files and 127.0.0.1, or raises an error of its own."""
    shown, refused = reached
    errors: list[str] = []
    shown.on("pageerror", lambda error: errors.append(str(error)))
    yield shown
    assert refused == []
    assert errors == []
