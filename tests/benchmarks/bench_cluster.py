"""Studies on a cluster of this machine: bits, kills, a full disk, overhead, and growth with size and workers.

Writes results/benchmarks/cluster.md and cluster.png. `--kills`, `--evaluations` and `--solves` say how many runs are
killed, and how many designs and scenes the largest studies have, `--long` how many scenes are solved on all processors
by one command: 100000 take seven minutes on four. `--kills 40` takes a quarter of an hour.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pages import PAGES, publish

from laufruhe.extensions.random_studies.sampled import MAX_TABLED
from laufruhe.numerics import cluster as own_cluster
from laufruhe.numerics.cluster import cluster as on_cluster
from laufruhe.numerics.processes import Processes
from laufruhe.numerics.workers import SERIAL, unordered_map
from laufruhe.plots.picture import save_picture
from laufruhe.present import picture as p
from studies import clusters

OUT = PAGES / "cluster.md"
WORKERS = (1, 2, 4, 7)
TASKS = 1000
SMALL = {"draws": 4000, "chunk": 500, "scenes": 40, "few": 2, "points": 3}
SHARED = {"draws": 100_000, "chunk": 10_000, "scenes": 160, "few": 10, "points": 2}
ROOM = 40 << 10
FULL = """import errno, os
from laufruhe.extensions.random_studies.draws import Draws
keep, taken = Draws.keep, []
def full(store, mark, seconds, record):
    taken.append(record["values"].nbytes)
    if sum(taken) > {}:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    keep(store, mark, seconds, record)
Draws.keep = full
from laufruhe.cli import main; main()"""
DAY = 86_400.0
HEAD = """# Many designs, on this machine and on a cluster

Studies of two kinds: random designs, evaluated many at once, and random scenes, each decided to a proof. Seconds
by the clock stand beside seconds of processors, which count where the machine did other work too.

## Overhead of a piece

