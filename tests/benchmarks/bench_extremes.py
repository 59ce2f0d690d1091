"""Writes results/extremes/README.md: numbers at the extremes, and what is guaranteed of each."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "results" / "extremes" / "README.md"


def main() -> None:
    """Measure and write the table."""
    sys.path.insert(0, str(ROOT / "tests"))
    text = importlib.import_module("validation.extremes").page()
    print(text)
    OUT.parent.mkdir(parents=True, exist_ok=True)
    OUT.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
