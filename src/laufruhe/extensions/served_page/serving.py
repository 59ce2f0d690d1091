"""Server of a problem's page, and the worker process of each kind of request."""

from __future__ import annotations

import errno
import json
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import suppress
from functools import partial
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path
from typing import Any, ParamSpec

from laufruhe.errors import Complaint, SolverError, printed, refused
from laufruhe.extensions.served_page import answers
from laufruhe.extensions.served_page.file_watcher import FileWatcher
from laufruhe.extensions.served_page.latest_worker import LatestWorker, Superseded
from laufruhe.extensions.served_page.live import page_assets
from laufruhe.extensions.served_page.page_state import PageState
from laufruhe.extensions.served_page.pareto import POINTS
from laufruhe.extensions.served_page.transport import HttpAnswer, Server
from laufruhe.files.complaints import Refused
from laufruhe.present.pictures import PICTURES

P = ParamSpec("P")

USUAL_PORT = 8537
"""Default port, so that old links keep working."""
FOLLOWED, GRACE = 30.0, 60.0
"""Seconds for an answer while a slider moves, and further seconds after the time limit of a search."""
HEARTBEAT = 1.0
"""Most seconds between two lines of events."""
# seconds that a newer request waits for a slider's answer, and for a search or a front
_HASTE, _PATIENCE = 5.0, 1.0


class Page:
    """Server of a problem file with its worker processes.

    Without `port` it takes USUAL_PORT, or a free port. `seconds` is the time limit of a search.
    """

    def __init__(self, path: Path, port: int | None, seconds: float) -> None:
        self.watched = FileWatcher(path)
        folder = files("laufruhe.extensions.served_page") / "static"
        texts = {
            file.name: file.read_text(encoding="utf-8")
            for file in folder.iterdir()
            if file.name.endswith((".html", ".js", ".css"))
        }
        self.server = _start_server(port, {**texts, **page_assets()})
        self._follow, self._measure = LatestWorker(_HASTE), LatestWorker(_HASTE)
        self._settle, self._front = LatestWorker(_PATIENCE), LatestWorker(_PATIENCE)
        self.server.handles = {
            "/begin": self._begin,
            "/follow": self._handler(self._follow, FOLLOWED, answers.follow),
            "/measure": self._handler(self._measure, FOLLOWED, answers.measure),
            "/settle": self._handler(self._settle, seconds + GRACE, answers.settle, seconds),
            "/save": self._handler(self._follow, FOLLOWED, answers.save),
            "/front": self._front_lines,
            "/pictures": _read(partial(self._lines, self._settle, len(PICTURES), answers.picture)),
            "/events": lambda _: HttpAnswer(lines=self._events()),
        }

    @property
    def address(self) -> str:
        """Address as printed."""
        return self.server.guard.address

    def serve(self, ends_after: float | None, when_ready: Callable[[], object]) -> None:
        """Answer requests until an interrupt, or for some seconds."""
        self.watched.start()
        timer = None
        if ends_after is not None:
            timer = threading.Timer(ends_after, self.server.shutdown)
            timer.daemon = True
            timer.start()
        # let the follower's process import in advance
        threading.Thread(target=self._warm_up, daemon=True).start()
        try:
            when_ready()
            self.server.serve_forever(poll_interval=0.1)
        finally:
            self.close()
            if timer is not None:
                timer.cancel()

    def close(self) -> None:
        """End the worker processes and the server."""
        self.watched.close()
        for worker in (self._follow, self._measure, self._settle, self._front):
            worker.close()
        self.server.server_close()

    def _warm_up(self) -> None:
        with suppress(Exception):
            self._follow.ask(FOLLOWED, answers.follow, self.watched.source, PageState())

    def _begin(self, _: Any) -> HttpAnswer:
        answer = json.loads(answers.begin(self.watched.source))
        return HttpAnswer(json.dumps({**answer, **self._state()}))

    def _state(self) -> dict[str, Any]:
        return {"version": self.watched.version, "complaint": self.watched.complaint}

    def _handler(
        self, worker: LatestWorker, seconds: float, work: Callable[..., str], *arguments: Any
    ) -> Callable[[Any], HttpAnswer]:
        return _read(
            lambda state: _to_answer(partial(worker.ask, seconds, work, self.watched.source, state, *arguments))
        )

    def _lines(
        self, worker: LatestWorker, maximum: int, work: Callable[..., str], state: PageState, *arguments: Any
    ) -> HttpAnswer:
        source = self.watched.source

        def lines() -> Iterator[str]:
            for k in range(maximum):
                text = _to_answer(partial(worker.ask, FOLLOWED, work, source, state, *arguments, k)).text
                yield text
                if text.startswith(('{"error"', '{"done"', '{"dropped"')):
                    return
            yield '{"done": true}'

        return HttpAnswer(lines=lines())

    def _front_lines(self, body: Any) -> HttpAnswer:
        across = body.pop("across", None) if isinstance(body, dict) else None
        if not isinstance(across, str) or len(across) > 200:
            return _bad_request(Complaint("across", "", "is no measure", "load the page again"))
        return _read(lambda state: self._lines(self._front, POINTS, answers.front, state, across))(body)

    def _events(self) -> Iterator[str]:
        version = 0
        while not self.watched.is_closed:
            version = self.watched.later(version, HEARTBEAT)
            yield json.dumps(self._state())


def _read(answer: Callable[[PageState], HttpAnswer]) -> Callable[[Any], HttpAnswer]:

    def answered(body: Any) -> HttpAnswer:
        try:
            return answer(PageState.from_json(body))
        except Refused as refused:
            return _bad_request(refused.complaint)

    return answered


def _to_answer(work: Callable[[], str]) -> HttpAnswer:
    try:
        return HttpAnswer(work())
    except Superseded:
        return HttpAnswer('{"dropped": true}')
    except SolverError as error:
        return HttpAnswer(json.dumps({"error": str(error)}))
    except BrokenExecutor:
        text = "the process that solves has ended, most likely for want of memory; it is started again"
        return HttpAnswer(json.dumps({"error": text}))
    except Exception as error:
        # a program fault must not end the page
        text = printed(f"this state cannot be worked out: {type(error).__name__}: {error}")
        return HttpAnswer(json.dumps({"error": text}))


def _bad_request(complaint: Complaint) -> HttpAnswer:
    return HttpAnswer(json.dumps({"error": str(complaint)}), status=HTTPStatus.BAD_REQUEST)


def _start_server(port: int | None, texts: dict[str, str]) -> Server:
    try:
        return Server(USUAL_PORT if port is None else port, texts)
    except OSError as error:
        if error.errno not in (errno.EADDRINUSE, errno.EACCES):
            raise
        if port is None:
            return Server(0, texts)
        rule = "is in use" if error.errno == errno.EADDRINUSE else "is for the system's own services"
        raise refused("--port", str(port), rule, "name another port, or leave --port out") from None
