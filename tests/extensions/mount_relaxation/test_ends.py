"""Ends of sides of boxes, independent of earlier bounds."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from extensions.mount_relaxation.test_mode_boxes import NEAR, decoupled, designs_about
from extensions.mount_relaxation.test_spring_bound import DAMPED, LIMITS, MEANS, stiffness_problem
from laufruhe.extensions.mount_relaxation.cone_program import ROUGH, ConeProgram
from laufruhe.extensions.mount_relaxation.prover import _Narrowing
from laufruhe.extensions.mount_relaxation.search import SdpRelaxation
from laufruhe.problem.evaluation import evaluate, objective_value


@pytest.mark.slow
def test_aims_are_those_of_their_own_program_and_box() -> None:
    """Check that earlier statements and searches change no aim."""
    problem = decoupled(2)
    best, minimum = min(designs_about(problem, NEAR[:2], 6), key=lambda pair: pair[1])
    boxes, anew = (SdpRelaxation(problem, 1.02 * minimum, 1e-3, best.tolist()) for _ in range(2))
    middle = 0.5 * (boxes.lower + boxes.upper)
    boxes.bound(boxes.lower, middle)
    half, whole = (boxes.cut_off(boxes.lower, upper)[0] for upper in (middle, boxes.upper))
    aim = np.eye(whole.numbers + 5 * len(boxes.modes))[0]
    found = [ConeProgram(program, ROUGH).minimum(aim)[0] for program in (whole, half, whole)]
    alone = [
        ConeProgram(program, ROUGH).minimum(aim)[0] for program in (anew.cut_off(boxes.lower, boxes.upper)[0], half)
    ]
    assert found == [*alone, alone[0]]
    assert alone[0] != alone[1]


@pytest.mark.slow
def test_roots_of_a_box_are_not_taken_for_those_of_a_wider_one(tmp_path: Path) -> None:
    problem = stiffness_problem(tmp_path, MEANS, LIMITS, mounts=DAMPED)
    value, near = objective_value(problem, evaluate(problem)), [d.start for d in problem.decisions]
    boxes, anew = (SdpRelaxation(problem, value, 1e-3, near) for _ in range(2))
    at, aim = boxes.lower + 0.9 * (boxes.upper - boxes.lower), np.eye(len(boxes.lower))[0]
    boxes.bound(at, boxes.upper)
    found, alone = (ConeProgram(one.cut_off(one.lower, one.upper)[0], ROUGH).minimum(aim)[0] for one in (boxes, anew))
    assert found == alone


@pytest.mark.parametrize("known", [None, (0.5, np.zeros(2))])
def test_every_relaxation_of_a_box_counts_once(known: tuple[float, np.ndarray] | None) -> None:
    """Check that a relaxation solved before counts, and is solved once."""
    solved = []

    def bound(*ends: np.ndarray) -> tuple[float, np.ndarray]:
        solved.append(ends)
        return 0.5, np.zeros(2)

    search = SimpleNamespace(value=1.0, cutoff=0.9, bound=bound)
    narrowing = _Narrowing(search, 10, None, known)
    assert narrowing.narrow(np.zeros(2), np.ones(2))[0] == 0.5
    assert narrowing.spent == 1
    assert len(solved) == (known is None)
