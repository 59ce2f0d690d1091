"""Check of every combination, or of a share: `make matrix` writes files that break a claim to results/matrix/."""

from __future__ import annotations

import argparse
import collections
import random
import shutil
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from matrix.cells import Cell, cells, document_of, written
from matrix.claims import Verdict, evaluate_design

OUT = Path(__file__).parents[2] / "results" / "matrix"


def _one(cell: Cell) -> tuple[Cell, Verdict, float]:
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        verdict = evaluate_design(cell, Path(folder))
    return cell, verdict, time.perf_counter() - started


def main() -> int:
    """Judge the cells, print the counts, and keep the files of wrong ones."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--share", type=float, default=1.0, help="of all combinations")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", default="", help="part of a cell's name")
    arguments = parser.parse_args()
    chosen = [cell for cell in cells(arguments.seed) if arguments.only in str(cell)]
    random.Random(arguments.seed).shuffle(chosen)
    chosen = chosen[: round(arguments.share * len(chosen))]
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    ends: collections.Counter[str] = collections.Counter()
    slow: list[tuple[float, str]] = []
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for cell, verdict, seconds in pool.map(_one, chosen, chunksize=4):
            ends["refused" if verdict.refused else f"{verdict.status} {verdict.kind}".strip() or "error"] += 1
            slow.append((seconds, str(cell)))
            if verdict.broken:
                ends["broken"] += 1
                said = "".join(f"# {line}\n" for line in verdict.broken)
                name = str(cell).replace(" | ", "--").replace(" ", "-")
                (OUT / f"{name}.toml").write_text(said + written(document_of(cell)), encoding="utf-8")
                print(f"{cell}: {'; '.join(verdict.broken)} ({seconds:.1f} s)", flush=True)
            elif seconds > 20.0:
                print(f"{cell}: {seconds:.1f} s", flush=True)
    print(", ".join(f"{count} {end}" for end, count in ends.most_common()))
    print("slowest:", *(f"{seconds:.1f} s {name}" for seconds, name in sorted(slow)[-5:]), sep="\n  ")
    return 1 if ends["broken"] else 0


if __name__ == "__main__":
    sys.exit(main())
