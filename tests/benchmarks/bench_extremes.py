"""Writes results/benchmarks/extremes.md: numbers at the extremes, and what is guaranteed of each."""

from __future__ import annotations

import importlib

from pages import PAGES, publish

OUT = PAGES / "extremes.md"


def main() -> None:
    """Measure and write the table."""
    text = importlib.import_module("validation.extremes").page()
    publish(OUT, text)


if __name__ == "__main__":
    main()
