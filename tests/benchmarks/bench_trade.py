"""Speed against accuracy of ready problems, and the times of a trade beside the same calls made separately.

Writes results/benchmarks/trade.md and its picture, and the page of each problem to results/trade.
"""

from __future__ import annotations

import importlib
import json
import re
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from bench_fidelity import SOLVED
from pages import PAGES, processor_seconds, publish, spent

import laufruhe
from laufruhe.cli.fidelity import traded
from laufruhe.fidelity.error_bounds import ErrorReference
from laufruhe.files.toml_text import toml_text
from laufruhe.numerics.cores import processors
from laufruhe.problem.problem import Problem
from laufruhe.studies.trade import FASTER, KEEPS, NO_GAS, RIGID, TWO_ORDER, Batch, ladder, measured
from problem_files import PROBLEMS

FOLDER = PAGES.parent / "trade"
SHOWN = (
    RIGID, NO_GAS, TWO_ORDER, "orders to 4, 96 steps", "orders to 8, 192 steps", "orders to 24, 360 steps",
    "exact, 720 steps", "auto 0.01", "auto 0.001", "auto 0.0001",
)  # fmt: skip
COMPARED = (
    "tractor-single", "tractor-two", "tractor-three", "tractor-four-lanchester", "tractor-six", "inline-five-shafts",
    "vee-two-90", "vee-six-60", "vee-eight-cross", "tractor-single-shafts",
)  # fmt: skip
WORDS = {"evaluation": "evaluate", "solve": "solve", "scene": "scene of a sweep", "batch": "10,000 designs"}
ROUNDS = 3
LEAST, BEYOND = 1e-8, 20.0
"""What is under it is drawn at it; and where designs beyond a limit are."""


def draw(trades: list[dict[str, Any]]) -> None:
    """Error and regret of the usual fidelities: a dot for each problem, a bar in the middle of them."""
    style = importlib.import_module("laufruhe.plots.style")
    drawn = style.page(1, 2, (3.5, 3.6), across=0.3)
    rows = [row for trade in trades for row in trade["rows"]]
    shown = [name for name in SHOWN if any(row["name"] == name for row in rows)]
    for axes, key, name in zip(drawn.panels, ("error", "regret"), ("error of the objective", "regret"), strict=True):
        for k, fidelity in enumerate(shown):
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
        axes.set(xscale="log", xlabel=name, yticks=range(len(shown)), ylim=(len(shown) - 0.5, -0.5))
        axes.set_xlim(0.5 * LEAST, 60.0)
        axes.set_xticks([10.0**power for power in range(-8, 2, 2)])
        axes.set_xticklabels(["under 1e-8", "1e-6", "1e-4", "1 %", "100 %"])
        axes.minorticks_off()
    drawn.panels[0].set_yticklabels(shown)
    drawn.panels[1].set_yticklabels([])
    text = (
        f"A dot: one of {len(trades)} ready problems; a bar: the middle of them. "
        "x: designs beyond a limit by the exact model."
    )
    foot = "Left: what a number is off by; right: by how much its design is worse. Computed with Laufruhe."
    style.heading(drawn, "What cheap fidelities cost", text, [], foot)
    style.save(drawn.figure, PAGES / "trade.png")


def separate_calls() -> list[str]:
    """Prices of a trade at fidelity `auto`, and the times of public calls."""
    lines = [
        "## A trade beside separate calls",
        "",
        f"Processor time of each call by the trade, and of the same public call alone, the least of {ROUNDS} in turns.",
        "A scene is one of six in a sweep of the speed: the time of a study of eight less that of one of two.",
        "Scenes of one problem differ: those of `tractor-two` take 130 or 290 ms, as the speed has it.",
        "",
        "| problem | call | trade | separate call | ratio |",
        "| --- | --- | ---: | ---: | ---: |",
    ]
    for name in COMPARED:
        problem = laufruhe.load(PROBLEMS / f"{name}.toml")
        scale, batch = ErrorReference.of(problem), Batch(problem)
        (variant,) = (variant for rung, variant in ladder(scale) if rung == "auto 0.001")
        calls: dict[str, Callable[[], float]] = {
            "evaluation": lambda own=variant: min(spent(lambda: laufruhe.evaluate(own)) for _ in range(30)),
            "solve": lambda own=variant: min(spent(lambda: laufruhe.solve(own)) for _ in range(3)),
            "scene": lambda own=problem: _scene_of_study(own),
            "batch": lambda own=variant, b=batch: min(
                spent(lambda: laufruhe.evaluate_many(own, b.columns)) for _ in range(3)
            ),
        }
        rounds = [
            (measured("auto 0.001", variant, scale, batch), {call: work() for call, work in calls.items()})
            for _ in range(ROUNDS)
        ]
        for call, words in WORDS.items():
            price, alone = min(getattr(row, call) for row, _ in rounds), min(times[call] for _, times in rounds)
            cells = f"{1e3 * price:.2f} ms | {1e3 * alone:.2f} ms | {price / alone:.2f}"
            lines.append(f"| {name} | {words} | {cells} |")
    return [*lines, ""]


def _scene_of_study(problem: Problem) -> float:
    """Processor time of a scene in a study of the public call at fidelity `auto 0.001` [s]."""
    tables = dict(problem.origin.tables)
    tables["fidelity"] = {"kinematics": "auto", "tolerance": 1e-3}
    (key,) = {"speed", "mean_piston_speed"} & tables["operating_points"][0].keys()
    number, unit = str(tables["operating_points"][0][key]).split()

    def sweep(scenes: int) -> float:
        speeds = [f"{float(number) * FASTER**k} {unit}" for k in range(1, scenes + 1)]
        part = {
            "name": "sweep", "kind": "layout comparison", "title": "sweep",
            "sweep": [{"quantity": f"operating_points.1.{key}", "values": speeds}],
            "cases": [{"name": "one", "problem": "problem.toml"}],
        }  # fmt: skip
        with TemporaryDirectory() as folder:
            study = Path(folder) / "study.toml"
            study.write_text(toml_text({"title": "sweep", "study": {"parts": [part]}}), encoding="utf-8")
            (study.parent / "problem.toml").write_text(toml_text(tables), encoding="utf-8")
            return spent(lambda: laufruhe.study(study))

    return (sweep(8) - sweep(2)) / 6.0


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
