"""Access control: only pages of this server, opened on this machine by the printed address."""

from __future__ import annotations

import hmac
import secrets
import threading
from collections.abc import Mapping

HOST = "127.0.0.1"
TOKEN = "X-Laufruhe-Token"
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Headers of every answer: no foreign content, no frames, no cache, no referrer."""


class Guard:
    """Token of one run, and checks of a request's headers.

    The token is in the part of an address that browsers send to nobody. Other users of the machine may
    see the address with which a browser is started. So it holds a ticket, which is good for one exchange.
    """

    def __init__(self, port: int) -> None:
        self.token = secrets.token_urlsafe(32)
        self._ticket = secrets.token_urlsafe(32)
        self._lock = threading.Lock()
        self.hosts = tuple(f"{name}:{port}" for name in (HOST, "localhost"))

    @property
    def address(self) -> str:
        """Address with the token."""
        return f"http://{self.hosts[0]}/#t={self.token}"

    @property
    def ticket_address(self) -> str:
        """Address with the one-time ticket, for starting a browser."""
        return f"http://{self.hosts[0]}/#o={self._ticket}"

    def refusal(self, method: str, headers: Mapping[str, str]) -> str:
        """Return the reason to refuse a request by its method and headers; empty for an allowed one."""
        if headers.get("Host", "") not in self.hosts:
            return "the header Host does not name this server"
        origin = headers.get("Origin")
        allowed_origins = [f"http://{host}" for host in self.hosts]
        if (origin is not None or method == "POST") and origin not in allowed_origins:
            return "the header Origin does not name this page"
        if headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin"):
            return "the request comes from another site"
        return ""

    def knows(self, token: str | None) -> bool:
        """Return True for the token of this run."""
        return hmac.compare_digest((token or "").encode("utf-8", "replace"), self.token.encode())

    def exchanged(self, ticket: str) -> str | None:
        """Return the access token for the right one-time ticket; None for any other ticket."""
        with self._lock:
            good = bool(self._ticket) and hmac.compare_digest(ticket.encode("utf-8", "replace"), self._ticket.encode())
            if good:
                self._ticket = ""
            return self.token if good else None
