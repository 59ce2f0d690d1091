"""A seeded share of all combinations of decision, measure and layout; `make matrix` judges every one."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from lanes import first_fast
from matrix.cells import Cell, cells
from matrix.claims import evaluate_design

SHARE, FAST, USUAL = 50, 10, 25
NEWER, FEW = ("crank-rocker", "rhombic", "speed range", "displacer mass"), 12
# seconds, of a decision and a layout that other cells have
LONG = ("bank angle | peak to peak stored work | split vee | 0",)


def _chosen(newer: bool, count: int) -> list[Cell]:
    every = [cell for cell in cells() if newer is bool({cell.layout, cell.decision} & {*NEWER})]
    random.Random(2).shuffle(every)
    return every[:count]


CELLS = _chosen(False, SHARE)


@pytest.mark.parametrize("cell", first_fast(CELLS, FAST, USUAL, [cell for cell in CELLS if str(cell) in LONG]), ids=str)
def test_it_is_refused_in_one_line_or_every_claim_holds(cell: Cell, tmp_path: Path) -> None:
    assert not evaluate_design(cell, tmp_path).broken


@pytest.mark.parametrize("cell", first_fast(_chosen(True, FEW), 0, 3), ids=str)
def test_drives_and_ranges_are_refused_or_hold(cell: Cell, tmp_path: Path) -> None:
    assert not evaluate_design(cell, tmp_path).broken
