"""Writes results/benchmarks/extremes.md: numbers at the extremes, and what is guaranteed of each."""

from __future__ import annotations

import importlib
import sys

from pages import PAGES, ROOT, publish

OUT = PAGES / "extremes.md"


def main() -> None:
    """Measure and write the table."""
    sys.path.insert(0, str(ROOT / "tests"))
    text = importlib.import_module("validation.extremes").page()
    publish(OUT, text)


if __name__ == "__main__":
    main()
