"""Who is let in, and how much is read: asked over real connections."""

from __future__ import annotations

import http.client
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress

import pytest

from laufruhe.extensions.served_page import transport
from laufruhe.extensions.served_page.guard import HEADERS, TOKEN
from laufruhe.extensions.served_page.transport import MAX_AT_ONCE, MAX_BYTES, HttpAnswer, Server

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


def asked(
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


def wait_for(holds: Callable[[], bool]) -> None:
    until = time.monotonic() + PATIENCE
    while not holds() and time.monotonic() < until:
        time.sleep(0.01)
    assert holds()


def test_who_has_the_token_is_answered(server: Server) -> None:
    answer, body = asked(server)
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
    answer, body = asked(server, **changes)
    assert answer.status == status
    assert SECRET.encode() not in body
    assert set(json.loads(body)) == {"error"}
    assert answer.headers["Content-Security-Policy"] == HEADERS["Content-Security-Policy"]


@pytest.mark.parametrize("body", [b"", b"{", b"NaN", b'{"a": Infinity}', b"\xff", b"[" * 60_000, b"null"])
def test_what_is_no_json_is_refused(server: Server, body: bytes) -> None:
    answer, told = asked(server, body=body)
    assert answer.status == 400
    assert "error" in json.loads(told)


@pytest.mark.parametrize("path", ["/../pyproject.toml", "//etc/passwd", "/page.py", "/%2e%2e/x", "/told", "/events"])
def test_only_files_of_the_page_are_handed_out(server: Server, path: str) -> None:
    answer, _ = asked(server, path, b"", "GET")
    assert answer.status == 404


@pytest.mark.parametrize("method", ["PUT", "OPTIONS", "DELETE", "TRACE", "HEAD"])
def test_no_other_method_is_known(server: Server, method: str) -> None:
    answer, _ = asked(server, "/told", b"", method)
    assert answer.status == 501


def test_the_page_itself_needs_no_token_and_holds_nothing(server: Server) -> None:
    answer, body = asked(server, "/", b"", "GET", Origin=None)
    assert (answer.status, body) == (200, b"<!doctype html>")
    assert answer.headers.get_content_type() == "text/html"
    assert "unsafe" not in answer.headers["Content-Security-Policy"]
    assert server.guard.token not in str(answer.headers)


def test_lines_come_one_by_one_and_the_connection_ends(server: Server) -> None:
    answer, body = asked(server, "/lines")
    assert (answer.status, body) == (200, b"1\n2\n")
    assert answer.headers["Connection"] == "close"


def test_a_ticket_is_good_once_and_the_address_in_a_list_of_processes_has_no_token(server: Server) -> None:
    guard = server.guard
    assert guard.token in guard.address
    assert guard.token not in guard.ticket_address
    ticket = guard.ticket_address.partition("#o=")[2]
    words = {TOKEN.replace("-", "_"): None}
    wrong, _ = asked(server, "/token", b'{"ticket": "x"}', **words)
    _, first = asked(server, "/token", json.dumps({"ticket": ticket}).encode(), **words)
    second, _ = asked(server, "/token", json.dumps({"ticket": ticket}).encode(), **words)
    empty, _ = asked(server, "/token", b'{"ticket": ""}', **words)
    assert json.loads(first) == {"token": guard.token}
    assert [wrong.status, second.status, empty.status] == [401, 401, 401]


def test_tokens_are_long_and_of_one_run(server: Server) -> None:
    other = Server(0, {})
    other.server_close()
    assert other.guard.token != server.guard.token
    assert len(server.guard.token) >= 43


def test_nobody_beyond_this_machine_is_listened_to(server: Server) -> None:
    assert server.socket.getsockname()[0] == "127.0.0.1"


def test_more_requests_at_work_than_there_may_be_are_refused_and_room_comes_back(server: Server) -> None:
    # connections of other tests take room until their threads have ended
    wait_for(lambda: server._room._value == MAX_AT_ONCE)
    done, started = threading.Event(), threading.Semaphore(0)

    def work(_: object) -> HttpAnswer:
        started.release()
        done.wait(PATIENCE)
        return HttpAnswer("{}")

    server.handles["/work"] = work
    asking = [threading.Thread(target=asked, args=(server, "/work")) for _ in range(MAX_AT_ONCE)]
    try:
        for thread in asking:
            thread.start()
        for _ in asking:
            assert started.acquire(timeout=PATIENCE)
        with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as one_more:
            assert one_more.recv(1) == b""
    finally:
        done.set()
        for thread in asking:
            thread.join(PATIENCE)
    wait_for(lambda: server._room._value > 0)
    assert asked(server)[0].status == 200


@pytest.mark.parametrize("sent", [b"", b"POST /told HTTP/1.1\r\nHost: x\r\n"])
def test_slow_connections_give_way_to_who_asks(server: Server, sent: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    # without a deadline these would stay, so that who asks is answered only if they give way
    monkeypatch.setattr(transport, "READ", 1e6)
    wait_for(lambda: server._room._value == MAX_AT_ONCE)
    slow = [socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) for _ in range(MAX_AT_ONCE)]
    try:
        for connection in slow:
            connection.sendall(sent)
        wait_for(lambda: server._room._value == 0)
        for _ in range(3):
            assert asked(server)[0].status == 200
        # the oldest has been closed, the newest is still waited for
        assert slow[0].recv(1) == b""
        slow[-1].settimeout(0.05)
        with pytest.raises(TimeoutError):
            slow[-1].recv(1)
    finally:
        for connection in slow:
            connection.close()


def trickle(connection: socket.socket, data: bytes) -> bool:
    """Whether the server has ended a connection over which one byte after the other is sent."""
    with suppress(OSError):
        connection.settimeout(0.02)
        for byte in data:
            connection.sendall(bytes([byte]))
            with suppress(TimeoutError):
                return connection.recv(1) == b""
        return False
    return True


def test_a_request_has_to_arrive_by_its_deadline(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport, "READ", 0.2)
    with socket.create_connection(("127.0.0.1", server.port)) as connection:
        assert trickle(connection, b"G" * 3000)


def test_a_connection_sends_so_much_and_no_more(server: Server) -> None:
    head = b"GET /page.js HTTP/1.1\r\n" + b"".join(b"A%d: %s\r\n" % (k, b"x" * 60_000) for k in range(20))
    with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as connection, suppress(OSError):
        connection.sendall(head)
        assert connection.recv(1) == b""


def test_a_connection_carries_one_request(server: Server) -> None:
    words = f"GET /page.js HTTP/1.1\r\nHost: {server.guard.hosts[0]}\r\n\r\n".encode()
    with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE) as connection:
        connection.sendall(words)
        answer = b"".join(iter(lambda: connection.recv(4096), b""))
    assert answer.startswith(b"HTTP/1.1 200")
    assert b"Connection: close" in answer


def test_nothing_of_a_request_is_written_down(server: Server, capfd: pytest.CaptureFixture[str]) -> None:
    asked(server)
    asked(server, Host="evil.example")
    assert capfd.readouterr() == ("", "")
