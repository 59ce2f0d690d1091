"""Links of the pages, which must lead to existing files and headings."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# files that commands write are not committed
WRITTEN = ROOT / "results"
COMMITTED = (
    WRITTEN / "benchmarks",
    *(WRITTEN / name / "README.md" for name in ("", "attack", "changes", "faults", "mutants", "proofs")),
)
PAGES = sorted(
    path
    for pattern in (
        "*.md",
        "docs/**/*.md",
        "results/README.md",
        "results/benchmarks/*.md",
        "results/attack/README.md",
        "results/changes/README.md",
        "results/faults/README.md",
        "results/proofs/README.md",
    )
    for path in ROOT.glob(pattern)
)
LINK = re.compile(r"\]\((?!https?:|mailto:)([^)\s]*)\)")


def is_active(path: Path) -> bool:
    below = WRITTEN in path.parents
    return path.exists() and (not below or any(path == folder or folder in path.parents for folder in COMMITTED))


def anchors(page: Path) -> set[str]:
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def broken(page: Path) -> list[str]:
    found = []
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        place, _, anchor = link.partition("#")
        target = (page.parent / place).resolve() if place else page
        if not is_active(target) or (anchor and anchor not in anchors(target)):
            found.append(link)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    assert not broken(page)


def test_pictures_under_docs_are_shown():
    shown = {
        (page.parent / link).resolve() for page in PAGES for link in LINK.findall(page.read_text(encoding="utf-8"))
    }
    pictures = [path for folder in ("docs/pictures", "results/benchmarks") for path in (ROOT / folder).glob("*.png")]
    assert [path.name for path in pictures if path not in shown] == []


def test_pages_that_are_kept_are_small():
    pages = [path for folder in ("docs", "results/benchmarks") for path in (ROOT / folder).rglob("*") if path.is_file()]
    pages = [path for path in pages if not {"_build", "gallery", "jupyter_execute"} & set(path.parts)]
    assert sum(path.stat().st_size for path in pages) < 3e6
