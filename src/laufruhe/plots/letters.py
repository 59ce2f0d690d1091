"""Fonts of pictures: DejaVu Sans, and installed fonts for letters that it lacks."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from functools import cache

from matplotlib.font_manager import fontManager
from matplotlib.ft2font import FT2Font

from laufruhe.errors import LaufruheWarning

FONT = "DejaVu Sans"
_STAND_IN = "Last Resort"
"""Name of fonts that draw boxes for missing letters."""
_REGULAR = (400, "normal", "regular", "book")
_stand_ins: dict[str, str] = {}
"""Substitute font by letter; empty if no installed font has the letter."""


def prepare(texts: Iterable[str]) -> None:
    """Find fonts for all letters of the texts; warn about letters that no installed font has."""
    letters = {letter for text in texts if not text.isascii() for letter in text if letter.isprintable()}
    main_letters = _letters_in(fontManager.findfont(FONT)) if letters else frozenset()
    new = sorted(letter for letter in letters - _stand_ins.keys() if ord(letter) not in main_letters)
    _stand_ins.update(
        (letter, next((name for name, has in _other_fonts() if ord(letter) in has), "")) for letter in new
    )
    if lacking := "".join(letter for letter in new if not _stand_ins[letter]):
        warnings.warn(
            f"no installed font has {lacking[:20]!r}, so pictures show boxes in its place; install one that has it, "
            "such as Noto Sans",
            LaufruheWarning,
            stacklevel=2,
        )


def families() -> list[str]:
    """Return fonts in the order of their use; a letter always comes from the same font."""
    used = set(_stand_ins.values())
    return [FONT, *(name for name, _ in (_other_fonts() if used - {""} else ()) if name in used)]


@cache
def _other_fonts() -> tuple[tuple[str, frozenset[int]], ...]:
    paths = {
        entry.name: entry.fname
        for entry in reversed(fontManager.ttflist)
        if entry.weight in _REGULAR and entry.style == "normal" and not entry.name.startswith((FONT, _STAND_IN))
    }
    fonts = [(name, _letters_in(path)) for name, path in paths.items()]
    return tuple(sorted(fonts, key=lambda font: ("sans" not in font[0].lower(), -len(font[1]), font[0])))


@cache
def _letters_in(path: str) -> frozenset[int]:
    try:
        font = FT2Font(path)
        return frozenset(font.get_charmap()) if font.scalable else frozenset()
    except (OSError, RuntimeError):
        return frozenset()
