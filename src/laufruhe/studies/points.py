"""The points of one part of a study: every case at every combination of swept values."""

from __future__ import annotations

import itertools
from dataclasses import asdict, dataclass
from pathlib import Path

from laufruhe.errors import Complaint, InputError
from laufruhe.machine.similarity import equal_power_scale
from laufruhe.physics.metrics import cycle_measures
from laufruhe.problem.evaluation import PEAK_REFINEMENT, Evaluation, over
from laufruhe.problem.model import Problem
from laufruhe.problem.study_models import CaseTable, PartTable, Value
from laufruhe.problem.study_reader import scene
from laufruhe.solvers import solve


@dataclass(frozen=True)
class Point:
    """One scene of a study, not yet solved."""

    part: str
    case: CaseTable
    changes: dict[str, Value]


@dataclass(frozen=True)
class PointResult:
    """What a study keeps of one scene.

    Attributes
    ----------
    status
        As of a result.
    objective_given, objective, lower_bound
        Of the design as given and as decided, and what no design falls below [SI].
    mounts
        Names.
    mean_given, maximum_given, mean, maximum
        Per mount [N].
    decisions
        Values decided [SI], by name.
    """

    case: str
    changes: dict[str, Value]
    status: str
    objective_given: float
    objective: float
    lower_bound: float
    mounts: list[str]
    mean_given: list[float]
    maximum_given: list[float]
    mean: list[float]
    maximum: list[float]
    decisions: dict[str, float]

    def as_dict(self) -> dict[str, object]:
        """For a checkpoint."""
        return asdict(self)


def points_of(part: PartTable) -> list[Point]:
    """Every case at every combination of swept values, the last sweep fastest."""
    grids = [[(sweep.quantity, value) for value in sweep.values] for sweep in part.sweep]
    return [Point(part.name, case, dict(grid)) for case in part.cases for grid in itertools.product(*grids)]


def answer(point: Point, folder: Path) -> PointResult:
    """Solve one point; forces stand at the power that its case asks for (eq. 23)."""
    problem = scene(point.case, point.changes, folder)
    if len(problem.points) != 1 or not problem.objective or not problem.engine.mounts:
        rule = "needs mounts, an objective and one operating point in a study"
        raise InputError(str(folder / point.case.problem), (Complaint("problem", "", rule, "give these"),))
    factor = _force_factor(problem, point.case)
    result = solve(problem)
    given = result.initial
    value = result.objective.value if result.objective else float("nan")
    start = result.objective.initial if result.objective else float("nan")
    bound = result.certificate.lower_bound if result.certificate else value
    before, after = _measures(given), _measures(result.final)
    return PointResult(
        case=point.case.name,
        changes=point.changes,
        status=str(result.status),
        objective_given=factor * start,
        objective=factor * value,
        lower_bound=factor * bound,
        mounts=given.mount_names,
        mean_given=[factor * mean for mean, _ in before],
        maximum_given=[factor * most for _, most in before],
        mean=[factor * mean for mean, _ in after],
        maximum=[factor * most for _, most in after],
        decisions={decision.name: decision.value for decision in result.decisions},
    )


def _measures(evaluation: Evaluation) -> list[tuple[float, float]]:
    """Mean and maximum of every mount [N]; a maximum is sought between the samples too."""
    forces = evaluation.loads[0].mount_forces
    if forces is None:
        return []
    spectrum = over(evaluation.engine.cycle.base_order, [forces])[0]
    coarse, fine = spectrum.sample(evaluation.samples), spectrum.sample(PEAK_REFINEMENT * evaluation.samples)
    return [
        (cycle_measures(coarse[:, m]).mean, cycle_measures(fine[:, m]).max) for m in range(coarse.shape[1])
    ]  # fmt: skip


def _force_factor(problem: Problem, case: CaseTable) -> float:
    if case.equal_power_to is None:
        return 1.0
    cylinders = problem.engine.slider_cranks
    if len({(c.crank_radius, c.bore) for c in cylinders}) > 1:
        rule = "compares at equal power cylinders of different bore or stroke"
        raise InputError(case.problem, (Complaint("equal_power_to", case.name, rule, "give all cylinders one size"),))
    return equal_power_scale(len(cylinders), case.equal_power_to).force
