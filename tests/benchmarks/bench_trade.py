"""Speed against accuracy of ready problems, and the times of a trade beside the same calls made separately.

Writes results/benchmarks/trade.md and its picture, and the page of each problem to results/trade.
"""

from __future__ import annotations

import importlib
import json
import math
import re
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from bench_fidelity import SOLVED
from pages import PAGES, processor_seconds, publish, spent

import laufruhe
from laufruhe.cli.fidelity import traded
from laufruhe.fidelity.error_bounds import ErrorReference
from laufruhe.load_models.batch import prepare
from laufruhe.numerics.cores import processors
from laufruhe.physics.shaking_loads import forget
from laufruhe.studies.trade import KEEPS, NO_GAS, RIGID, TWO_ORDER, Batch, ladder, measured
from problem_files import PROBLEMS

FOLDER = PAGES.parent / "trade"
SHOWN = (
    RIGID, NO_GAS, TWO_ORDER, "orders to 4, 96 steps", "orders to 8, 192 steps", "orders to 24, 360 steps",
    "exact, 720 steps", "auto 0.01", "auto 0.001", "auto 0.0001",
)  # fmt: skip
LEAST, BEYOND = 1e-8, 20.0
"""What is under it is drawn at it; and where designs beyond a limit are."""


def draw(trades: list[dict[str, Any]]) -> None:
    """Error and regret of the usual fidelities: a dot for each problem, a bar in the middle of them."""
    style = importlib.import_module("laufruhe.plots.style")
    drawn = style.page(1, 2, (3.5, 3.6), across=0.3)
    rows = [row for trade in trades for row in trade["rows"]]
    for axes, key, name in zip(drawn.panels, ("error", "regret"), ("error of the objective", "regret"), strict=True):
        for k, fidelity in enumerate(SHOWN):
            own = [row for row in rows if row["name"] == fidelity and row[key] is not None]
            broken = [row for row in own if key == "regret" and row["excess"] > KEEPS]
            values = np.sort([max(row[key], LEAST) for row in own if row not in broken])
            apart = 0.6 * (np.random.default_rng(k).random(len(values)) - 0.5)
            axes.scatter(values, k + apart, s=9, color=style.BLUE, alpha=0.45, linewidths=0.0, zorder=3)
            if len(values):
                middle = float(np.median(values))
                axes.plot([middle, middle], [k - 0.36, k + 0.36], color=style.VERMILION, lw=1.8, zorder=4)
            if broken:
                axes.annotate(
                    f"x {len(broken)}", (BEYOND, k), va="center", ha="center", fontsize=8, backgroundcolor="white"
                )
        axes.set(xscale="log", xlabel=name, yticks=range(len(SHOWN)), ylim=(len(SHOWN) - 0.5, -0.5))
        axes.set_xlim(0.5 * LEAST, 60.0)
        axes.set_xticks([10.0**power for power in range(-8, 2, 2)])
        axes.set_xticklabels(["under 1e-8", "1e-6", "1e-4", "1 %", "100 %"])
        axes.minorticks_off()
    drawn.panels[0].set_yticklabels(SHOWN)
    drawn.panels[1].set_yticklabels([])
    text = (
        f"A dot: one of {len(trades)} ready problems; a bar: the middle of them. "
        "x: designs beyond a limit by the exact model."
    )
    foot = "Left: what a number is off by; right: by how much its design is worse. Computed with Laufruhe."
    style.heading(drawn.figure, "What cheap fidelities cost", text, [], foot)
    style.save(drawn.figure, PAGES / "trade.png")


def separate_calls() -> list[str]:
    """Times by a trade at fidelity `auto`, and of the public calls after it."""
    lines = [
        "## A trade beside separate calls",
        "",
        "Processor time of each call by the trade, and of the same public call after it, the least of a few.",
        "",
        "| problem | call | trade | separate call | ratio |",
        "| --- | --- | ---: | ---: | ---: |",
    ]
    for name in SOLVED[:10]:
        problem = laufruhe.load(PROBLEMS / f"{name}.toml")
        scale, batch = ErrorReference.of(problem), Batch(problem)
        (variant,) = (variant for rung, variant in ladder(scale) if rung == "auto 0.001")
        row = measured("auto 0.001", variant, scale, batch)
        calls: list[tuple[str, float, Callable[[], object]]] = [
            ("evaluate", row.evaluation, lambda own=variant: laufruhe.evaluate(own)),
            ("solve", row.solve, lambda own=variant: laufruhe.solve(own)),
        ]
        if math.isfinite(row.batch):
            calls.append(("10,000 designs", row.batch, lambda own=variant, b=batch: prepare(own).objective(b.values)))
        for call, seconds, work in calls:
            alone = min(_alone(work) for _ in range(50 if seconds < 5e-3 else 5))
            lines.append(f"| {name} | {call} | {1e3 * seconds:.2f} ms | {1e3 * alone:.2f} ms | {seconds / alone:.2f} |")
    return [*lines, ""]


def _alone(work: Callable[[], object]) -> float:
    forget()
    return spent(work)


def main() -> None:
    """Measure, and keep the table alone."""
    started, before = time.perf_counter(), processor_seconds()
    *_, as_json = traded([PROBLEMS / f"{name}.toml" for name in SOLVED], FOLDER, print)
    seconds, total = time.perf_counter() - started, processor_seconds() - before
    (FOLDER / "trades.json").write_text(as_json(), encoding="utf-8")
    # the pages of single problems are not kept
    text = re.sub(r"\[([\w-]+)\]\(\1\.md\)", r"`\1`", (FOLDER / "README.md").read_text(encoding="utf-8"))
    made = f"Made in {seconds:.0f} s with {processors()} processes, which took {total:.0f} s of a processor together."
    picture = "![Error and regret of the usual fidelities over all ready problems](trade.png)"
    head, table = text.split("\n\n| ", 1)
    draw(json.loads(as_json()))
    separate = "\n".join(separate_calls())
    publish(PAGES / "trade.md", f"{head}\n\n{picture}\n\n| {table.rstrip()}\n\n{made}\n\n{separate}")


if __name__ == "__main__":
    main()
