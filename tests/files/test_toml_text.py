"""Tables written as a file are the same tables when they are read."""

from __future__ import annotations

import tomllib

import pytest

from laufruhe.files.toml_text import toml_text
from problem_files import PROBLEMS

ODD = {
    "title": 'quotes " and \\ and\nlines, Zylinder \u00fc\x7f',
    "a key": {"with.dots": 1e-7, "whole": 3, "yes": True},
    "empty": [],
    "mixed": [[1, 2.5], ["x", {"between": ["0 kg", "1 kg"], "start": "0.5 kg"}]],
    "list": [{"name": "a", "inner": [{"x": 1}, {"x": 2}]}, {"name": "b", "table": {"deep": {"deeper": "1 m"}}}],
}


@pytest.mark.parametrize("path", sorted(PROBLEMS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_ready_file_comes_back(path):
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    assert tomllib.loads(toml_text(tables)) == tables


def test_odd_texts_and_tables_come_back():
    assert tomllib.loads(toml_text(ODD)) == ODD
