"""Studies and solves killed at random moments, alone and two at once in one folder, kept points damaged in between.

Writes results/benchmarks/kills.md: what was tried, and everything whose files were not those of one run.
`python tests/benchmarks/bench_kills.py 60` tries so many studies, and a third as many solves, a
quarter of an hour long.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from pages import PAGES, publish

from cli import solve_kills
from studies import kills

OUT = PAGES / "kills.md"
TRIED = 18
WORDS = """{} studies of {} points in three parts, each killed one to four times at seeded random moments by SIGINT,
SIGTERM or SIGKILL, alone or two at once in one folder, their kept points damaged after every kill, and then left to
end. Datasets, CSV files, pictures and the report but for its table of times are compared byte by byte with those of one
run that nothing stopped. {} solves of one problem likewise, up to three times; after every kill the folder of
results has none, or all of one run. What a crash of the machine leaves is not tried.
"""


def page(counts: kills.Log, studies: int, points: int, solves: int) -> str:
    """Return the page: what was tried, and how often each outcome occurred."""
    rows = [f"| {what} | {count} |" for what, count in sorted(counts.tried.items())]
    wrong = [f"- {line}" for line in counts.wrong] or ["None."]
    head = [
        "# Killed studies and solves",
        "",
        WORDS.format(studies, points, solves),
        "| tried | times |",
        "| --- | ---: |",
    ]
    return "\n".join([*head, *rows, "", "What ended otherwise:", "", *wrong, ""])


def main() -> None:
    """Try as many as asked."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else TRIED
    with tempfile.TemporaryDirectory() as name:
        whole, counts = kills.uninterrupted(Path(name) / "whole"), kills.Log()
        for seed in range(count):
            kills.attacked(Path(name) / "s", seed, whole, counts)
        solved = solve_kills.uninterrupted(Path(name) / "solved")
        for seed in range(count // 3):
            solve_kills.attacked(Path(name) / "s", seed, solved, counts)
    publish(OUT, page(counts, count, 4 * 7 + 12 + 1, count // 3))
    sys.exit(bool(counts.wrong))


if __name__ == "__main__":
    main()
