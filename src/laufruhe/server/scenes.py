"""A problem as a page has it: what follows sliders at once, what stands still meanwhile, and what is drawn."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from laufruhe.errors import ModelError
from laufruhe.files.asked import EDGES
from laufruhe.live import live_model
from laufruhe.problem.dependence import depends
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Limit
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.problem.tolerance import NO_TOLERANCES
from laufruhe.prove.certificate import Certificate, Proof
from laufruhe.server.drawing import drawing_of
from laufruhe.server.front import partners
from laufruhe.solvers import kinds_of
from laufruhe.solvers.conclusion import decision_values, limit_values
from laufruhe.solvers.following import Followed, Follower, can_follow
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import LimitValue, ObjectiveValue

_KEPT = 6


class Scene:
    """A problem but for its limits: what is drawn of it, and what follows a limit that slides.

    Where something is open that loads are not affine in, it stays as given.
    """

    def __init__(self, problem: Problem, key: str) -> None:
        self.key, self.whole = key, problem
        self.problem = problem if can_follow(problem) else replace(
            problem, phasing=None, over=None, assembly=None, tolerances=NO_TOLERANCES, decisions=problem.unbalances
        )  # fmt: skip
        self.given = evaluate_start(self.problem)
        self.follower: Follower | None = None
        if can_follow(self.problem) and not self.given.resonance:
            try:
                self.follower = Follower(self.problem)
            except ModelError:
                # an engine on mounts in time has no loads that are affine in anything
                self.follower = None

    @property
    def value(self) -> float | None:
        """Objective of the design as given; None where there is none."""
        return objective_value(self.problem, self.given) if self.problem.objective else None

    def drawn(self, found: Followed | None) -> dict[str, Any]:
        """What the page draws from, with the optimum where it is known; why there is nothing to slide else."""
        model = live_model(self.whole, self._result(found), is_served=True)
        about = {"engine": drawing_of(self.problem), "partners": list(partners(self.problem))}
        return {**about, "unshown": model.why_not} if model.why_not else {**about, "model": model.as_json()}

    def _result(self, found: Followed | None) -> Result:
        """The design that follows, as far as a model of the page asks; nothing of it is proven but the bound."""
        problem, known = self.problem, found is not None and not found.conflict
        bare = Result(problem=problem, status=Status.FEASIBLE, initial=self.given, final=self.given)
        if found is None or not known:
            return bare
        entries = [e for d, v in zip(problem.decisions, found.values, strict=True) for e in decision_values(d, v)]
        unread = [limit for limit in problem.limits if not self._reads(limit)]
        limits: tuple[LimitValue, ...] = ()
        if unread:
            design = evaluate(problem.held(found.values))
            limits = limit_values(problem.changed(limits=tuple(unread)), design)
        return replace(
            bare,
            objective=ObjectiveValue.of(problem, found.value, self.value or 0.0),
            certificate=Certificate(Proof.WITHIN_GAP, found.bound, found.gap, 0.0, "second-order cones at few angles"),
            decisions=tuple(entries),
            limits=limits,
        )

    def _reads(self, limit: Limit) -> bool:
        """Whether a limit stands still, or is one that follows."""
        return limit in self.problem.load_limits or not depends(
            limit.measure.channel, kinds_of(self.problem), self.problem
        )

    def simplified(self, is_held: bool) -> Iterator[str]:
        """What of the whole problem is left out while sliders move: a bound holds for the rest alone."""
        whole = self.whole
        if is_held:
            yield "what loads are not affine in held as it was decided"
        elif whole.phasing is not None or any(not decision.is_affine for decision in whole.decisions):
            yield "what loads are not affine in held as given"
        if whole.over is not None:
            yield "no tolerances"
        if whole.assembly is not None:
            yield "no parts assigned"
        if whole.ranks:
            yield "the first objective alone"
        if not all(map(self._reads, self.problem.limits)):
            yield "limits on numbers left out"


_scenes: dict[str, Scene] = {}


def scene_of(problem: Problem, tables: Mapping[str, Any]) -> Scene:
    """The scene of a problem, kept for the next request."""
    key = key_of(tables)
    if key not in _scenes:
        while len(_scenes) >= _KEPT:
            _scenes.pop(next(iter(_scenes)))
        _scenes[key] = Scene(problem, key)
    return _scenes[key]


def key_of(tables: Mapping[str, Any]) -> str:
    """Of all but where limits stand."""
    limits = [{k: v for k, v in entry.items() if k not in EDGES} for entry in tables.get("constraints", [])]
    text = json.dumps({**tables, "constraints": limits}, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
