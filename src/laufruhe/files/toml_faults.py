"""Where the text of a file breaks the rules of TOML: line and column, what is wrong there, and the remedy."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from laufruhe import units
from laufruhe.errors import Complaint, printed

_AT = re.compile(r"^(.*) \(at (?:line (\d+), column (\d+)|end of document)\)$", re.DOTALL)
_TEXT = r'"""(?:[^\\]|\\.)*?"""|' r"'''.*?'''|" r'"(?:[^"\\\n]|\\.)*"|' r"'[^'\n]*'"
_MARK = re.compile(rf"{_TEXT}|#[^\n]*|[\[\]{{}}]", re.DOTALL)
_ENTRY = re.compile(r"""\s*((?:[\w-]|\.|"[^"]*"|'[^']*')+)\s*=""")
_HEAD = re.compile(r"\s*\[+ *([A-Za-z_][\w.-]*) *\]+\s*(?:#|$)")
_CLOSING = {"[": "]", "{": "}"}
_QUOTES = re.compile("[“”„‟‘’‚‛«»″]")
_UNQUOTED = re.compile(r'[+-]?[\d.]+(?:[eE][+-]?\d+)? *[A-Za-z°%][^"=]*"?$')
_OPEN_QUOTE = ("the text is not closed", "end it with the quote that it begins with")
_STATEMENTS = {
    "Illegal character '\\n'": _OPEN_QUOTE,
    "Unterminated": _OPEN_QUOTE,
    'Expected "': _OPEN_QUOTE,
    "Expected '='": ("no = follows the key", "write key = value"),
    "Expected newline": ("more stands behind the value", "take it out, or begin a new line"),
    "Invalid statement": (
        "no key begins like this",
        "put a key with other characters than a to z, 0 to 9, _ and - in quotes",
    ),
}
_WORD = re.compile(r"[^\W\d][\w.-]*")


@dataclass(frozen=True)
class _Break:
    """Where reading broke off, and what the parser says of it."""

    text: str
    offset: int
    message: str

    @property
    def number(self) -> int:
        """Of the line, from one."""
        return self.text.count("\n", 0, self.offset) + 1

    @property
    def begin(self) -> int:
        """Where the line begins."""
        return self.text.rfind("\n", 0, self.offset) + 1

    @property
    def line(self) -> str:
        """Its text."""
        return self.text[self.begin :].partition("\n")[0]

    @property
    def ahead(self) -> str:
        """What of it was not read."""
        return self.text[self.offset :].partition("\n")[0].strip()

    @property
    def is_first(self) -> bool:
        """Whether nothing of its line stands before it."""
        return not self.text[self.begin : self.offset].strip()

    @property
    def value(self) -> str:
        """What stands behind its first =."""
        return self.line.partition("=")[2].partition("#")[0].strip()

    @property
    def where(self) -> str:
        """As a message names the place."""
        return f"line {self.number}, column {self.offset - self.begin + 1}"

    def before(self) -> Iterator[tuple[int, str]]:
        """The lines before it with their numbers, the nearest first."""
        lines = self.text[: self.begin].split("\n")[:-1]
        return zip(range(len(lines), 0, -1), reversed(lines), strict=True)

    def lines_of(self, form: re.Pattern[str], name: str) -> list[int]:
        """Numbers of the lines before it of this form that give this name, the nearest first."""
        return [number for number, line in self.before() if (one := form.match(line)) and one.group(1) == name]

    def opened(self) -> int | None:
        """Where the last bracket stands that is open here; None where none is."""
        left: list[int] = []
        for mark in _MARK.finditer(self.text, 0, self.offset):
            if mark.group() in _CLOSING:
                left.append(mark.start())
            elif mark.group() in _CLOSING.values() and left:
                left.pop()
        return left[-1] if left else None


def toml_complaint(content: bytes, error: tomllib.TOMLDecodeError) -> Complaint:
    """What to tell of a file that is no TOML."""
    text = content.decode("utf-8-sig").replace("\r\n", "\n")
    found = _AT.match(str(error))
    message, line, column = found.groups(default="0") if found else (str(error), "0", "0")
    offset = _offset(text, int(line), int(column)) if int(line) else len(text.rstrip())
    here = _Break(text, offset, message)
    for look in _LOOKS:
        told = look(here)
        if told is not None:
            at, rule, remedy = told
            return Complaint(at.where, "", f"is no TOML: {rule}", remedy)
    return Complaint(here.where, "", f"is no TOML: {message[:1].lower()}{message[1:]}", "correct it there")


