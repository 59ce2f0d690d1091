"""Exchanges of throws, compared with the stars that cuts prove (S44)."""

from __future__ import annotations

import pytest

from laufruhe.extensions.long_cranks.long_crank_search import exchanges, improved
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from laufruhe.solvers.stars import even_search
from laufruhe.solvers.stars.star_program import coarse_value
from phasing import engines
from phasing.test_designs import CASES, TWO_SHAFTS, model_of


@pytest.mark.parametrize("cylinders", [4, 5])
def test_exchanges_reach_what_cuts_prove(tmp_path, monkeypatch, cylinders):
    """Check that exchanges find the proven optimum, and that their bound is not above it."""
    rest = engines.MOUNTS + engines.WEIGHTS + TWO_SHAFTS + engines.MOUNT_FORCE.replace("mean", "rms")
    problem = engines.problem(tmp_path, cylinders, phasing="best = 1\nmost_shafts = 1", rest=rest)
    proven = solve(problem)
    assert proven.certificate.kind is Proof.GLOBAL
    monkeypatch.setattr(even_search, "MAX_LISTED", 0)
    result = solve(problem)
    assert "exchanges of throws" in result.certificate.method
    assert sum(d.value for d in result.decisions if d.name.endswith("built")) <= 1
    assert result.objective.value == pytest.approx(proven.objective.value, rel=1e-3)
    assert 0.0 < result.certificate.lower_bound <= proven.objective.value * (1.0 + 1e-9)


@pytest.mark.parametrize("name", ["mean", "limited", "shafts"])
def test_exchanges_lead_to_stars_that_no_exchange_betters(tmp_path, name):
    choice = "most_shafts = 1" if name == "shafts" else ""
    problem = engines.problem(tmp_path, 5, phasing=choice, rest=CASES[name])
    model, stars = model_of(problem)
    values = {tuple(map(int, star)): coarse_value(model, tuple(map(int, star)), ()) for star in stars}
    worst = max(values, key=values.__getitem__)
    result = improved(model, worst, ())
    value = coarse_value(model, result, ())
    # five throws: every star that has throw 1 where it is stands a few exchanges away
    assert value == pytest.approx(min(values.values()), rel=1e-5)
    assert value < values[worst]
    assert len(set(exchanges(worst))) == len(list(exchanges(worst))) == 6 + 8
