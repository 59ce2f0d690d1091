"""Speed against accuracy of every ready problem.

Writes results/benchmarks/trade.md, and the page of each problem to results/trade.
"""

from __future__ import annotations

import re

from pages import PAGES, publish

from laufruhe.cli.fidelity import traded
from problem_files import READY

FOLDER = PAGES.parent / "trade"


def main() -> None:
    """Measure, and keep the table alone."""
    traded(READY, FOLDER, print)
    # the pages of single problems are not kept
    text = re.sub(r"\[([\w-]+)\]\(\1\.md\)", r"`\1`", (FOLDER / "README.md").read_text(encoding="utf-8"))
    publish(PAGES / "trade.md", text)


if __name__ == "__main__":
    main()
