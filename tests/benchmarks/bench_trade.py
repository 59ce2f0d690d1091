"""Speed against accuracy of ready problems, and the times of a trade beside the same calls made separately.

Writes results/benchmarks/trade.md and its picture.
"""

from __future__ import annotations

import importlib
import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from bench_fidelity import SOLVED
from pages import PAGES, processor_seconds, publish, spent

import laufruhe
from laufruhe.errors import counted
from laufruhe.extensions.fidelity import trade_report as report
from laufruhe.extensions.fidelity.reference import Reference
from laufruhe.extensions.fidelity.trade import (
    FASTER,
    KEEPS,
    NO_GAS,
    RIGID,
    TWO_ORDER,
    Batch,
    Trade,
    TradeRow,
    is_open,
    ladder,
    measured,
    trade,
)
from laufruhe.extensions.flywheel.machine import FLYWHEEL
from laufruhe.files.toml_text import toml_text
from laufruhe.numerics.cores import processors
from laufruhe.present.numbers import DASH, fixed
from laufruhe.present.tables import Table
from laufruhe.problem.dependence import open_kinds
from laufruhe.problem.problem import Problem
from laufruhe.report.document import Bullets, Document, Paragraph
from problem_files import PROBLEMS

LISTED = (
    RIGID, NO_GAS, TWO_ORDER, "orders to 4, 96 steps", "orders to 8, 192 steps", "orders to 24, 360 steps",
    "exact, 720 steps", "auto 0.01", "auto 0.001", "auto 0.0001",
)  # fmt: skip
COMPARED = (
    "tractor-single", "tractor-two", "tractor-three", "tractor-four-lanchester", "tractor-six", "inline-five-shafts",
    "vee-two-90", "vee-six-60", "vee-eight-cross", "tractor-single-shafts",
)  # fmt: skip
WORDS = {"evaluation": "evaluate", "solve": "solve", "scene": "scene of a sweep", "batch": "10,000 designs"}
AUTO = {"kinematics": "auto", "tolerance": 1e-3}
ROUNDS = 3
LOWEST, BEYOND = 1e-8, 20.0
"""Least value that is drawn, and place of designs beyond a limit."""


def draw(trades: list[dict[str, Any]]) -> None:
    """Draw error and regret of the usual fidelities: a dot for each problem, a bar at the median."""
    style = importlib.import_module("laufruhe.plots.style")
    drawn = style.page(1, 2, (3.5, 3.6), across=0.3)
    rows = [row for trade in trades for row in trade["rows"]]
    labels = [name for name in LISTED if any(row["name"] == name for row in rows)]
    for axes, key, name in zip(drawn.panels, ("error", "regret"), ("error of the objective", "regret"), strict=True):
        for k, fidelity in enumerate(labels):
            points = [row for row in rows if row["name"] == fidelity and row[key] is not None]
            broken = [row for row in points if key == "regret" and row["excess"] > KEEPS]
            values = np.sort([max(row[key], LOWEST) for row in points if row not in broken])
            jitter = 0.6 * (np.random.default_rng(k).random(len(values)) - 0.5)
            axes.scatter(values, k + jitter, s=9, color=style.BLUE, alpha=0.45, linewidths=0.0, zorder=3)
            if len(values):
                middle = float(np.median(values))
                axes.plot([middle, middle], [k - 0.36, k + 0.36], color=style.VERMILION, lw=1.8, zorder=4)
            if broken:
                axes.annotate(
                    f"x {len(broken)}", (BEYOND, k), va="center", ha="center", fontsize=8, backgroundcolor="white"
                )
        axes.set(xscale="log", xlabel=name, yticks=range(len(labels)), ylim=(len(labels) - 0.5, -0.5))
        axes.set_xlim(0.5 * LOWEST, 60.0)
        axes.set_xticks([10.0**power for power in range(-8, 2, 2)])
        axes.set_xticklabels(["under 1e-8", "1e-6", "1e-4", "1 %", "100 %"])
        axes.minorticks_off()
    drawn.panels[0].set_yticklabels(labels)
    drawn.panels[1].set_yticklabels([])
    text = (
        f"A dot: one of {len(trades)} ready problems; a bar: the middle of them. "
        "x: designs beyond a limit by the exact model."
    )
    foot = "Left: what a number is off by; right: by how much its design is worse. Computed with Laufruhe."
    style.heading(drawn, "What cheap fidelities cost", text, [], foot)
    style.save(drawn.figure, PAGES / "trade.png")


