"""TOML text: writer of tables, and clear complaints about text that is not TOML."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from laufruhe import units
from laufruhe.errors import Complaint, printed
from laufruhe.files.trade_words import meanings

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_AT = re.compile(r"^(.*) \(at (?:line (\d+), column (\d+)|end of document)\)$", re.DOTALL)
_TEXT = r'"""(?:[^\\]|\\.)*?"""|' r"'''.*?'''|" r'"(?:[^"\\\n]|\\.)*"|' r"'[^'\n]*'"
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


def toml_text(tables: Mapping[str, Any]) -> str:
    """Return the text of a TOML file with these tables."""
    return "\n".join(_lines(tables, ())).strip("\n") + "\n"


def _lines(table: Mapping[str, Any], above: tuple[str, ...]) -> Iterator[str]:
    """Yield the lines of a table: values first, then inner tables; open numbers stay on one line."""
    lists = {key: value if isinstance(value, list) else [value] for key, value in table.items()}
    inner = {
        key: tables
        for key, tables in lists.items()
        if tables and all(isinstance(entry, Mapping) and "between" not in entry for entry in tables)
    }
    yield from (f"{toml_key(key)} = {toml_value(value)}" for key, value in table.items() if key not in inner)
    for key, tables in inner.items():
        path = (*above, key)
        name = ".".join(map(toml_key, path))
        head = f"[[{name}]]" if isinstance(table[key], list) else f"[{name}]"
        for entry in tables:
            yield from ("", head, *_lines(entry, path))


def toml_key(key: str) -> str:
    """Return a key as written in TOML, in quotes if necessary."""
    return key if _BARE_KEY.fullmatch(key) else json.dumps(key, ensure_ascii=False)


def toml_value(value: Any) -> str:
    """Return a value as TOML on one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{toml_key(key)} = {toml_value(entry)}' for key, entry in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(toml_value, value))}]"
    return repr(value)


def line_deeper_than(depth: int, text: str) -> int | None:
    """Return the first line, from one, with more than `depth` open brackets or parts of a key; None if there is none.

    The memory of the parser grows with the square of the number of parts of a key.
    """
    brackets = 0
    for token in _TOKEN.finditer(text):
        brackets += (token["open"] is not None) - (token["close"] is not None)
        if brackets > depth or (token["key"] and len(_PART.findall(token["key"])) > depth):
            return text.count("\n", 0, token.start()) + 1
    return None


def toml_complaint(content: bytes, error: tomllib.TOMLDecodeError) -> Complaint:
    """Return the complaint about a file that is not TOML: line and column, rule and remedy."""
    text = content.decode("utf-8-sig").replace("\r\n", "\n")
    match = _AT.match(str(error))
    message, line, column = match.groups(default="0") if match else (str(error), "0", "0")
    offset = len(text.rstrip())
    if int(line):
        offset = sum(len(text_line) + 1 for text_line in text.split("\n")[: int(line) - 1]) + int(column) - 1
    offset, rule, remedy = _fault(text, offset, message)
    where = f"line {text.count(chr(10), 0, offset) + 1}, column {offset - text.rfind(chr(10), 0, offset)}"
    return Complaint(where, "", f"is no TOML: {rule}", remedy)


