"""Base of the tests of pages: no request leaves the machine, and errors of a page are found."""

from __future__ import annotations

import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
from playwright.sync_api import Page

from browser import chromium
from browser.chromium import Watched, foreign, serious

pytestmark = pytest.mark.slow
GREY = '<html lang="en"><title>t</title><main><h1 style="color: #aaa; background: #fff">faint</h1></main>'


class _Answer(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Access-Control-Allow-Origin", "*")
        self.end_headers()
        self.wfile.write(b"answer")

    def log_message(self, *words: object) -> None:
        pass


@pytest.fixture
def address() -> object:
    with HTTPServer(("127.0.0.1", 0), _Answer) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()
        thread.join()


def test_only_files_and_this_machine_are_reached(reached: Watched, address: str, tmp_path: Path) -> None:
    page, refused = reached.page, reached.refused
    path = tmp_path / "page.html"
    asks = 'new WebSocket("ws://192.0.2.1/b"); fetch("http://192.0.2.2/c").catch(() => 0)'
    path.write_text(f'<img src="https://example.org/a.png"><script>{asks}</script>')
    page.goto(path.as_uri())
    assert page.evaluate("address => fetch(address).then(answer => answer.text())", address) == "answer"
    page.wait_for_load_state("networkidle")
    assert sorted(refused) == ["http://192.0.2.2/c", "https://example.org/a.png", "ws://192.0.2.1/b"]


@pytest.mark.parametrize("url", ["http://127.0.0.1.example.org/", "https://a/", "ws://192.0.2.1/"])
def test_other_machines_are_foreign(url: str) -> None:
    assert foreign(url)


@pytest.mark.parametrize("url", ["http://127.0.0.1:80/x", "file:///x", "data:,x"])
def test_this_machine_is_not(url: str) -> None:
    assert not foreign(url)


def test_axe_finds_what_cannot_be_read(page: Page) -> None:
    page.set_content(GREY)
    assert [found.partition(":")[0] for found in serious(page)] == ["color-contrast"]
    page.set_content(GREY.replace("#aaa", "#333"))
    assert serious(page) == []


def test_missing_chromium_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv(chromium.CHOSEN, raising=False)
    assert chromium.executable() is None
    (tmp_path / "own").touch(mode=0o755)
    monkeypatch.setenv(chromium.CHOSEN, str(tmp_path / "own"))
    assert chromium.executable() == str(tmp_path / "own")
