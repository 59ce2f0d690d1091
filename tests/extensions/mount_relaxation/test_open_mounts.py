"""Sets of all mounts of a box, and limits at rest, compared with random designs."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from laufruhe.extensions.joint_mounts.rest_limits import RestLimits
from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts, is_lifted, open_mounts
from laufruhe.extensions.mount_relaxation.symmetry_split import split_mounts
from laufruhe.extensions.mount_relaxation.unbalance_basis import unbalance_basis
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import Decision, Domain
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Interval, Sector
from mounts.files import BLOCK, ENGINE, MOUNTS, changed, problem_of

RMS = '[objective]\nminimise = "rms mount force"\n'
PLACE = ('["300 mm", "200 mm", "0 mm"]', '[{ between = ["250 mm", "350 mm"] }, "200 mm", "0 mm"]')
LIMITS = """
[[constraints]]
limit = "natural frequencies"
min = "4 Hz"
max = "16 Hz"
[[constraints]]
limit = "total stiffness"
min = "1100 N/mm"
max = "2500 N/mm"
"""


def designs(problem: Problem, count: int, seed: int = 0) -> list[np.ndarray]:
    """Return random mount numbers of the whole box and its two ends."""
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    return [*np.random.default_rng(seed).uniform(low, high, (count, len(low))), low, high]


def known(problem: Problem) -> OpenMounts:
    return open_mounts(problem, *designs(problem, 0))


def minimum(matrix: np.ndarray) -> float:
    return float(np.linalg.eigvalsh(matrix)[0])


@pytest.mark.parametrize("places", [(), (PLACE,)])
def test_no_stiffness_of_a_box_is_outside_of_what_is_known(tmp_path: Path, places: tuple) -> None:
    problem = problem_of(tmp_path, ENGINE, BLOCK, changed(MOUNTS, *places), RMS)
    mounts = known(problem)
    for x in designs(problem, 40):
        mounting = mounting_in(problem.design(x.tolist(), problem.mount_decisions))
        scaled_stiffness = mounts.root @ mounting.stiffness @ mounts.root.T
        size = float(np.linalg.norm(scaled_stiffness))
        assert minimum(mounts.maximum - scaled_stiffness) >= -1e-9 * size
        assert minimum(scaled_stiffness - mounts.minimum) >= -1e-9 * size


def test_mounts_that_mirror_each_other_move_in_two_halves(tmp_path: Path) -> None:
    """Check that the halves (fore and aft, up, pitch; aside, roll, yaw) have the principal values of the whole."""
    whole = known(problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, RMS))
    parts = split_mounts(whole)
    assert [part.size for part in parts] == [3, 3]
    for side in ("minimum", "maximum"):
        values = np.concatenate([np.linalg.eigvalsh(getattr(part, side)) for part in parts])
        assert np.sort(values) == pytest.approx(np.linalg.eigvalsh(getattr(whole, side)), rel=1e-9)


def test_limits_on_frequencies_are_those_of_the_stiffness(tmp_path: Path) -> None:
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, RMS, LIMITS)
    mounts, seen = known(problem), set()
    (floor,), (ceiling,) = mounts.floors, mounts.ceilings
    for x in designs(problem, 200):
        mounting = mounting_in(problem.design(x.tolist(), problem.mount_decisions))
        scaled_stiffness, hertz = mounts.root @ mounting.stiffness @ mounts.root.T, mounting.modes.frequencies
        if abs(hertz[0] / 4.0 - 1.0) > 1e-3:
            assert (minimum(scaled_stiffness - floor) > 0.0) == (hertz[0] > 4.0)
        if abs(hertz[-1] / 16.0 - 1.0) > 1e-3:
            assert (minimum(ceiling - scaled_stiffness) > 0.0) == (hertz[-1] < 16.0)
        seen.add((bool(hertz[0] > 4.0), bool(hertz[-1] < 16.0)))
    assert len(seen) >= 2


def test_a_forbidden_band_of_total_stiffness_is_a_share_of_its_limit(tmp_path: Path) -> None:
    """Compare violations of a forbidden band of total stiffness with traces, in boxes of no width."""
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, RMS, LIMITS.replace("natural frequencies", "static sag")
                         .replace('min = "4 Hz"\n', "").replace("16 Hz", "1 m"))  # fmt: skip
    rest, seen = RestLimits(problem), set()
    for x in designs(problem, 20):
        mounting = mounting_in(problem.design(x.tolist(), problem.mount_decisions))
        total = sum(float(np.trace(k)) for k in mounting.springs)
        violations = [float(each.min()) for each in rest.over(x, x)]
        by = [total / 2.5e6 - 1.0, 1.0 - total / 1.1e6]
        assert min(abs(own - by[0]) for own in violations) < 1e-5
        assert min(abs(own - by[1]) for own in violations) < 1e-5
        seen.add(max(by) > 0.0)
    assert seen == {True, False}


@pytest.mark.parametrize("seed", range(3))
def test_columns_of_unbalances_reach_from_minus_one_to_one(seed: int) -> None:
    """Check that intervals, a disc and a sector hold all allowed values."""
    random = np.random.default_rng(seed)
    sets = [Interval(0.3, 0.5), Interval(-0.2, 0.1), Sector(0.4, (0.0, math.tau)), Sector(0.4, (0.2, 1.4))]
    domains, start = [], 0
    for k, own in enumerate(sets):
        domains.append(Domain(Decision(f"d{k}", "kg m", own, 0j, ()), start))
        start += domains[-1].width
    columns = unbalance_basis(domains, [0j for _ in sets])
    farthest = np.zeros(start)
    for _ in range(400):
        drawn = random.uniform(-1.0, 1.0, start)
        x = np.concatenate([domain.project(drawn) for domain in domains])
        u = np.linalg.solve(columns.domain_map, x - columns.middles)
        farthest = np.maximum(farthest, np.abs(u))
        lifted = np.concatenate([[1.0], u])
        assert all(lifted @ matrix @ lifted <= 1e-12 for matrix in columns.sets)
    assert np.all(farthest <= 1.0 + 1e-12)
    # the designs reach less of the sector
    assert np.all(farthest[:4] > 0.95)


def test_springs_that_may_have_no_stiffness_are_lifted(tmp_path: Path) -> None:
    bottomless = MOUNTS.replace('"20 N/mm", "4000 N/mm"', '"0 N/mm", "4000 N/mm"')
    assert is_lifted(problem_of(tmp_path, ENGINE, BLOCK, bottomless, RMS))
