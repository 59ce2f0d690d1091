"""Whether stiffnesses keep limits together: boxes prove that none does, or meet a design that does (E67)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import at_many
from laufruhe.problem.measure import Limit
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.exclusion import Exclusion, excluded
from laufruhe.solvers.conclusion import Design
from laufruhe.solvers.conflicts import smallest_conflict
from laufruhe.solvers.mounts.places import judged_at


class LimitsKept:
    """Of a problem whose open numbers are stiffnesses alone; every design that is looked at is remembered."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem = at_many(problem)
        decisions = problem.mount_decisions
        sides = ([getattr(d, side) for d in decisions] for side in ("start_number", "lower", "upper"))
        designs = [judged_at(problem, values) for values in sides]
        self._looked: list[Design] = [design for design in designs if design is not None]

    def together(self, limits: Sequence[Limit], share: float = 1.0) -> Exclusion:
        """Whether boxes exclude them, of so large a share as is worth it; what one design keeps no box excludes."""
        for design in self._looked:
            if design.evaluation.excess(limits) <= 0.0:
                return Exclusion(False, np.array(design.values, dtype=float), 0)
        return excluded(replace(self._problem, limits=tuple(limits)), lambda x: self._keeps(x, limits), share)

    def conflict(self) -> tuple[str, ...]:
        """Of limits that boxes exclude together a smallest set, each needed for that."""
        return smallest_conflict(self._problem.limits, lambda kept: bool(kept) and self.together(kept).is_proven)

    def _keeps(self, x: Array, limits: Sequence[Limit]) -> bool:
        design = judged_at(self._problem, x.tolist())
        self._looked.extend([] if design is None else [design])
        return design is not None and design.evaluation.excess(limits) <= 0.0


def ruled_out(problem: Problem) -> tuple[str, ...]:
    """Limits that no box keeps together, each needed for that."""
    return LimitsKept(problem).conflict()
