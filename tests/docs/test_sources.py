"""The inventory of the sources names nothing that is not there, and leaves no row without a test or a reason."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/sources.md").read_text(encoding="utf-8")
ROWS = [
    [cell.strip() for cell in line.strip().strip("|").split("|")]
    for line in PAGE.splitlines()
    if line.startswith("| ") and not re.match(r"\| (in the source|---)", line)
]
PLACE = re.compile(r"`((?:src|tests|problems|docs|results)/[^`\s]+)`")


def missing(place: str) -> bool:
    """Return whether a file does not exist or holds no test of this name."""
    path, _, name = place.partition("::")
    if not (ROOT / path).exists():
        return True
    return bool(name) and not re.search(rf"def {re.escape(name)}\(", (ROOT / path).read_text(encoding="utf-8"))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0][:40])
def test_every_row_is_held_or_says_why_not(row):
    assert len(row) == 4
    row_text, held = row[2:]
    places = PLACE.findall(row_text + held)
    assert [place for place in places if missing(place)] == []
    is_hole = row_text.startswith("hole: ")
    assert is_hole or any(place.startswith("tests/") for place in PLACE.findall(held))
    assert not is_hole or len(row_text) > len("hole: a reason")


def test_missing_files_and_tests_are_detected():
    assert missing("tests/docs/test_sources.py::test_of_nothing")
    assert missing("src/nothing.py")
    assert not missing("tests/docs/test_sources.py::test_missing_files_and_tests_are_detected")
