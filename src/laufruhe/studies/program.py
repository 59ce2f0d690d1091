"""Identity of the program that answers a point: version, libraries, and what its source does."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from laufruhe.numerics.libraries import library_versions

ROOMS = (
    "numerics", "machine", "physics", "problem", "fidelity", "load_models", "prove", "solvers", "files", "studies",
)  # fmt: skip
"""Rooms whose code an answer goes through; what lies above them shows answers."""
_STRING = (
    r"[rRbBfFuU]{,2}(?:\"\"\"(?:[^\\]|\\.)*?\"\"\"|'''(?:[^\\]|\\.)*?'''"
    r"|\"(?:[^\"\\\n]|\\.)*\"|'(?:[^'\\\n]|\\.)*')"
)
_TOKEN = re.compile(
    rf"(?P<string>{_STRING})|(?P<comment>[ \t]*#[^\n]*)|(?P<bracket>[][(){{}}])|(?P<joint>\\\n)"
    r"|(?P<end>(?:\n[^\S\n]*(?:#[^\n]*)?)+)",
    re.DOTALL,
)
_REST = re.compile(r"[ \t]*(?:[#\n]|$)")


@cache
def program() -> str:
    """Return a hash of the code and the libraries that an answer depends on.

    The version alone would keep the points of a changed working copy. Comments, docstrings and blank lines
    change no answer, so `statements` leaves them out.
    """
    package = Path(__file__).parents[1]
    source = [package / name for name in ("__init__.py", "units.py", "errors.py")]
    source += [path for room in ROOMS for path in sorted((package / room).rglob("*.py"))]
    digest = hashlib.sha256(json.dumps(library_versions()).encode())
    for path in source:
        digest.update(path.relative_to(package).as_posix().encode() + b"\n")
        digest.update(statements(path.read_text(encoding="utf-8")).encode())
    return digest.hexdigest()


def statements(source: str) -> str:
    """Return Python source without comments, blank lines and docstrings."""
    return "".join(_pieces(source))


def _pieces(source: str) -> Iterator[str]:
    depth, place, begins = 0, 0, True
    for token in _TOKEN.finditer(source):
        code, text, place = source[place : token.start()], token.group(), token.end()
        begins = begins and not code.strip()
        yield code
        if token["bracket"]:
            depth += 1 if text in "([{" else -1
            begins = False
        elif token["string"]:
            yield "..." if begins and not depth and _REST.match(source, place) else text
            begins = False
            continue
        elif token["end"]:
            begins, text = True, "\n" + text.rpartition("\n")[2].partition("#")[0]
        yield "" if token["comment"] else text
    yield source[place:]
