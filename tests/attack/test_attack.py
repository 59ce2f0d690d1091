"""A share of the attack of `make attack`, on fixed seeds; and that false claims are found out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from attack.claims import Verdict, judge, solved
from attack.families import problem
from attack.plain_loads import number
from attack.plain_scene import Table
from attack.run_attack import attacked
from lanes import first_fast
from laufruhe.solvers.result import Result, Status

pytestmark = pytest.mark.slow

SEEDS = {
    "inline": (1, 4), "vee": (0, 3), "boxer": (0, 5), "opposed-piston": (1, 5), "radial": (3, 5), "parts": (2, 5),
    "points": (1, 3), "gas": (0, 4), "crankcase": (0, 1, 5), "stars": (2, 4), "open-vees": (1, 2, 9, 11, 130),
    "elastic-few": (1,), "convex-mounts": (0, 1), "elastic-balance": (4, 1, 2),
    "yokes": (3, 4), "chambers": (2, 5), "rotary": (4, 8),
    "uneven": (0, 2), "places": (0,), "leads": (22, 25), "bank angle": (2, 3), "sizes": (100009, 100013),
    "uneven crankcase": (1101, 101001), "worst means": (0, 2), "root mean quads": (9, 11),
    "single cylinders": (101, 103), "single gas": (102, 122), "single stars": (101, 104),
    "single opposed pistons": (101,), "single radial cylinders": (101,),
    "crank-rockers": (5, 4), "rhombic drives": (0, 2, 4), "speed ranges": (5, 0, 1), "electric machines": (4, 1),
    "receivers": (4,), "piston motion": (4, 1), "skip fire": (4, 1, 3),
    "prices of elastic-balance": (1,), "prices of convex-mounts": (1,),
    "monotony of inline": (2,), "invariance of convex-mounts": (1,), "invariance of inline": (2,),
}  # fmt: skip
"""Seeds of problems that take a second at most, with and without a design."""


MORE = {
    ("inline", 4), ("points", 3), ("stars", 4), ("open-vees", 9), ("open-vees", 11),
    ("elastic-balance", 1), ("elastic-balance", 2),
    ("uneven", 2), ("leads", 25), ("bank angle", 3), ("gas", 0), ("crankcase", 0), ("boxer", 0), ("rotary", 8),
    ("open-vees", 1), ("sizes", 100013), ("uneven crankcase", 1101), ("vee", 3), ("radial", 5), ("parts", 5),
    ("single cylinders", 103), ("single gas", 102), ("single stars", 104),
    ("yokes", 4), ("chambers", 5), ("worst means", 2), ("root mean quads", 11), ("convex-mounts", 1),
    ("elastic-few", 1), ("inline", 1), ("open-vees", 130), ("gas", 4), ("convex-mounts", 0),
    ("prices of elastic-balance", 1),
    ("crank-rockers", 4), ("rhombic drives", 2), ("rhombic drives", 4), ("speed ranges", 0), ("speed ranges", 1),
    ("electric machines", 1), ("receivers", 4), ("piston motion", 1), ("skip fire", 1), ("skip fire", 3),
}  # fmt: skip
"""Costly ones, of families that keep another, here or in the tests below."""
DRAWN = [(family, seed) for family, seeds in SEEDS.items() for seed in seeds]


@pytest.mark.parametrize(("family", "seed"), first_fast(DRAWN, 0, long=MORE))
def test_no_claim_falls(family: str, seed: int) -> None:
    verdict = attacked(family, seed, 2)
    assert verdict.wrong == [], f"{family} {seed}"
    assert verdict.status != "refused", f"{family} {seed}: {verdict.notes}"


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> tuple[Table, Result]:
    """Return a problem with an active limit, and its result."""
    table, _ = problem("gas", 4)
    return table, solved(table, tmp_path_factory.mktemp("attack"))


def complaints(table: Table, result: Any) -> str:
    verdict = Verdict("gas", 4)
    judge(verdict, table, result, np.random.default_rng(0), 3)
    return " ".join(verdict.wrong)


def test_true_claims_raise_no_complaint(example: tuple[Table, Result]) -> None:
    assert complaints(*example) == ""


@pytest.mark.parametrize(
    ("lie", "message"),
    [
        (lambda r: replace(r, objective=replace(r.objective, value=0.999 * r.objective.value)), "value"),
        (lambda r: replace(r, certificate=replace(r.certificate, lower_bound=1.001 * r.objective.value)), "bound"),
        (lambda r: replace(r, objective=None, status=Status.INFEASIBLE, final=r.initial), "keeps every limit"),
        (lambda r: replace(r, status=Status.FAILED), "failed"),
    ],
    ids=["value", "bound", "infeasible", "failed"],
)
def test_a_false_claim_is_detected(lie: Any, message: str, example: tuple[Table, Result]) -> None:
    table, result = example
    assert message in complaints(table, lie(result))


def test_a_suboptimal_design_is_detected(example: tuple[Table, Result], tmp_path: Path) -> None:
    """Check that the optimum within a tighter limit, claimed for the looser one, is reported."""
    table, result = example
    tighter = [{**limit, "max": f"{0.8 * number(limit['max'])} kg"} for limit in table["constraints"]]
    worse = solved({**table, "constraints": tighter}, tmp_path)
    assert worse.objective.value > 1.001 * result.objective.value
    assert "a rival has" in complaints(table, worse)