def separate_calls() -> list[str]:
    """Return the prices of a trade at fidelity `auto`, and the times of public calls."""
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
    for name, call, price, alone in call_times():
        cells = f"{1e3 * price:.2f} ms | {1e3 * alone:.2f} ms | {price / alone:.2f}"
        lines.append(f"| {name} | {WORDS[call]} | {cells} |")
    return [*lines, ""]


def call_times() -> Iterator[tuple[str, str, float, float]]:
    """Yield problem, call, its processor time by the trade and that of the public call alone [s]."""
    for name in COMPARED:
        problem = laufruhe.load(PROBLEMS / f"{name}.toml")
        scale, batch = Reference(problem), Batch(problem)
        (variant,) = (variant for rung, variant in ladder(scale) if rung == "auto 0.001")
        calls: dict[str, Callable[[], float]] = {
            "evaluation": lambda one=variant: min(spent(lambda: laufruhe.evaluate(one)) for _ in range(30)),
            "solve": lambda one=variant: min(spent(lambda: laufruhe.solve(one)) for _ in range(3)),
            "scene": lambda one=problem: scene_time(one),
            "batch": lambda one=variant, b=batch: min(
                spent(lambda: laufruhe.evaluate_many(one, b.columns)) for _ in range(3)
            ),
        }
        rounds = [
            (measured("auto 0.001", variant, scale, batch), {call: work() for call, work in calls.items()})
            for _ in range(ROUNDS)
        ]
        for call in WORDS:
            yield name, call, min(getattr(row, call) for row, _ in rounds), min(times[call] for _, times in rounds)


def scene_time(problem: Problem, fidelity: Mapping[str, Any] = AUTO) -> float:
    """Return the processor time of a scene in a study of the public call at a fidelity [s]."""
    tables = {**problem.origin.tables, "fidelity": fidelity}
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


INDEX = (
    "problem", "one solve", "its time", "ten thousand designs", "their time", "error of two-order",
    "error without gas", "error of auto 0.001", "regret of two-order", "regret of auto 0.001", "uneven speed",
    "reason of a dash",
)  # fmt: skip
INDEX_COLUMNS = (
    "*One solve, ten thousand designs*: the fastest fidelity whose design, and whose largest error, is within 0.1 %, "
    "and its processor time after a first call; one evaluation if nothing is open. "
    "*Regret*: exact objective of a fidelity's design over that of the best design known, minus one. "
    "*Beyond a limit*: share by which that design breaks a limit in the exact model, stated above 0.1 %. "
    "*Uneven speed*: change of the objective with a flywheel that leaves 2 % of irregularity."
)


def index(trades: Sequence[Trade]) -> Document:
    """Return the page on several problems: a row for each, and their common findings."""
    rows = list(map(_index_row, trades))
    short = (
        "`auto` is the safe choice: a solve has all physics, and many designs the samples that keep them in tolerance.",
        f"{_cost(trades, TWO_ORDER, 'The two-order formulas of textbooks cost')} "
        "If the second order of an engine cancels, only orders remain that these formulas neglect.",
        f"{_cost(trades, NO_GAS, 'Neglecting gas costs')} Gas determines how the roll moment is balanced.",
        f"{_cost(trades, RIGID, 'Taking elastic mounts for rigid costs')} A reduced number of modes saves no time: "
        "all excited modes take the same time.",
        "More than 720 steps in a cycle improve peaks and proofs, not means.",
        "Regret may be far below the error, because an optimum is flat. It may also be far above it, because a shaft "
        "then balances the wrong load. Read both columns.",
    )
    lead = f"Which fidelity to take, measured on {len(trades)} problem{'s' * (len(trades) > 1)}. In short:"
    rows.sort(key=lambda row: row[0].strip("`"))
    table = Table(INDEX, rows, left=(0, 1, 3, len(INDEX) - 1), marked=True)
    return Document(
        "Speed against accuracy", (Bullets(lead, short, marked=True), table, Paragraph(INDEX_COLUMNS, marked=True))
    )