Of {} pieces that do nothing, by the clock.
"""


@dataclass(frozen=True)
class Cost:
    """Cost of one run: size, time by the clock and of processors [s], files, bytes, peak of memory [byte]."""

    size: int
    wall: float
    cores: float
    files: int
    stored: int
    memory: int

    def row(self) -> str:
        """Return the row of a table."""
        sizes = f"{self.files} | {self.stored / 1e6:.2f} | {self.memory / 1e6:.0f}"
        return f"| {self.size:,} | {self.wall:.1f} | {self.cores:.1f} | {sizes} |"


COSTS = "| size | time [s] | core-seconds | files of the store | MB | peak memory of the client [MB] |"


def each_of(costs: list[Cost]) -> float:
    """Return the processor time of one more [s] from the two largest runs, without start and tables."""
    return (costs[-1].cores - costs[-2].cores) / (costs[-1].size - costs[-2].size)


def timed(folder: Path, *words: str) -> tuple[float, float, int]:
    """Run a study, and return seconds by the clock and of processors, and its largest memory [byte]."""
    began = time.perf_counter()
    process = subprocess.Popen(
        [*clusters.LAUFRUHE, "study", "s.toml", "--out", "out", *words], cwd=folder, env=clusters.environment(),
        stdout=subprocess.DEVNULL,
    )  # fmt: skip
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"the study in {folder} ended with {process.returncode}")
    return time.perf_counter() - began, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024


def stored(root: Path, part: str) -> tuple[float, int, int, int]:
    """Return core-seconds, draws done, files and bytes of a part in a store."""
    files = list((root / part).glob("*.npz"))
    pieces = [np.load(path) for path in files]
    draws = sum(len(piece["values"]) for piece in pieces)
    return (
        sum(float(piece["seconds"]) for piece in pieces),
        draws,
        len(files),
        sum(path.stat().st_size for path in files),
    )


def overheads(cluster: clusters.Cluster) -> tuple[list[str], float]:
    """Return table rows of the time of a piece that does nothing, and that of a cluster [ms]."""

    def spent(executor: Executor) -> float:
        list(unordered_map(abs, [-1] * 50, executor))
        began = time.perf_counter()
        list(unordered_map(abs, [-1] * TASKS, executor))
        return 1e3 * (time.perf_counter() - began) / TASKS

    with Processes(2) as pool, on_cluster(cluster.address) as dask:
        rows = [("this process", spent(SERIAL)), ("processes, 2", spent(pool)), ("Dask, 2 workers", spent(dask))]
    lines = [f"| {name} | {milliseconds:.2f} |" for name, milliseconds in rows]
    return ["| who works | ms a piece |", "| --- | ---: |", *lines], rows[-1][1]


def shared(folder: Path) -> tuple[list[str], list[tuple[int, float, float, float]]]:
    """Return the lines of the same study on more and more workers, compared with one process."""
    serial = clusters.prepared(folder / "serial", **SHARED)
    wall, alone, _ = timed(serial, "--jobs", "1")
    rows, costs = [f"| one process | {wall:.1f} | {alone:.1f} | | |"], []
    for count in WORKERS:
        with clusters.cluster(folder / f"c{count}", count) as cluster:
            with on_cluster(cluster.address) as executor:
                while executor.count < count:  # type: ignore[attr-defined]
                    time.sleep(0.1)
            here, before = clusters.prepared(folder / str(count), **SHARED), cluster.processor_time()
            wall, client, _ = timed(here, "--scheduler", cluster.address)
            at_work = cluster.processor_time() - before
        differ = clusters.same(serial, here)
        costs.append((count, wall, at_work, client))
        rows.append(f"| {count} | {wall:.1f} | {client:.1f} | {at_work:.1f} | {', '.join(differ) or 'none'} |")
    head = "| workers | time [s] | core-seconds of the client | of all workers | files and arrays that differ |"
    return [head, "| --- | ---: | ---: | ---: | --- |", *rows], costs


def killed(folder: Path, count: int) -> list[str]:
    """Return the lines of runs with processes killed at random, each compared with an uninterrupted run."""
    serial = clusters.prepared(folder / "serial", **SMALL)
    seconds, _, _ = timed(serial, "--jobs", "1")
    tried, wrong = Counter[str](), []
    with clusters.cluster(folder / "cluster", 2) as cluster:
        for seed in range(count):
            rng, here = random.Random(seed), clusters.prepared(folder / "run", **SMALL)
            for _ in range(rng.randint(1, 3)):
                tried[_attacked(cluster, here, rng, seconds)] += 1
            said = clusters.finished(here, "--scheduler", cluster.address)
            differ = [said] if said else list(clusters.same(serial, here))
            wrong += [f"- run {seed}: {', '.join(differ)}"] if differ else []
            shutil.rmtree(here)
    rows = [f"| {what} | {times} |" for what, times in sorted(tried.items())]
    return [
        "| tried | times |",
        "| --- | ---: |",
        *rows,
        "",
        f"{count} runs. What ended otherwise:",
        "",
        *(wrong or ["None."]),
    ]


def _attacked(cluster: clusters.Cluster, here: Path, rng: random.Random, seconds: float) -> str:
    """Run once, end one process at a random moment, and return its name."""
    running = clusters.started(here, "--scheduler", cluster.address)
    until = time.monotonic() + rng.uniform(1.0, max(seconds, 2.0))
    while time.monotonic() < until and running.poll() is None:
        time.sleep(0.05)
    late = " (too late)" if running.poll() is not None else ""
    who = rng.choice(("worker", "worker", "both workers", "scheduler", "client"))
    if who == "client":
        running.kill()
    elif who == "scheduler":
        cluster.kill()
        time.sleep(rng.uniform(0.0, 3.0))
        cluster.start(2)
    else:
        for _ in range(1 if who == "worker" else 2):
            cluster.kill_worker(rng.randrange(len(cluster.workers)))
            cluster.add()
    said = running.communicate()[1]
    if who != "client" and running.returncode:
        return f"{who} killed{late}: ended with {running.returncode}, {said.strip()[-200:]}"
    return f"{who} killed by SIGKILL{late}"


def full_disk(folder: Path) -> list[str]:
    """Return the lines of a store that fills a disk after so many bytes, then of one with room."""
    serial, here = clusters.prepared(folder / "whole", **SMALL), clusters.prepared(folder / "full", **SMALL)
    timed(serial, "--jobs", "1")
    words = [sys.executable, "-c", FULL.format(ROOM), "study", "s.toml", "--out", "out", "--jobs", "1"]
    ended = subprocess.run(words, cwd=here, env=clusters.environment(), capture_output=True, text=True)
    pieces = clusters.pieces_done(here)
    again = clusters.finished(here, "--jobs", "1")
    differ = [again] if again else list(clusters.same(serial, here))
    first = f"A store of {ROOM >> 10} kB and no more ended the study with exit status {ended.returncode}, and one line:"
    then = f"{pieces} pieces were kept. With room made, the same command went on;"
    none = f"files that differ from those of one run: {', '.join(differ) or 'none'}."
    return [first, "", f"    {ended.stderr.strip()}", "", f"{then} {none}"]


def grown(folder: Path, evaluations: int, solves: int) -> tuple[list[Cost], list[Cost]]:
    """Return the costs of growing numbers of random designs and of random scenes, in one process."""
    costs: tuple[list[Cost], list[Cost]] = [], []
    for which, part, maximum in ((0, "designs", evaluations), (1, "engines", solves)):
        # the two largest of evaluations have no tables, and differ in draws alone
        for size in (maximum // 100, maximum // 10, maximum, *([4 * maximum] if which == 0 else [])):
            words = {"draws": size, "chunk": 10_000} if which == 0 else {"scenes": size, "few": min(size, 100)}
            here = clusters.prepared(folder / f"{part}{size}", **{**{"draws": 1, "scenes": 1, "points": 2}, **words})
            wall, cores, memory = timed(here, "--jobs", "1")
            _, done, files, size_of = stored(clusters.draws_in(here / "out"), part)
            assert done == size
            costs[which].append(Cost(size, wall, cores, files, size_of, memory))
            shutil.rmtree(here)
    return costs


def at_once(folder: Path, solves: int) -> Cost:
    """Return the cost of random scenes on all processors, by one command."""
    here = clusters.prepared(folder, draws=1, scenes=solves, few=500, points=2)
    wall, _, memory = timed(here)
    cores, done, files, size = stored(clusters.draws_in(here / "out"), "engines")
    assert done == solves
    return Cost(done, wall, cores, files, size, memory)


def plan(evaluated: list[Cost], solved: list[Cost], handing: float) -> list[str]:
    """Return the estimated time of 1e9 draws of each kind; `handing` is the time to hand out a piece [ms]."""
    rows = []
    for name, costs, chunk in (("evaluations", evaluated, 100_000), ("proven solves", solved, 10_000)):
        seconds, pieces = 1e9 * each_of(costs), 1e9 / chunk
        cells = [f"{seconds:.2g}", f"{seconds / 1000 / 3600:.2g} h", f"{chunk:,}", f"{pieces:,.0f}"]
        cells += [
            f"{1e3 * each_of(costs) * chunk:,.0f} ms",
            f"{1e-3 * handing * pieces / 60:.1f} min",
            f"{2 * pieces:,.0f}",
        ]
        rows.append(f"| {' | '.join([name, *cells, f'{1e9 * costs[-1].stored / costs[-1].size / 1e9:.0f} GB'])} |")
    head = "| 1e9 | core-seconds | on 1000 cores | `chunk` | pieces | each takes | to hand out | files | store |"
    return [head, "| --- " + "| ---: " * 8 + "|", *rows]


def drawn(sizes: tuple[list[Cost], list[Cost]], counts: list[tuple[int, float, float, float]]) -> None:
    """Draw the growth with size and with workers."""
    series = (("evaluations", "blue", sizes[0]), ("proven solves", "orange", sizes[1]))
    grown: list[p.Mark] = [
        p.Line([c.size for c in costs], [c.cores for c in costs], colour, name, marker="o")
        for name, colour, costs in series
    ]
    left = p.Panel(
        grown, p.Axis("draws", log=(1.0,)), p.Axis("core-seconds of the command", log=(1.0, 2.0, 5.0)), "Size"
    )
    x = [count for count, *_ in counts]
    marks: list[p.Mark] = [
        p.Line(x, [one[k] for one in counts], colour, name, marker=marker)
        for k, name, colour, marker in ((2, "core-seconds of all workers", "green", "s"),
                                        (3, "core-seconds of the client", "purple", "D"))
    ]  # fmt: skip
    across = p.Axis("workers", ticks=[(count, str(count)) for count in x])
    maximum = max(max(one[2:]) for one in counts)
    right = p.Panel(marks, across, p.Axis("core-seconds", (0.0, 1.2 * maximum)), "Workers, the same study")
    words = "Random designs and random scenes of one cylinder; Dask workers on one machine."
    credit = "Computed with Laufruhe."
    picture = p.Picture("Many designs: what they cost", words, [left, right], credit, columns=2, gap=0.7)
    save_picture(picture, OUT.with_suffix(""))


def command_line() -> argparse.Namespace:
    """Return the arguments: numbers of draws, scenes and kills."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=8)
    parser.add_argument("--evaluations", type=at_least(2 * MAX_TABLED), default=1_000_000)
    parser.add_argument("--solves", type=at_least(100), default=1000)
    parser.add_argument("--long", type=int, default=5000)
    return parser.parse_args()


