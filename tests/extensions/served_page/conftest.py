"""A page of a headless Chromium, as pages of reports have it."""

from browser.conftest import browser, opened, page, reached, still

__all__ = ["browser", "opened", "page", "reached", "still"]
