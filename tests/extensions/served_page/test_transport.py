"""Access to the server and the size of what it reads, over real connections."""

from __future__ import annotations

import http.client
import json
import socket
import threading
from collections.abc import Iterator
from contextlib import closing

import pytest

from laufruhe.extensions.served_page.guard import HEADERS, TOKEN
from laufruhe.extensions.served_page.transport import MAX_BYTES, HttpAnswer, HttpRequest, Server

SECRET = "the problem"
PATIENCE = 60.0


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    made = Server(0, {"page.html": "<!doctype html>", "page.js": "0", "page.css": "p {}"})
    made.handles["/told"] = lambda body: HttpAnswer(json.dumps({"told": SECRET, "asked": body}))
    made.handles["/lines"] = lambda _: HttpAnswer(lines=iter(["1", "2"]))
    thread = threading.Thread(target=made.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    yield made
    made.shutdown()
    thread.join()
    made.server_close()


def request(
    server: Server, path: str = "/told", body: bytes = b"{}", method: str = "POST", **changes: str | None
) -> tuple[http.client.HTTPResponse, bytes]:
    host = server.guard.hosts[0]
    headers = {
        "Host": host, "Origin": f"http://{host}", TOKEN: server.guard.token, "Content-Type": "application/json",
        "Content-Length": str(len(body)),
    }  # fmt: skip
    headers.update({name.replace("_", "-"): value for name, value in changes.items() if value is not None})
    for name in (name for name, value in changes.items() if value is None):
        headers.pop(name.replace("_", "-"))
    with closing(http.client.HTTPConnection("127.0.0.1", server.port, timeout=PATIENCE)) as connection:
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders(body)
        answer = connection.getresponse()
        return answer, answer.read()


def test_a_request_with_the_token_is_answered(server: Server) -> None:
    answer, body = request(server)
    assert answer.status == 200
    assert json.loads(body) == {"told": SECRET, "asked": {}}
    assert {name: answer.headers[name] for name in HEADERS} == dict(HEADERS)
    assert "Python" not in str(answer.headers)


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({"Host": "evil.example"}, 403),
        ({"Host": "127.0.0.1"}, 403),
        ({"Host": None}, 403),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": None}, 403),
        ({"Sec_Fetch_Site": "cross-site"}, 403),
        ({"Sec_Fetch_Site": "same-site"}, 403),
        ({TOKEN.replace("-", "_"): "x" * 43}, 401),
        ({TOKEN.replace("-", "_"): ""}, 401),
        ({TOKEN.replace("-", "_"): None}, 401),
        ({"Content_Type": "text/plain"}, 415),
        ({"Content_Length": None}, 411),
        ({"Content_Length": "-1"}, 411),
        ({"Content_Length": str(MAX_BYTES + 1)}, 413),
        ({"Content_Length": "9" * 400}, 411),
        ({"Transfer_Encoding": "chunked"}, 411),
    ],
)
def test_others_are_refused(server: Server, changes: dict[str, str | None], status: int) -> None:
    answer, body = request(server, **changes)
    assert answer.status == status
    assert SECRET.encode() not in body
    assert set(json.loads(body)) == {"error"}
    assert answer.headers["Content-Security-Policy"] == HEADERS["Content-Security-Policy"]


@pytest.mark.parametrize("body", [b"", b"{", b"NaN", b'{"a": Infinity}', b"\xff", b"[" * 60_000, b"null"])
def test_a_body_that_is_no_json_is_refused(server: Server, body: bytes) -> None:
    answer, content = request(server, body=body)
    assert answer.status == 400
    assert "error" in json.loads(content)


@pytest.mark.parametrize("path", ["/../pyproject.toml", "//etc/passwd", "/page.py", "/%2e%2e/x", "/told", "/events"])
def test_only_files_of_the_page_are_handed_out(server: Server, path: str) -> None:
    answer, _ = request(server, path, b"", "GET")
    assert answer.status == 404


@pytest.mark.parametrize("method", ["PUT", "OPTIONS", "DELETE", "TRACE", "HEAD"])
def test_no_other_method_is_known(server: Server, method: str) -> None:
    answer, _ = request(server, "/told", b"", method)
    assert answer.status == 501


def test_the_page_itself_needs_no_token_and_holds_nothing(server: Server) -> None:
    answer, body = request(server, "/", b"", "GET", Origin=None)
    assert (answer.status, body) == (200, b"<!doctype html>")
    assert answer.headers.get_content_type() == "text/html"
    assert "unsafe" not in answer.headers["Content-Security-Policy"]
    assert server.guard.token not in str(answer.headers)


def test_lines_come_one_by_one_and_the_connection_ends(server: Server) -> None:
    answer, body = request(server, "/lines")
    assert (answer.status, body) == (200, b"1\n2\n")
    assert answer.headers["Connection"] == "close"


def test_a_ticket_is_good_once_and_the_address_in_a_list_of_processes_has_no_token(server: Server) -> None:
    guard = server.guard
    assert guard.token in guard.address
    assert guard.token not in guard.ticket_address
    ticket = guard.ticket_address.partition("#o=")[2]
    words = {TOKEN.replace("-", "_"): None}
    wrong, _ = request(server, "/token", b'{"ticket": "x"}', **words)
    _, first = request(server, "/token", json.dumps({"ticket": ticket}).encode(), **words)
    second, _ = request(server, "/token", json.dumps({"ticket": ticket}).encode(), **words)
    empty, _ = request(server, "/token", b'{"ticket": ""}', **words)
    assert json.loads(first) == {"token": guard.token}
    assert [wrong.status, second.status, empty.status] == [401, 401, 401]


def test_tokens_are_long_and_of_one_run(server: Server) -> None:
    other = Server(0, {})
    other.server_close()
    assert other.guard.token != server.guard.token
    assert len(server.guard.token) >= 43


def test_requests_from_other_machines_are_refused(server: Server) -> None:
    assert server.socket.getsockname()[0] == "127.0.0.1"


def test_a_silent_connection_is_ended(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(HttpRequest, "timeout", 0.2)
    with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as connection:
        connection.sendall(b"POST /told HTTP/1.1\r\n")
        assert connection.recv(1) == b""
    assert request(server)[0].status == 200


def test_a_connection_carries_one_request(server: Server) -> None:
    words = f"GET /page.js HTTP/1.1\r\nHost: {server.guard.hosts[0]}\r\n\r\n".encode()
    with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as connection:
        connection.sendall(words)
        answer = b"".join(iter(lambda: connection.recv(4096), b""))
    assert answer.startswith(b"HTTP/1.1 200")
    assert b"Connection: close" in answer


def test_nothing_of_a_request_is_written_down(server: Server, capfd: pytest.CaptureFixture[str]) -> None:
    request(server)
    request(server, Host="evil.example")
    assert capfd.readouterr() == ("", "")
