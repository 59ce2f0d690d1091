"""Problems whose live pages tests look at, and designs of them at random."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from pathlib import Path

import numpy as np

from laufruhe.extensions.served_page.live import LiveModel, live_model
from laufruhe.extensions.served_page.live.section import sliders
from laufruhe.files.reader import load
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid, lengths
from laufruhe.numerics.norms.mean import Mean
from laufruhe.numerics.norms.norm import norm_instance
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.problem import Problem
from laufruhe.report.result_report import result_document
from laufruhe.report.web_page import as_html
from laufruhe.solvers import evaluate_only
from problem_files import FOUR, MOUNTS, PROBLEMS, open_unbalance, shaft

NORMS = ("mean", "maximum", "rms", "peak to peak", "worst mean")
# every norm of loads with gas, whose pressure bends, at two points with weights of their own
EVERY_NORM = (
    FOUR.replace("[engine]", '[engine]\nbore = "100 mm"')
    + "throws = [0, 180, 180, 0]\n"
    + MOUNTS
    + """
[gas]
model = "seiliger"
peak_pressure = "80 bar"
imep = "6 bar"
[[operating_points]]
name = "slow"
speed = "1200 rpm"
weight = 2
[[operating_points]]
name = "fast"
speed = "2500 rpm"
[[counterweights]]
name = "web"
opposite_throw = 1
radius = "80 mm"
mass = { between = ["0 kg", "2 kg"] }
"""
    + shaft("left", 2, "100 mm", open_unbalance())
    + '[objective]\nminimise = "mean mount force"\n'
    + "".join(
        f'[[constraints]]\nlimit = "{norm} {load}"\nmax = "{maximum}"\n'
        for norm in NORMS
        for load, maximum in (("mount force", "3 kN"), ("rocking couple", "400 N m"))
    )
    + '[[constraints]]\nlimit = "maximum mount force"\nname = "second order"\norders = [2]\n'
    + 'mounts = ["mount 2"]\noperating_points = ["fast"]\nmax = "3 kN"\n'
    + '[[constraints]]\nlimit = "counterweight mass"\nmax = "1 kg"\n'
)


class WorstTwentieth(Mean):
    """Mean of the longest twentieth of the rows: a norm that no script of a page knows."""

    name = "worst twentieth"

    def value(self, grid: Grid, rows: Array) -> float:
        """Return the mean of the longest rows."""
        longest = np.sort(lengths(rows))[::-1]
        return float(longest[: max(len(longest) // 20, 1)].mean())


def with_unknown_norm(problem: Problem) -> Problem:
    """Return the problem with its objective and its first limit of a load in that norm."""
    norm = norm_instance(WorstTwentieth)
    (term,) = problem.objective
    first, *others = problem.limits
    limit = replace(first, name=f"{norm.name} mount force", measure=replace(first.measure, norm=norm))
    return problem.changed(
        objective=(replace(term, measure=replace(term.measure, norm=norm)),), limits=(limit, *others)
    )


def problem_of(name: str) -> Problem:
    """Return the problem of every norm, or a ready problem."""
    return load(EVERY_NORM if name == "every norm" else PROBLEMS / f"{name}.toml")


def model_of(problem: Problem) -> LiveModel:
    """Return the model of a page for the initial design."""
    return live_model(problem, evaluate_only(problem))


def page_of(problem: Problem, folder: Path) -> Path:
    """Return a report with the live page, without pictures."""
    result = evaluate_only(problem)
    path = folder / "report.html"
    path.write_text(as_html(result_document(result, [], "laufruhe"), {}, sliders(result)), encoding="utf-8")
    return path


def designs(model: LiveModel, count: int, seed: int = 7) -> list[dict[str, float]]:
    """Return the values of all sliders at random between their bounds [SI]."""
    draw = random.Random(seed)
    found = []
    for _ in range(count):
        values = {}
        for slider in model.sliders:
            values[slider.name] = draw.uniform(slider.lower, slider.upper)
            if slider.width > 1:
                values[slider.angle] = draw.uniform(*slider.angles)
        found.append(values)
    return found


def evaluated(problem: Problem, model: LiveModel, values: dict[str, float]) -> Evaluation:
    """Return the evaluation of a design by the exact model."""
    moved = {slider.name: slider for slider in model.sliders}
    numbers = []
    for decision in problem.decisions:
        angle = values[moved[decision.name].angle] if decision.name in moved and decision.set.width > 1 else None
        unit = complex(math.cos(angle), math.sin(angle)) if angle is not None else decision.set.directions[0]
        numbers.append(values[decision.name] * unit if decision.name in moved else decision.start)
    return evaluate(problem, problem.design(numbers))
