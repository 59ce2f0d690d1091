"""The distribution's Chromium, driven by Playwright, and questions to the pages that it shows."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.resources import files
from urllib.parse import urlsplit

from playwright.sync_api import Browser, Page, Route, WebSocketRoute, expect, sync_playwright

# an executable by its path goes before those that the distributions have
CHOSEN = "LAUFRUHE_CHROMIUM"
NAMES = ("chromium", "chromium-browser", "chromium-headless-shell", "google-chrome-stable", "google-chrome")
MISSING = f"no Chromium on this machine: apt-get install chromium, or its path in {CHOSEN}"
# nothing of these schemes leaves the page
INNER = {"file", "data", "blob", "about"}
LOOPBACK = "127.0.0.1"
GRAVE = {"serious", "critical"}
SCREEN = {"width": 1280, "height": 720}
PATIENCE = 120_000
"""Longest wait for any event of a page [ms]."""
expect.set_options(timeout=PATIENCE)


@dataclass(frozen=True)
class Watched:
    """A page, the addresses that it was refused, and the errors that its scripts raised."""

    page: Page
    refused: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def forget(self) -> None:
        self.refused.clear()
        self.errors.clear()


def executable() -> str | None:
    """Return the path of the Chromium of this machine."""
    found = (shutil.which(name) for name in (os.environ.get(CHOSEN, ""), *NAMES) if name)
    return next((path for path in found if path), None)


@contextmanager
def launched() -> Iterator[Browser]:
    """Yield a headless Chromium of this machine."""
    # a sandbox needs a user other than root
    words = ["--disable-gpu", *(["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else [])]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable(), args=words, timeout=PATIENCE)
        yield browser
        browser.close()


def foreign(address: str) -> bool:
    """Return whether an address is neither of the page itself nor of this machine."""
    parts = urlsplit(address)
    return parts.scheme not in INNER and parts.hostname != LOOPBACK


@contextmanager
def watched(browser: Browser, **options: object) -> Iterator[Watched]:
    """Yield a page that reaches files and 127.0.0.1 only."""
    context = browser.new_context(**{"service_workers": "block", "viewport": SCREEN, **options})  # type: ignore[arg-type]
    context.set_default_timeout(PATIENCE)
    seen = Watched(context.new_page())

    def refuse(route: Route) -> None:
        seen.refused.append(route.request.url)
        route.abort()

    def close(route: WebSocketRoute) -> None:
        seen.refused.append(route.url)
        route.close()

    context.route(foreign, refuse)
    context.route_web_socket(foreign, close)
    seen.page.on("pageerror", lambda error: seen.errors.append(str(error)))
    yield seen
    context.close()


def drawn(page: Page) -> None:
    """Wait until the page is drawn: for the frame after the next."""
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def violations(page: Page) -> list[dict[str, object]]:
    """Return the violations that axe finds on the page."""
    if not page.evaluate("() => 'axe' in window"):
        page.evaluate(files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8"))
    # one example of a passed rule is enough
    script = "() => axe.run({ resultTypes: ['violations'] }).then(found => found.violations)"
    return page.evaluate(script)  # type: ignore[no-any-return]


def serious(page: Page) -> list[str]:
    """Return the serious and critical findings of axe: rule, what it asks, and the first elements that break it."""
    return [
        f"{found['id']}: {found['help']}; " + ", ".join(str(node["target"]) for node in found["nodes"][:5])  # type: ignore[index]
        for found in violations(page)
        if found["impact"] in GRAVE
    ]
