"""HTTP on the loopback interface, with limits on size and duration of requests."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from laufruhe.extensions.served_page.guard import HEADERS, HOST, TOKEN, Guard

MAX_BYTES = 64_000
"""Largest number of bytes of a request's body."""
READ, WRITE = 5.0, 20.0
"""Seconds that the parts of a request, and a client that takes an answer, may pause."""
_TYPES = {"html": "text/html", "js": "text/javascript", "css": "text/css", "svg": "image/svg+xml"}
_JSON = "application/json"


@dataclass(frozen=True)
class HttpAnswer:
    """Response to a request: text, or lines sent as they are made."""

    text: str = ""
    lines: Iterator[str] | None = None
    status: HTTPStatus = HTTPStatus.OK


Handle = Callable[[Any], HttpAnswer]


class Server(ThreadingHTTPServer):
    """Threaded server of one page and its files, reachable from this machine only; port 0 takes a free one."""

    daemon_threads = True
    block_on_close = False
    request_queue_size = 32

    def __init__(self, port: int, files: Mapping[str, str]) -> None:
        super().__init__((HOST, port), HttpRequest)
        self.port: int = self.server_address[1]
        self.guard = Guard(self.port)
        self.files = {f"/{name}": text.encode() for name, text in files.items()}
        self.handles: dict[str, Handle] = {}

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore clients that have gone away; log nothing."""

    def server_bind(self) -> None:
        """Bind the server to its port without a look-up of the host name."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.bind(self.server_address)
        self.server_address = self.socket.getsockname()
        self.server_name, self.server_port = HOST, self.server_address[1]


class HttpRequest(BaseHTTPRequestHandler):
    """Connection that carries a single request."""

    protocol_version = "HTTP/1.1"
    server_version = "laufruhe"
    sys_version = ""
    disable_nagle_algorithm = True
    wbufsize = -1
    timeout = READ
    server: Server

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing: others may read a log."""

    def do_GET(self) -> None:
        """Send the page and its script files, which contain no data of the problem."""
        path = "/page.html" if self.path == "/" else self.path
        refusal = self.server.guard.refusal("GET", self._headers())
        if refusal:
            self._refused(HTTPStatus.FORBIDDEN, refusal)
        elif path not in self.server.files:
            self._refused(HTTPStatus.NOT_FOUND, "this server has no such page")
        else:
            kind = _TYPES[path.rsplit(".", 1)[1]]
            self._send(HTTPStatus.OK, self.server.files[path], f"{kind}; charset=utf-8")

    def do_POST(self) -> None:
        """Compute an answer for a client with the token, or exchange a ticket for the token."""
        guard = self.server.guard
        refusal = guard.refusal("POST", self._headers())
        if refusal:
            self._refused(HTTPStatus.FORBIDDEN, refusal)
        elif self.path != "/token" and not guard.knows(self.headers.get(TOKEN)):
            self._refused(HTTPStatus.UNAUTHORIZED, "open the page by the address that laufruhe printed")
        elif self.path != "/token" and self.path not in self.server.handles:
            self._refused(HTTPStatus.NOT_FOUND, "this server knows no such request")
        else:
            body = self._body()
            if body is not None:
                self._answer(self._exchanged(body) if self.path == "/token" else self.server.handles[self.path](body))

    def _headers(self) -> Mapping[str, str]:
        # duplicate headers count as wrong
        headers = {name: self.headers.get_all(name, []) for name in ("Host", "Origin", "Sec-Fetch-Site")}
        return {name: values[0] if len(values) == 1 else "?" for name, values in headers.items() if values}

    def _body(self) -> Any:
        """Return the JSON data of the request; None if the request was refused."""
        length = self.headers.get("Content-Length", "")
        if self.headers.get("Transfer-Encoding") is not None or not length.isdecimal() or len(length) > 9:
            return self._refused(HTTPStatus.LENGTH_REQUIRED, "the length of the request is missing")
        if int(length) > MAX_BYTES:
            return self._refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"the request is larger than {MAX_BYTES} bytes")
        if self.headers.get_content_type() != _JSON:
            return self._refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "the request is not of type JSON")
        try:
            body = json.loads(self.rfile.read(int(length)), parse_constant=_no_number)
        except (ValueError, RecursionError):
            return self._refused(HTTPStatus.BAD_REQUEST, "the request is no JSON")
        return body if body is not None else self._refused(HTTPStatus.BAD_REQUEST, "the request is null")

    def _exchanged(self, body: Any) -> HttpAnswer:
        ticket = body.get("ticket") if isinstance(body, dict) else None
        token = self.server.guard.exchanged(ticket) if isinstance(ticket, str) else None
        if token is None:
            text = json.dumps({"error": "this address was used before; take the one that laufruhe printed"})
            return HttpAnswer(text, status=HTTPStatus.UNAUTHORIZED)
        return HttpAnswer(json.dumps({"token": token}))

    def _answer(self, answer: HttpAnswer) -> None:
        if answer.lines is None:
            self._send(answer.status, answer.text.encode(), _JSON)
            return
        self._begin(HTTPStatus.OK, "application/x-ndjson")
        self.end_headers()
        with suppress(OSError):
            for line in answer.lines:
                self.wfile.write(line.encode() + b"\n")
                self.wfile.flush()
        close = getattr(answer.lines, "close", None)
        if close is not None:
            close()

    def _begin(self, status: HTTPStatus, kind: str) -> None:
        # an idle connection would block others
        self.close_connection = True
        self.connection.settimeout(WRITE)
        self.send_response(status)
        self.send_header("Connection", "close")
        self.send_header("Content-Type", kind)
        for name, value in HEADERS.items():
            self.send_header(name, value)

    def _send(self, status: HTTPStatus, body: bytes, kind: str) -> None:
        with suppress(OSError):
            self._begin(status, kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)
            self.wfile.flush()

    def _refused(self, status: HTTPStatus, why: str) -> None:
        self._send(status, json.dumps({"error": why}).encode(), _JSON)

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:  # noqa: ARG002
        """Report errors of http.server as JSON under the same headers."""
        self._refused(HTTPStatus(code), message or HTTPStatus(code).phrase)


def _no_number(name: str) -> float:
    raise ValueError(f"{name} is not a number in JSON")
