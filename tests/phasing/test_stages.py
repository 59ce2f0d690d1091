"""Steps over the period for bounds of boxes of throws, and the error of a peak between steps."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from laufruhe.errors import ModelError
from laufruhe.problem.evaluation import evaluate
from laufruhe.solvers.throws.throw_search import Stage, peak_error
from phasing import engines


def stage(make=lambda samples: samples, maximum=768, enough=0.03, left_out=lambda _: 4.0) -> Stage:
    """Return one of 96 steps that lose a tenth of a value of 1000, twice as many half of that."""
    return Stage(make, 96, lambda samples: 9600.0 / samples, 1000.0, left_out, maximum, enough)


def test_steps_double_until_they_cost_little_enough():
    first = stage()
    assert first.cost == pytest.approx(0.104)
    assert first.programs == 96
    assert first.next.programs == 192
    assert first.next.cost == pytest.approx(0.054)
    assert first.last.programs == 384
    assert first.last.cost == pytest.approx(0.029)
    assert stage(maximum=200).last.programs == 192
    assert stage(enough=0.2).next is None
    # the omitted part grows faster than further steps reduce the loss
    assert stage(left_out=lambda samples: 2.0 * samples).next is None


def test_a_stage_too_large_to_hold_is_none():
    def make(samples):
        if samples > 192:
            raise ModelError("too many numbers")
        return samples

    assert stage(make).finer.programs == 192
    assert stage(make).finer.finer is None


def test_narrow_boxes_near_the_value_need_more_steps():
    wide, narrow = (SimpleNamespace(spread=np.array([width, 0.0])) for width in (0.2, 0.05))
    assert stage().is_exhausted(900.0, 1000.0, wide)
    assert not stage().is_exhausted(800.0, 1000.0, wide)
    assert stage().is_exhausted(800.0, 1000.0, narrow)


def test_a_peak_misses_no_more_than_its_error_estimate(tmp_path):
    """Check that fine samples exceed coarse ones by no more than the error estimate, which falls with the step."""
    rest = engines.MOUNTS + engines.MOUNT_FORCE.replace("mean", "maximum")
    problem = engines.problem(tmp_path, 3, "two-stroke", "throws = [0, 100, 230]", "", rest, samples=96)
    design, measure = evaluate(problem), problem.objective[0].measure
    best = SimpleNamespace(final=design, problem=problem)
    (signal,) = design.signals(measure.load)
    reports = []
    for samples in (48, 96, 192):
        sizes = np.linalg.norm(signal.sample(12 * samples), axis=-1).max(axis=1)
        worst = max(sizes.max() - sizes[shift::12].max() for shift in (0, 6))
        reports.append(peak_error(measure, best, samples))
        assert worst <= reports[-1]
    assert reports[0] < 0.05 * sizes.max()
    assert reports[2] < 0.4 * reports[1] < 0.16 * reports[0]
