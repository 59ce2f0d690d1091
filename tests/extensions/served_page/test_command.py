"""The command that serves a page: refused input, printed text, and its end."""

from __future__ import annotations

import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from typer.testing import CliRunner, Result

from laufruhe.cli import app
from laufruhe.extensions.served_page.guard import TOKEN
from problem_files import PROBLEMS

LANCHESTER = PROBLEMS / "tractor-four-lanchester.toml"
# on a slow machine too it has the time to say how it ended
RUN = "import laufruhe.cli.supervised as own; own.PATIENCE = 300; from laufruhe.cli import main; main()"
LONG = 300.0


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["page", *map(str, words), "--no-browser"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-"], "standard input"),
        ([LANCHESTER, "--port", "0"], "--port = 0: must be a whole number"),
        ([LANCHESTER, "--port", "65536"], "--port"),
        ([LANCHESTER, "--for", "-1"], "--for = -1: must be a number above zero"),
        ([LANCHESTER, "--time-limit", "nan"], "--time-limit"),
        (["missing.toml"], "does not exist"),
        ([PROBLEMS / "tractor-sweeps.toml"], "use laufruhe study"),
    ],
)
def test_bad_input_is_refused_in_a_line(words: list[object], said: str) -> None:
    result = run(*words)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert said in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_port_in_use_is_said_to_be() -> None:
    with closing(socket.socket()) as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        result = run(LANCHESTER, "--port", other.getsockname()[1])
    assert result.exit_code == 2
    assert "is in use; name another port, or leave --port out" in result.stderr


def answer(address: str, path: str, body: object) -> dict[str, object]:
    parts = urlsplit(address)
    headers = {
        TOKEN: parts.fragment.removeprefix("t="),
        "Origin": f"http://{parts.netloc}",
        "Content-Type": "application/json",
    }
    with closing(http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=LONG)) as connection:
        connection.request("POST", path, json.dumps(body), headers)
        return json.loads(connection.getresponse().read())  # type: ignore[no-any-return]


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs another process")
def test_a_page_is_served_until_it_is_interrupted(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(LANCHESTER.read_bytes())
    words = [sys.executable, "-c", RUN, "page", str(path), "--no-browser"]
    running = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert running.stdout is not None
    address = running.stdout.readline().partition(": ")[2].strip()
    answered = answer(address, "/begin", {})
    assert (answered["title"], answered["file"]) == ("Tractor four-cylinder with a Lanchester balancer", "mine.toml")
    result = answer(address, "/follow", {"edits": [["set", "constraints.1.max", "0.5 kg"]]})
    assert result["claim"]["kind"] == "estimate"
    running.send_signal(signal.SIGINT)
    began = time.monotonic()
    _, err = running.communicate(timeout=LONG)
    assert running.returncode == 130
    assert err == "laufruhe: the page is no longer served\n"
    assert time.monotonic() - began < 120.0
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.slow
def test_a_page_may_end_by_itself() -> None:
    words = [sys.executable, "-c", RUN, "page", str(LANCHESTER), "--no-browser", "--for", "0.5"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=LONG, check=False)
    assert done.returncode == 0
    assert done.stdout.startswith(f"{LANCHESTER}: http://127.0.0.1:")
    assert done.stderr == ""


def test_a_browser_is_started_with_a_ticket_and_not_with_the_token(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: bool(opened.append(address)))
    result = CliRunner().invoke(app, ["page", str(LANCHESTER), "--for", "0.3"])
    assert result.exit_code == 0
    assert "No browser could be started" in result.stderr
    token = result.stdout.partition("#t=")[2].split()[0]
    assert len(opened) == 1
    assert token not in opened[0]
    assert opened[0].partition("#o=")[0] == result.stdout.partition(": ")[2].partition("#t=")[0]
