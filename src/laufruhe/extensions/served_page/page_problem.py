"""Problem of a page: its follower, its drawing, and the simplifications while sliders move."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from laufruhe.errors import ModelError, plural
from laufruhe.extensions.served_page.claims import Simplification, join_phrases
from laufruhe.extensions.served_page.drawing import drawing_of
from laufruhe.extensions.served_page.follower import Follower, SliderOptimum, can_follow
from laufruhe.extensions.served_page.live import live_model
from laufruhe.extensions.served_page.pareto import partners
from laufruhe.files.measures import EDGES
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import depends, open_kinds
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Limit
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import decision_values, limit_values
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import LimitValue

ROUNDING = 1e-5
"""Share of the objective below which a price counts as zero."""
STILL: Mapping[Kind, str] = {
    Kind.PLACE: "these shaft positions",
    Kind.STIFFNESS: "these mounts",
    Kind.MOUNT: "these mounts",
    Kind.STAR: "this crank",
    Kind.SIZE: "these sizes",
    Kind.LEAD: "these phases of geared shafts",
}
"""Words for numbers that are fixed while sliders move."""
_MAX_PAGE_PROBLEMS = 6


class PageProblem:
    """Problem that a live page shows, with the drawing data and the fast optimiser (`follower`) of its sliders.

    Open numbers that loads are not affine in keep their initial values.
    """

    def __init__(self, problem: Problem, key: str) -> None:
        self.key, self.full_problem = key, problem
        self.problem = problem if can_follow(problem) else replace(
            problem, phasing=None, extras=(), decisions=problem.unbalances
        )  # fmt: skip
        self.initial = evaluate_start(self.problem)
        self.follower: Follower | None = None
        if can_follow(self.problem) and not self.initial.resonance:
            try:
                self.follower = Follower(self.problem)
            except ModelError:
                # mounts integrated in time have no affine loads
                self.follower = None

    def evaluated(self, followed: SliderOptimum | None) -> Evaluation:
        """Return the exact evaluation of the followed design, or of the initial one if there is none."""
        if followed is None or followed.conflict:
            return self.initial
        return evaluate(self.problem.fixed_at(followed.values))

    def standing(
        self, limits: Sequence[Limit], design: Evaluation, followed: SliderOptimum | None
    ) -> tuple[LimitValue, ...]:
        """Return value, state and shadow price of every limit for a design [SI]."""
        if design.resonance:
            return ()
        limit_values_of_design = limit_values(replace(self.problem, limits=tuple(limits)), design)
        if followed is None or followed.conflict:
            return limit_values_of_design
        priced, on_loads = [], {load_limit.measure for load_limit in self.problem.load_limits}
        for limit, stand, price in zip(limits, limit_values_of_design, followed.prices, strict=True):
            if limit.measure in on_loads:
                # prices below the rounding of the objective count as zero
                active = price * abs(limit.maximum) > ROUNDING * followed.value
                priced.append(replace(stand, active=active, shadow_price=price if active else 0.0))
            else:
                priced.append(replace(stand, shadow_price=math.nan) if stand.active else stand)
        return tuple(priced)

    def drawn(self, limits: tuple[Limit, ...], design: Evaluation, followed: SliderOptimum | None) -> dict[str, Any]:
        """Return the page's drawing data, or the reason for having no sliders."""
        problem = replace(self.problem, limits=limits)
        result = Result(problem=problem, status=Status.FEASIBLE, initial=self.initial, final=design)
        if followed is not None and not followed.conflict:
            pairs = zip(problem.decisions, followed.values, strict=True)
            entries = tuple(entry for decision, value in pairs for entry in decision_values(decision, value))
            result = replace(result, decisions=entries, limits=self.standing(limits, design, followed))
        model = live_model(self.full_problem, result, is_served=True)
        about = {"engine": drawing_of(self.problem), "partners": list(partners(self.problem))}
        return {**about, "unshown": model.why_not} if model.why_not else {**about, "model": model.as_json()}

    def simpler(self, fixed_kinds: Collection[Kind]) -> Simplification:
        """Return which open numbers are fixed, and which terms and limits are ignored, while sliders move.

        The page fixes numbers of `fixed_kinds`.
        """
        problem = self.full_problem
        kinds = {*fixed_kinds, *(decision.kind for decision in problem.decisions if not decision.is_affine)}
        if problem.phasing is not None:
            kinds.add(Kind.STAR)
        moving, load_limits = open_kinds(self.problem), self.problem.load_limits
        unread = [
            limit.name
            for limit in self.problem.limits
            if limit not in load_limits and depends(limit.measure.channel, moving, self.problem)
        ]
        left_out = [
            *(extra.words for extra in problem.extras),
            *(["later objectives"] if problem.ranks else []),
            *([f"the {plural('limit', len(unread))} on {join_phrases(unread)}"] if unread else []),
        ]
        phrases = dict.fromkeys(STILL.get(kind, f"the {kind.words}") for kind in sorted(kinds))
        return Simplification(tuple(phrases), tuple(left_out))


_page_problems: dict[str, PageProblem] = {}


def page_problem_of(problem: Problem, tables: Mapping[str, Any], content: str) -> PageProblem:
    """Return what a page shows of a problem, from a small cache.

    Problems that differ only in the values of limits share an entry. `content` is the hash of all files that the
    problem names.
    """
    limits = [{k: v for k, v in entry.items() if k not in EDGES} for entry in tables.get("constraints", [])]
    text = json.dumps([content, {**tables, "constraints": limits}], sort_keys=True, default=str)
    key = hashlib.sha256(text.encode()).hexdigest()[:16]
    if key not in _page_problems:
        while len(_page_problems) >= _MAX_PAGE_PROBLEMS:
            _page_problems.pop(next(iter(_page_problems)))
        _page_problems[key] = PageProblem(problem, key)
    return _page_problems[key]
