"""Depth of a TOML text before it is parsed: the parser takes memory with the square of a key's parts."""

from __future__ import annotations

import re

_PART = re.compile(r"""[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+'""")
_TOKEN = re.compile(
    r'"""(?:[^\\]|\\.)*?"""'
    r"|'''.*?'''"
    rf"|(?P<key>(?:{_PART.pattern})(?:[ \t]*+\.[ \t]*+(?:{_PART.pattern}))*+)"
    r"|#[^\n]*"
    r"|(?P<open>[\[{])"
    r"|(?P<close>[]}])",
    re.DOTALL,
)


def line_deeper_than(most: int, text: str) -> int | None:
    """Return the first line, from one, with more brackets open or more parts of a key; None where there is none."""
    depth = 0
    for token in _TOKEN.finditer(text):
        depth += (token["open"] is not None) - (token["close"] is not None)
        if depth > most or (token["key"] and len(_PART.findall(token["key"])) > most):
            return text.count("\n", 0, token.start()) + 1
    return None