def at_least(minimum: int) -> Callable[[str], int]:
    """Return numbers so large that one more takes longer than the start."""

    def number(word: str) -> int:
        if int(float(word)) < minimum:
            raise argparse.ArgumentTypeError(f"{word} is too few to tell growth from what starting takes: {minimum}")
        return int(float(word))

    return number


def main() -> None:
    """Measure everything and write the page."""
    arguments = command_line()
    # on a busy machine a scheduler answers late
    own_cluster.ANSWERS = own_cluster.PATIENCE = 600.0
    lines = [HEAD.format(TASKS)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with clusters.cluster(folder / "empty", 2) as cluster:
            rows, handing = overheads(cluster)
            lines += [*rows, ""]
        shares, counts = shared(folder / "shared")
        lines += [SHARES.format(**SHARED), *shares, "", IMPORTS, *killed(folder / "kills", arguments.kills)]
        lines += ["", "## A full disk", "", *full_disk(folder / "disk"), ""]
        sizes = grown(folder / "grown", arguments.evaluations, arguments.solves)
        long = [LONG, "", COSTS, BAR, at_once(folder / "long", arguments.long).row(), ""] if arguments.long else []
    each_one = [
        f"One more takes {1e6 * each_of(costs):,.1f} µs of one core, from the runs of {costs[-2].size:,} and "
        f"{costs[-1].size:,}."
        for costs in sizes
    ]
    lines += ["## Growth with size", "", TABLED.format(MAX_TABLED), COSTS, BAR, *(cost.row() for cost in sizes[0]), ""]
    lines += [each_one[0], "", "Proven solves at random mean piston speeds:", ""]
    lines += [COSTS, BAR, *(cost.row() for cost in sizes[1]), "", each_one[1]]
    lines += ["", *long, "![Growth with size and workers](cluster.png)", "", "## A thousand million, on paper", ""]
    lines += [*plan(*sizes, handing), "", PAPER.format(handing)]
    drawn(sizes, counts)
    publish(OUT, "\n".join(lines))


BAR = "| ---: " * 6 + "|"
SHARES = """## More and more workers

{draws:,} designs in pieces of {chunk:,}, and {scenes} solves in pieces of {few}. Reports, data, pictures and every
number of the store beside those of one process:
"""
IMPORTS = """Each worker imports the package once, which takes one to two seconds of a core.

## Kills

SIGKILL at random moments, one to three times a run; a worker or a scheduler that is killed is started again, a client
that is killed is the same command again. Every file and number is compared with those of one process.
"""
TABLED = """The problem is `problems/tractor-single.toml` at 144 samples of a cycle: one balance factor is open, for the
least mean mount force.

Evaluations; up to {:,} are written as a table and a workbook too, of more the dataset alone:
"""
LONG = """As many as this by one command on all processors, in pieces of 500. Every one is a proven optimum."""
PAPER = """The same problem, extrapolated from the two largest runs. The scheduler of this run
handed out a piece each {:.1f} ms, so a piece must take longer
than that times the number of workers: of evaluations, which take microseconds, a million a piece keep a
thousand busy and no more, and a dozen cores do the work in minutes without a cluster. Who started the
study writes the store: 1 to 2 ms a piece beside the bytes. `done` is checked when a study goes on, which
reads all of the store once. The dataset takes 8 bytes a number at once; a thousand million draws would be
read piece by piece, which reports do not do yet.
"""


if __name__ == "__main__":
    main()
