"""A page of a headless Chromium. Playwright's loop runs as long as its browser does, and other tests have loops of
their own: so a browser lives for a module, not for all of them; and so does its page, for each is a process."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from browser import chromium
from browser.chromium import Watched


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if chromium.executable() is None:
        pytest.skip(chromium.MISSING)
    with chromium.launched() as started:
        yield started


@pytest.fixture(scope="module")
def opened(browser: Browser) -> Iterator[Watched]:
    with chromium.watched(browser) as seen:
        yield seen


@pytest.fixture
def reached(opened: Watched) -> Iterator[Watched]:
    """Yield a page of the usual size and colours, with the addresses that it requested and was refused."""
    opened.page.set_viewport_size(chromium.SCREEN)
    opened.page.emulate_media(media="null", color_scheme="null")
    yield opened
    opened.forget()


@pytest.fixture
def still(reached: Watched) -> Iterator[Page]:
    """Yield the page that the last test left open.

    The test fails if the page requests anything but files and 127.0.0.1, or raises an error.
    """
    yield reached.page
    assert reached.refused == []
    assert reached.errors == []


@pytest.fixture
def page(still: Page) -> Page:
    """Return an empty page, watched alike."""
    still.goto("about:blank")
    return still
