"""Draw the rooms of the package, the way of one decision through them, and the extensions beside.

`python docs/extensions/rooms.py` writes `docs/pictures/architecture.svg`. Rooms and their order come from the import
contracts, extensions from their folders.
"""

from __future__ import annotations

import re
import tomllib
from html import escape
from pathlib import Path

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs" / "pictures" / "architecture.svg"
WORDS = {
    "cli": "commands",
    "python": "engines in code",
    "report": "pages, tables, pictures",
    "studies": "sweeps and comparisons",
    "present": "words and numbers for both",
    "files": "TOML and CSV, messages, schema",
    "solvers": "methods propose designs",
    "prove": "lower bounds and certificates",
    "load_models": "V0 + B x from decisions to loads",
    "problem": "decisions, measures, limits",
    "physics": "one file a phenomenon",
    "machine": "layouts, drives, rotors, mounts",
    "numerics": "norms, spectra, units",
    "extension": "tables that packages add to",
    "errors": "one line for each complaint",
}
STEPS = {
    "files": "1  a key of the file becomes a decision",
    "load_models": "2  engine evaluated: V0 and one column of B",
    "solvers": "3  a method proposes a value and multipliers",
    "prove": "4  any multipliers give a lower bound",
    "problem": "5  the exact model evaluates the design",
    "report": "6  result.json, report, pictures",
}
ROW, TOP, LEFT, WIDTH, BESIDE = 44, 56, 30, 420, 812


def rooms() -> list[tuple[str, ...]]:
    """Return the rooms from top to bottom, those of one layer together."""
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    layers = next(c["layers"] for c in tools["importlinter"]["contracts"] if c.get("containers") == ["laufruhe"])
    return [tuple(re.findall(r"\w+", layer)) for layer in layers if layer != "extensions"]


def extensions() -> list[str]:
    """Return the names of the extension folders."""
    return sorted(path.parent.name for path in (ROOT / "src" / "laufruhe" / "extensions").glob("*/__init__.py"))


def _text(x: float, y: float, words: str, size: int, fill: str, extra: str = "") -> str:
    return f'<text x="{x}" y="{y}" font-size="{size}" fill="{fill}"{extra}>{escape(words)}</text>'


def _box(x: float, y: float, width: float, height: float, fill: str) -> str:
    return f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="5" fill="{fill}" stroke="#35546d"/>'


def drawing() -> str:
    """Return the picture as SVG."""
    stack, beside = rooms(), extensions()
    # words stand below both columns
    height = TOP + max(ROW * len(stack) + 50, ROW * len(beside) + 68)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1090 {height}" width="1090" height="{height}" '
        'font-family="sans-serif" role="img" aria-label="Rooms of the core, a decision on its way, and extensions">',
        f'<rect width="1090" height="{height}" fill="#ffffff"/>',
        _text(LEFT, 34, "Core", 18, "#14293a", ' font-weight="bold"'),
        _text(LEFT + WIDTH + 34, 34, "One decision on its way", 18, "#8a3a0c", ' font-weight="bold"'),
        _text(BESIDE, 34, "Extensions", 18, "#14293a", ' font-weight="bold"'),
    ]
    for k, names in enumerate(stack):
        y = TOP + ROW * k
        step = next((STEPS[name] for name in names if name in STEPS), "")
        parts.append(_box(LEFT, y, WIDTH, ROW - 10, "#dcebf7" if step else "#f3f3f3"))
        parts.append(_text(LEFT + 14, y + 23, " · ".join(names), 15, "#14293a", ' font-weight="bold"'))
        parts.append(_text(LEFT + WIDTH - 14, y + 23, WORDS[names[0]], 13, "#33475a", ' text-anchor="end"'))
        if step:
            parts.append(
                f'<line x1="{LEFT + WIDTH}" y1="{y + 17}" x2="{LEFT + WIDTH + 26}" y2="{y + 17}" '
                'stroke="#b3541e" stroke-width="1.5"/>'
            )
            parts.append(_text(LEFT + WIDTH + 34, y + 22, step, 14, "#8a3a0c"))
    for k, name in enumerate(beside):
        y = TOP + ROW * k
        parts.append(_box(BESIDE, y, 248, ROW - 10, "#e9f3e4"))
        parts.append(_text(BESIDE + 14, y + 23, name, 15, "#14293a", ' font-weight="bold"'))
    y = TOP + ROW * len(beside) + 14
    for words in (
        "A folder each, with all that",
        "belongs to it. It imports the core;",
        "the core finds it by being there.",
    ):
        parts.append(_text(BESIDE, y, words, 13, "#33475a"))
        y += 18
    parts.append(_text(LEFT, TOP + ROW * len(stack) + 32, "Imports point down only.", 13, "#33475a"))
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(drawing(), encoding="utf-8")