def _fault(text: str, offset: int, message: str) -> tuple[int, str, str]:
    """Return offset, rule and remedy of the fault for which the parser stopped at an offset with a message."""
    begin = text.rfind("\n", 0, offset) + 1
    line, ahead = (text[start:].partition("\n")[0] for start in (begin, offset))
    value, ahead = line.partition("=")[2].partition("#")[0].strip(), ahead.strip()
    # text in straight quotes may hold any quotes
    quote = _QUOTES.search(re.sub(_TEXT, lambda match: " " * len(match.group()), line))
    if quote:
        rule, remedy = f"{quote.group()} is no quote here", 'put text between straight quotes, as in "80 mm"'
        return begin + quote.start(), rule, remedy
    if message.startswith(("Unescaped", "Invalid hex")):
        remedy = "in a path write / in its place, or put it between ' and '"
        return offset, "\\ in text begins a special character", remedy
    if message.startswith(("Cannot", "Duplicate")):
        return offset, *_repeated(line, text[:begin].split("\n")[:-1], message)
    if units.DECIMAL_COMMA.match(value):
        point = printed(value.replace(",", ".", 1), 40)
        return offset, "a comma divides the number", f"decimals follow a point, as in {point}"
    if _UNQUOTED.match(value):
        remedy = f'a number with its unit stands in quotes, as in "{printed(value.strip(chr(34)), 40)}"'
        return offset, "a unit stands without quotes", remedy
    brackets: list[int] = []
    for token in _TOKEN.finditer(text, 0, offset):
        if token["open"]:
            brackets.append(token.start())
        elif token["close"] and brackets:
            brackets.pop()
    if brackets:
        bracket_offset = brackets[-1]
        is_next = not text[begin:offset].strip() and (_ENTRY.match(line) or _HEAD.match(line))
        if message.startswith("Unclosed") and ahead and not is_next:
            return offset, "a comma is missing between two entries", "add it"
        if message.startswith(("Unclosed", "Expected ']")) or (is_next and "\n" in text[bracket_offset:offset]):
            return bracket_offset, f"{text[bracket_offset]} is not closed", f"add {_CLOSING[text[bracket_offset]]}"
    key = _WORD.match(line.strip())
    if key and not key.group().isascii() and message.startswith(("Expected '='", "Invalid statement")):
        meant = [f"write {name}" for name, _ in meanings(key.group()) if name]
        rule = f"the key {key.group()} has letters other than a to z"
        return offset, rule, " or ".join([*meant, f"put it in quotes, as in {toml_key(key.group())}"])
    for start, rule_and_remedy in _STATEMENTS.items():
        if message.startswith(start):
            return offset, *rule_and_remedy
    if message == "Invalid value":
        if not ahead or ahead.startswith("#"):
            return offset, "no value follows", "write one, or leave the key out"
        first = ahead.split()[0]
        if ahead.lower().startswith(("true", "false")):
            return offset, "true and false have small letters", f"write {first.lower()}"
        if ahead.startswith("."):
            return offset, "a number begins with a point", f"write 0{printed(first, 40)}"
        if word := _WORD.match(ahead):
            return offset, "text stands without quotes", f'write "{printed(word.group(), 40)}"'
    return offset, f"{message[:1].lower()}{message[1:]}", "correct it there"


def _repeated(line: str, earlier: Sequence[str], message: str) -> tuple[str, str]:
    """Return rule and remedy for a key or table that is given twice: in `line`, and in the lines before."""

    def numbers(form: re.Pattern[str]) -> list[int]:
        matches = ((k, form.match(text_line)) for k, text_line in enumerate(earlier, 1))
        return [k for k, match in matches if match and match.group(1) == name]

    if head := _HEAD.match(line):
        name = head.group(1)
        name_text, remedy = f"[{name}]", f"join the two, or write [[{name}]] for each of several"
        lines = numbers(_HEAD)
    else:
        entries = map(_ENTRY.match, (line, *reversed(earlier)))
        entry = next(filter(None, entries), None)
        name = name_text = entry.group(1) if entry else "a key"
        remedy, lines = "keep one of them", numbers(_ENTRY)
    if message.startswith("Duplicate"):
        return f"{message.rpartition('key ')[2]} stands twice in one table", remedy
    if not lines and head:
        first = numbers(_ENTRY)[:1]
        return f"{name} is a value{f' in line {first[0]}' if first else ''} and a table here", "keep one"
    if not head and not _ENTRY.match(line):
        # a value of several lines is read to its end
        lines = lines[:-1]
    return f"{name_text} is given twice" + (f", before in line {lines[-1]}" if lines else ""), remedy
