"""Message for a file that is no TOML: one line with line and column, the fault and the remedy."""

from __future__ import annotations

import re

import pytest

from laufruhe import InputError, load

FAULTS = {
    "typographic quotes": ("title = “x”", "1:9: “ is no quote here; put text between straight"),
    "one of them": ('title = "x”\na = 1', "1:11: ” is no quote here"),
    "beside good text": ('a = ["x“y", „z“]', "1:13: „ is no quote"),
    "a key twice": ("a = 1\nb = 2\na = 3\n", "3:6: a is given twice; keep one"),
    "a table twice": ("[engine]\na = 1\n\n[engine]\nb = 2", "[engine] is given twice; keep one of them, or write [["),
    "a value and a table": ('a = 1\n[a]\nb = 2', "[a] is given twice; keep one"),
    "a key of a small table twice": ("a = {b = 1, b = 2}", "a key is given twice in one table; keep one of them"),
    "decimal comma": ("ratio = 0,26", "1:10: a comma divides the number; decimals follow a point, as in 0.26"),
    "unit without quotes": ("bore = 80 mm # wide", 'a number with its unit stands in quotes, as in "80 mm"'),
    "list without end": ("\na = [0, 180\nb = 1", "3:1: a list is not closed before this place"),
    "table without end": ("[engine\na = 1", "1:8: [ is not closed; add ]"),
    "small table without end": ("a = { between = [0, 1]\nb = 1", "1:23: a table { is not closed before"),
    "a comma too few": ("a = [0, 180 270]", "1:13: a list is not closed before this place, or a comma is missing"),
    "path of Windows": (r'file = "C:\users\p.csv"', "in a path write / in its place"),
    "path with another letter": (r'file = "C:\data\p.csv"', "in a path write / in its place"),
    "path that is a bell": (r'file = "C:\bench.csv"', "U+0008, which is not a printable character; remove it; in"),
    "text without end": ('a = "80 mm\nb = 1', "1:11: the text is not closed"),
    "text without quotes": ("layout = inline", 'text stands without quotes, and true and false have small letters'),
    "no equals sign": ('bore "80 mm"\n', "1:6: no = follows the key; write key = value"),
    "an umlaut": ('Pleuellänge = "140 mm"\n', "a to z; write rod_length or put it in quotes, as in"),
    "an umlaut at the beginning": ("übermaß = 1", "1:1: the key übermaß has letters other than a to z; put it"),
    "no value": ("bore =\na = 1", "no value follows; write one, or leave the key out"),
    "two values": ('a = "x" "y"', "1:9: more stands behind the value"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "said"), FAULTS.values(), ids=FAULTS)
def test_broken_toml_is_reported_with_place_and_remedy(text: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        load(f"{text}\n")
    assert "\n" not in str(caught.value)
    assert said in re.sub(r"line (\d+), column (\d+): is no TOML", r"\1:\2", str(caught.value))


@pytest.mark.parametrize("ending", ["\r\n", "\n"])
def test_lines_are_counted_as_an_editor_does(ending: str) -> None:
    with pytest.raises(InputError, match="line 3, column 5: is no TOML"):
        load(ending.join(["a = 1", "b = 2", "c = x", ""]))
