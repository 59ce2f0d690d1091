"""The guide for programs: its example loads and solves, and what it names exists."""

from __future__ import annotations

import json
import re
from pathlib import Path

import laufruhe
from laufruhe.files.ready import copies

DOCS = Path(__file__).parents[2] / "docs"
GUIDE = (DOCS / "llms.txt").read_text(encoding="utf-8")


def test_its_example_is_solved_with_a_proof() -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", GUIDE, re.DOTALL)
    result = laufruhe.solve(text)
    assert result.certificate is not None
    assert result.certificate.kind.value == "global"
    assert "left.unbalance" in {decision.name for decision in result.decisions}


def test_keys_and_pages_exist() -> None:
    schema = json.dumps(json.loads(copies(["tractor-single"])["laufruhe.schema.json"]))
    keys = GUIDE.partition("## Keys used most")[2].partition("## Example")[0]
    for line in re.findall(r"^- \[+[\w.]+\]+: (.*)", keys, re.MULTILINE):
        for key in re.findall(r"\b[a-z]+(?:_[a-z]+)+\b", line):
            assert f'"{key}"' in schema, key
    pages = re.findall(r"[\w-]+/[\w-]+\.html", GUIDE)
    assert len(pages) >= 5
    for page in pages:
        assert (DOCS / page).with_suffix(".md").exists(), page