def _index_row(trade: Trade) -> list[str]:
    two, auto, gas = (_named(trade, name) for name in (TWO_ORDER, "auto 0.001", NO_GAS))
    one, many = report.choices(trade)
    seconds = math.nan if one is None else one.solve if is_open(trade.problem) else one.evaluation
    chosen = [cell for row, spent in ((one, seconds), (many, many.batch if many else math.nan))
              for cell in (f"`{row.name}`" if row else DASH, report._time(spent))]  # fmt: skip
    uneven = DASH if trade.flywheel is None else f"{fixed(100.0 * trade.flywheel[1], 2, '+')} %"
    name, errors = trade.problem.name, [DASH if row is None else report._share(row.error) for row in (two, gas, auto)]
    return [
        f"`{name}`",
        *chosen,
        *errors,
        *(DASH if row is None else report._regret(row) for row in (two, auto)),
        uneven,
        _why_dashes(trade),
    ]


def _why_dashes(trade: Trade) -> str:
    """Return the reasons for missing numbers of the index."""
    problem, (one, many) = trade.problem, report.choices(trade)
    reasons = {
        "nothing is open": not is_open(problem),
        "not all that is open are unbalances": is_open(problem) and many is None,
        "no design within the limits was found": is_open(problem) and math.isnan(trade.optimum),
        "the optimum is zero": trade.optimum == 0.0,
        "no fidelity finds a design within 0.1 % of the best": one is None and trade.optimum > 0.0,
        "the objective depends on no load": not problem.load_terms,
        "there is no gas": _named(trade, NO_GAS) is None,
        "a load inside the crankcase needs constant speed": bool(problem.load_terms) and trade.flywheel is None,
    }
    return "; ".join(why for why, holds in reasons.items() if holds)


def _named(trade: Trade, name: str) -> TradeRow | None:
    return next((row for row in trade.rows if row.name == name), None)


def _cost(trades: Sequence[Trade], name: str, what: str) -> str:
    """Return a sentence on the errors of a fidelity in values and designs, largest and median over problems."""
    rows = [row for trade in trades if trade.problem.load_terms and (row := _named(trade, name)) is not None]
    errors = sorted(row.error for row in rows)
    regrets = sorted(row.regret for row in rows if row.decides and not math.isnan(row.regret))
    broken = sum(row.violation > KEEPS for row in rows)
    if not errors:
        return f"{what} nothing here: no problem has this fidelity."
    text = f"{what} {_up_to(errors[-1])} of the value{_median(errors)}"
    if regrets:
        text += f"; the design that it finds is worse than the best by {_up_to(regrets[-1])}{_median(regrets)}"
    if broken:
        text += f"; {counted(broken, 'design')} broke a limit"
    return text + "."


def _median(shares: Sequence[float]) -> str:
    count = len(shares)
    return f" (median of {count} problems: {report._percent(shares[count // 2])})" if count > 2 else ""


def _up_to(share: float) -> str:
    return report._percent(share) if share < report.SMALLEST else f"up to {report._percent(share)}"


def main() -> None:
    """Measure, and keep the table alone."""
    started, before = time.perf_counter(), processor_seconds()
    with ProcessPoolExecutor(processors()) as pool:
        trades = [trade for trade in pool.map(of_problem, SOLVED) if trade is not None]
    seconds, total = time.perf_counter() - started, processor_seconds() - before
    rows = [json.loads(report.as_json(trade)) for trade in trades]
    made = f"Made in {seconds:.0f} s with {processors()} processes, which took {total:.0f} s of a processor together."
    picture = "![Error and regret of the usual fidelities over all ready problems](trade.png)"
    head, table = index(trades).as_markdown("").split("\n\n| ", 1)
    draw(rows)
    separate = "\n".join(separate_calls())
    publish(PAGES / "trade.md", f"{head}\n\n{picture}\n\n| {table.rstrip()}\n\n{made}\n\n{separate}")


def of_problem(name: str) -> Trade | None:
    """Return the trade of a ready problem; none where a flywheel is open, whose cheap model breaks its limits."""
    problem = laufruhe.load(PROBLEMS / f"{name}.toml")
    if FLYWHEEL in open_kinds(problem):
        return None
    measured_trade = trade(problem)
    # functions have no pickle
    return replace(measured_trade, problem=replace(measured_trade.problem, phasing=None, origin=None))


if __name__ == "__main__":
    main()
