"""Ends of sides that others work out ahead: to the last bit those of one process."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from laufruhe.numerics.workers import HERE, working_on
from laufruhe.prove.springs.ends import ends_ahead
from laufruhe.prove.springs.proof import narrowed, spring_bound
from laufruhe.prove.springs.search import SpringBoxes
from prove.test_mode_boxes import NEAR, decoupled, designs_about


@pytest.mark.slow
def test_whoever_works_them_out() -> None:
    problem = decoupled(3)
    best, least = min(designs_about(problem, NEAR[:3], 30), key=lambda pair: pair[1])
    found = []
    with ThreadPoolExecutor(3) as pool:
        for executor in (HERE, pool):
            with working_on(executor), ends_ahead() as ahead:
                boxes = SpringBoxes(problem, 1.02 * least, 1e-3, best.tolist(), ahead)
                box, solved = narrowed(boxes, boxes.lower, boxes.upper, np.ones(len(boxes.lower)))
                assert box is not None
                found.append((box, solved, spring_bound(problem, least, 1e-2 * least, best.tolist()).bound))
                # those that are asked for are foreseen, though some are not asked for any more
                assert (ahead.foreseen > solved // 2) == (executor is pool)
    (box, solved, bound), (other, counted, proven) = found
    assert np.array_equal(box, other)
    assert (solved, bound) == (counted, proven)
