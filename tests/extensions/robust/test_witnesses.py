"""Bounds of built engines and of assemblies that are broken on purpose, and must be detected."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import laufruhe
from claims.test_broken_bounders import Break, bound_times, scaled, value_times
from laufruhe.errors import BoundError
from laufruhe.extensions.robust import assembly_solver, worst_case
from laufruhe.extensions.robust.assembly import Assembly, assemble
from laufruhe.extensions.robust.result import AssemblyResult
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.prove import certificate
from laufruhe.prove.branch_and_bound import FathomedPart
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve, walk
from laufruhe.solvers.result import Status
from problem_files import FOUR, MOUNTS, PROBLEMS, changed, shaft, written
from ready import solved


@pytest.fixture(autouse=True)
def whole_walks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give every walk enough time for all steps."""
    monkeypatch.setattr(walk, "SECONDS", 20.0)


ROBUST = (
    changed(FOUR, "1.25 kg", "2 kg ± 2 %")
    + """[[operating_points]]
speed = "2500 rpm"
[objective]
minimise = "rms mount force"
[fidelity]
samples = 48
[robust]
engines = 200
"""
    + MOUNTS
    + shaft("left", 2, "60 mm", 'unbalance = { between = ["0 kg m", "0.05 kg m"] }\nradius = "20 mm"\nangle = 180')
)


@pytest.mark.parametrize(
    "broken",
    [scaled(worst_case, "bound_node", bound_times(0.99)), scaled(certificate, "lower_bound", value_times(1.001))],
    ids=["the worst engine", "dual rows"],
)
def test_a_broken_bounder_of_built_engines(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, broken: Break) -> None:
    problem = written(tmp_path, ROBUST)
    broken(monkeypatch)
    with pytest.raises(BoundError):
        laufruhe.solve(problem)


@pytest.mark.slow
def test_a_broken_bounder_of_assemblies(monkeypatch: pytest.MonkeyPatch) -> None:
    scaled(assembly_solver._Search, "bound", lambda found: 1.001 * found)(monkeypatch)
    with pytest.raises(BoundError, match="contradicts a known design"):
        laufruhe.solve(PROBLEMS / "selective-assembly.toml")


@pytest.mark.slow
def test_parts_are_left_out_in_one_place_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that a search that discards all parts still bounds the value, with a gap."""
    monkeypatch.setattr(assembly_solver._Search, "cutoff", property(lambda _: -math.inf))
    result = laufruhe.solve(PROBLEMS / "selective-assembly.toml")
    assert result.certificate is not None
    assert result.certificate.kind is Proof.WITHIN_GAP
    assert result.objective is not None
    assert result.certificate.lower_bound < result.objective.value


@pytest.fixture
def pruned_assemblies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drop the assemblies that may hold a better one, and keep the others."""
    right = assembly_solver._Search.branch

    def turned(self: Any, taken: Any) -> Iterator[Any]:
        for part in right(self, taken):
            yield FathomedPart(self.cutoff) if isinstance(part, tuple) and part[0] < self.cutoff else part

    monkeypatch.setattr(assembly_solver._Search, "branch", turned)


@pytest.mark.slow
def test_a_wrongly_pruned_assembly_is_detected(request: pytest.FixtureRequest) -> None:
    # other tests share this result, so it is found before the search is broken
    best = solved("selective-assembly")
    request.getfixturevalue("pruned_assemblies")
    result = solve(laufruhe.load(PROBLEMS / "selective-assembly.toml"))
    assert best.objective is not None
    assert result.certificate is not None
    assert (result.status, result.certificate.kind, result.certificate.lower_bound) == (
        Status.FEASIBLE,
        Proof.NONE,
        0.0,
    )
    assert "report" in result.message
    assert isinstance(result.details, AssemblyResult)
    # the places told are those of the design
    chosen = tuple(zip(*([p - 1 for p in place.parts] for place in result.details.places), strict=True))
    own = result.problem.extra(Assembly)
    assert own is not None
    engine = assemble(result.problem.engine, own.lots, chosen)
    value = objective_value(result.problem, evaluate(result.problem, engine))
    assert result.objective is not None
    assert result.objective.value >= best.objective.value * (1.0 - 1e-4)
    assert value == pytest.approx(result.objective.value, rel=1e-12)
