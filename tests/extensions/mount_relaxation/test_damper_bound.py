"""Bounds of dampers of mounts that turn and move, compared with designs of boxes (E66)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from extensions.mount_relaxation.test_spring_bound import MOVED, in_planes
from lanes import first_fast
from laufruhe.extensions.mount_relaxation.open_mounts import open_mounts
from laufruhe.extensions.mount_relaxation.search import SdpRelaxation
from laufruhe.problem.decision import DAMPING
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from mounts.files import BLOCK, ENGINE, OPEN, changed, problem_of

UNLIKE = ("position  = [", 'damping = ["9000 N s/m", "500 N s/m", "2500 N s/m"]\nposition  = [')
ALONE = changed(MOVED, UNLIKE, ('name = "rear left"\n', 'name = "rear left"\n' + UNLIKE[1].splitlines()[0] + "\n"))
GIVEN = changed(ALONE, (OPEN, '"300 N/mm"'))
KINDS = {
    # dampers of their own, and dampers that follow what turning does to stiffness
    "own": ALONE,
    "following": GIVEN,
    "alike in stiffness": changed(GIVEN, ('"120 N/mm", "300 N/mm"]', '"300 N/mm", "300 N/mm"]')),
}


def damped_problem(folder: Path, mounts: str, norm: str = "rms") -> Problem:
    objective = f'[objective]\nminimise = "{norm} mount force"\norders = [2, 4]\n[fidelity]\nsamples = 144\n'
    return problem_of(folder, ENGINE, BLOCK, mounts, objective)


@pytest.mark.parametrize(
    ("kind", "springs", "dampers", "follow"),
    [("own", 4, 2, 0), ("following", 4, 0, 2), ("alike in stiffness", 2, 2, 0)],
)
def test_dampers_have_products_of_their_own_where_they_do_not_follow_stiffness(
    kind: str, springs: int, dampers: int, follow: int, tmp_path: Path
) -> None:
    problem = damped_problem(tmp_path, KINDS[kind])
    lower, upper = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    mounts = open_mounts(problem, lower, upper)
    assert sum(spring.elastic == 1.0 for spring in mounts.springs) == springs
    assert sum(spring.elastic == 0.0 for spring in mounts.springs) == dampers
    assert sum(spring.elastic * spring.viscous != 0.0 for spring in mounts.springs) == follow
    assert all(place.is_damped for place in mounts.places)
    assert np.any(problem.mount_numbers[0][DAMPING])


CASES = [*((kind, "rms") for kind in KINDS), ("following", "maximum")]


@pytest.mark.parametrize(("kind", "norm"), first_fast(CASES, 3))
def test_no_design_is_under_the_bound_of_a_box(kind: str, norm: str, tmp_path: Path) -> None:
    problem, generator = damped_problem(tmp_path, KINDS[kind], norm), np.random.default_rng(5)
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    for share, tight in ((1.0, 0.0), (0.05, 0.9)):
        below = low + generator.random(len(low)) * (1.0 - share) * (high - low)
        given = [below + part * share * (high - low) for part in generator.random((40, len(low)))]
        worth = [objective_value(problem, evaluate(problem, problem.design(x.tolist()))) for x in given]
        minimum, best = min(worth), given[int(np.argmin(worth))]
        boxes = SdpRelaxation(problem, 1.5 * minimum, 1e-3, best.tolist())
        planes = np.array([in_planes(boxes, x) for x in given])
        ends = np.append(below, planes.min(axis=0)), np.append(below + share * (high - low), planes.max(axis=0))
        assert tight * minimum <= boxes.bound(*ends)[0] <= minimum * (1.0 + 1e-9)