def _offset(text: str, line: int, column: int) -> int:
    begin = 0
    for _ in range(line - 1):
        begin = text.index("\n", begin) + 1
    return begin + column - 1


_Told = tuple[_Break, str, str] | None


def _quotes(here: _Break) -> _Told:
    # straight quotes may hold any
    found = _QUOTES.search(re.sub(_TEXT, lambda text: " " * len(text.group()), here.line))
    if found is None:
        return None
    at = replace(here, offset=here.begin + found.start())
    return at, f"{found.group()} is no quote here", 'put text between straight quotes, as in "80 mm"'


def _backslash(here: _Break) -> _Told:
    if not here.message.startswith(("Unescaped", "Invalid hex")):
        return None
    return here, "\\ in text begins a special character", "in a path write / in its place, or put it between ' and '"


def _twice(here: _Break) -> _Told:
    if not here.message.startswith(("Cannot", "Duplicate")):
        return None
    if head := _HEAD.match(here.line):
        remedy = f"join the two, or write [[{head.group(1)}]] for each of several"
        name, form = f"[{head.group(1)}]", _HEAD
    else:
        entries = map(_ENTRY.match, (here.line, *(line for _, line in here.before())))
        entry = next(filter(None, entries), None)
        name, form, remedy = entry.group(1) if entry else "a key", _ENTRY, "keep one of them"
    if here.message.startswith("Duplicate"):
        return here, f"{here.message.rpartition('key ')[2]} stands twice in one table", remedy
    own = name.strip("[]")
    others = here.lines_of(form, own)
    if not others and form is _HEAD:
        first = here.lines_of(_ENTRY, own)[-1:]
        return here, f"{own} is a value{f' in line {first[0]}' if first else ''} and a table here", "keep one"
    # a value of several lines is read to its end
    others = others[1:] if form is _ENTRY and not _ENTRY.match(here.line) else others
    return here, f"{name} is given twice" + (f", before in line {others[0]}" if others else ""), remedy


def _comma(here: _Break) -> _Told:
    if not units.DECIMAL_COMMA.match(here.value):
        return None
    text = printed(here.value.replace(",", ".", 1), 40)
    return here, "a comma divides the number", f"decimals follow a point, as in {text}"


def _unit(here: _Break) -> _Told:
    if not _UNQUOTED.match(here.value):
        return None
    text = printed(here.value.strip('"'), 40)
    return here, "a unit stands without quotes", f'a number with its unit stands in quotes, as in "{text}"'


def _bracket(here: _Break) -> _Told:
    begun = here.opened()
    if begun is None:
        return None
    closing = _CLOSING[here.text[begun]]
    at = replace(here, offset=begun)
    is_next = here.is_first and (_ENTRY.match(here.line) or _HEAD.match(here.line))
    if here.message.startswith("Unclosed") and here.ahead and not is_next:
        return here, "a comma is missing between two entries", "add it"
    if here.message.startswith(("Unclosed", "Expected ']")) or (is_next and at.number < here.number):
        return at, f"{here.text[begun]} is not closed", f"add {closing}"
    return None


def _statement(here: _Break) -> _Told:
    for begin, told in _STATEMENTS.items():
        if here.message.startswith(begin):
            return here, *told
    return None


def _bare(here: _Break) -> _Told:
    if here.message != "Invalid value":
        return None
    if not here.ahead or here.ahead.startswith("#"):
        return here, "no value follows", "write one, or leave the key out"
    if here.ahead.lower().startswith(("true", "false")):
        return here, "true and false have small letters", f"write {here.ahead.split()[0].lower()}"
    if here.ahead.startswith("."):
        return here, "a number begins with a point", f"write 0{printed(here.ahead.split()[0], 40)}"
    word = _WORD.match(here.ahead)
    return (here, "text stands without quotes", f'write "{printed(word.group(), 40)}"') if word else None


_LOOKS: tuple[Callable[[_Break], _Told], ...] = (
    _quotes, _backslash, _twice, _comma, _unit, _bracket, _statement, _bare,
)  # fmt: skip
