"""Places of measured parts, compared with all assemblies one by one."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.robust.assembly import Assembly, Lot, assemble
from laufruhe.extensions.robust.assembly_solver import _Search
from laufruhe.extensions.robust.result import AssemblyResult
from laufruhe.files.reader import load
from laufruhe.load_models.affine import AffineNorm
from laufruhe.numerics.norms import MEAN, Grid
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from laufruhe.solvers.result import Result
from problem_files import FOUR, MOUNTS

THREE = FOUR.replace("[1, 3, 4, 2]", "[1, 3, 2]")
POINT = '[[operating_points]]\nspeed = "2500 rpm"\n[fidelity]\nsamples = 48\n'
LEAST = '[objective]\nminimise = "{}"\n'
PISTONS, RODS = (
    (1250.0, 1243.0, 1259.0, 1246.0, 1231.0),
    ((400.0, 800.0), (405.0, 790.0), (391.0, 812.0), (403.0, 801.0)),
)

Read = Callable[..., Problem]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    def of(text: str, pistons: Sequence[float] = PISTONS, rods: Sequence[Sequence[float]] = RODS) -> Problem:
        (tmp_path / "p.csv").write_text("mass\n" + "".join(f"{m}\n" for m in pistons), encoding="utf-8")
        (tmp_path / "r.csv").write_text("".join(f"{a},{b}\n" for a, b in rods), encoding="utf-8")
        (tmp_path / "engine.toml").write_text(text, encoding="utf-8")
        return load(tmp_path / "engine.toml")

    return of


def every(problem: Problem) -> list[float]:
    """Return the objective of all assemblies by the exact model."""
    own = problem.extra(Assembly)
    assert own is not None
    lots, cylinders = own.lots, len(problem.engine.slider_cranks)
    found = []
    for chosen in itertools.product(*(itertools.permutations(range(len(lot.masses)), cylinders) for lot in lots)):
        found.append(objective_value(problem, evaluate(problem, assemble(problem.engine, lots, chosen))))
    return found


def best(result: Result) -> float:
    assert result.objective is not None
    return result.objective.value


@pytest.mark.parametrize(
    ("engine", "quantity", "lots"),
    [
        (THREE + MOUNTS, "mean mount force", 'pistons = "p.csv"\n'),
        (THREE, "rms rocking couple", 'pistons = "p.csv"\nrods = "r.csv"\n'),
        (FOUR, "maximum shaking force", 'rods = "r.csv"\n'),
        (FOUR, "peak to peak shaking force", 'pistons = "p.csv"\n'),
    ],
)
def test_best_of_all_assemblies(read: Read, engine: str, quantity: str, lots: str) -> None:
    pistons = PISTONS[:4] if "rods" in lots else PISTONS
    problem = read(engine + POINT + LEAST.format(quantity) + "[assembly]\n" + lots, pistons)
    result = solve(problem)
    # many angles may tell otherwise of the proof than those asked for
    values = every(result.problem)
    assert result.certificate is not None
    assert isinstance(result.details, AssemblyResult)
    assert result.certificate.kind is Proof.GLOBAL
    assert best(result) == pytest.approx(min(values), rel=1e-4)
    assert result.certificate.lower_bound <= min(values) * (1.0 + 1e-12)
    assert result.details.assemblies == len(values)
    assert result.details.worst <= max(values) * (1.0 + 1e-9)
    # every part once
    for kind in range(len(result.details.kinds)):
        parts = [place.parts[kind] for place in result.details.places]
        assert len(set(parts)) == len(parts)


def test_parts_of_one_mass_are_the_drawing(read: Read) -> None:
    problem = read(THREE + POINT + LEAST.format("rms rocking couple") + '[assembly]\npistons = "p.csv"\n', [1250.0] * 4)
    drawing = objective_value(problem, evaluate(problem))
    assert best(solve(problem)) == pytest.approx(drawing, rel=1e-9)


def test_more_parts_are_never_worse(read: Read) -> None:
    """Check that two more parts of the same mean mass give no worse assembly."""
    text = THREE + POINT + LEAST.format("rms rocking couple") + '[assembly]\npistons = "p.csv"\n'
    few = best(solve(read(text, [1240.0, 1250.0, 1260.0])))
    many = best(solve(read(text, [1240.0, 1250.0, 1260.0, 1245.0, 1255.0])))
    assert many <= few * (1.0 + 1e-4)


def test_order_of_the_file_does_not_matter(read: Read) -> None:
    text = THREE + POINT + LEAST.format("rms rocking couple") + '[assembly]\npistons = "p.csv"\nrods = "r.csv"\n'
    values = [best(solve(read(text, np.array(PISTONS)[order]))) for order in ([0, 1, 2, 3, 4], [4, 2, 0, 1, 3])]
    assert values[0] == pytest.approx(values[1], rel=1e-4)


@pytest.mark.parametrize(
    ("more", "rule"),
    [
        ("[assembly]\n", "names no file of parts"),
        ('[assembly]\npistons = "none.csv"\n', "cannot be read"),
        ('[assembly]\npistons = "p.csv"\nmass_unit = "mm"\n', "not a unit of a mass"),
        ('[assembly]\nrods = "r.csv"\n', "has 2 parts for 3 cylinders"),
    ],
)
def test_one_line_for_what_is_wrong(read: Read, more: str, rule: str) -> None:
    with pytest.raises(InputError) as caught:
        read(THREE + POINT + LEAST.format("rms rocking couple") + more, PISTONS, RODS[:2])
    (complaint,) = caught.value.complaints
    assert rule in complaint.rule


def test_an_assembly_with_open_numbers_is_refused(read: Read) -> None:
    weight = '[[counterweights]]\nname = "w"\nopposite_throw = 1\nunbalance = { between = ["0 kg m", "1 kg m"] }\n'
    text = THREE + POINT + LEAST.format("rms rocking couple") + '[assembly]\npistons = "p.csv"\n' + weight
    with pytest.raises(ModelError, match="without open numbers"):
        solve(read(text))


@pytest.mark.parametrize("seed", range(6))
def test_no_part_of_the_search_is_left_out_that_holds_the_best(seed: int) -> None:
    """Compare value and bound of the search on random rows with all assemblies."""
    rng = np.random.default_rng(seed)
    cylinders = 3
    grid = Grid(np.full(6, 1.0 / 6.0), 6)
    rows, slope = rng.normal(size=(6, 2)), rng.normal(size=(6, 2, 2 * cylinders))
    terms = [(1.0, AffineNorm(MEAN, rows, 20.0 * slope, grid))]
    lots = [Lot("piston", tuple((float(a), 0.0) for a in rng.uniform(0.9, 1.1, 4)))]
    lots.append(Lot("rod", tuple((float(a), float(b)) for a, b in rng.uniform(0.4, 0.6, (4, 2)))))
    search = _Search(terms, lots, cylinders, 1e-4)
    bound = search.run()
    every = [
        search._value(chosen)
        for chosen in itertools.product(*(itertools.permutations(range(4), cylinders) for _ in lots))
    ]
    assert search.value == pytest.approx(min(every), rel=1e-4)
    assert bound <= min(every) * (1.0 + 1e-12)
    assert bound >= min(every) * (1.0 - 1e-4)


def test_parts_of_small_engines_are_as_welcome(read: Read) -> None:
    light = FOUR.replace("1.25 kg", "0.25 kg")
    problem = read(light + POINT + LEAST.format("mean shaking force") + '[assembly]\npistons = "p.csv"\n')
    assert problem.extra(Assembly) is not None
    with pytest.raises(InputError, match="above all differences of the parts"):
        read(
            FOUR.replace("1.25 kg", "0.01 kg") + POINT + LEAST.format("mean shaking force")
            + '[assembly]\npistons = "p.csv"\n', pistons=(1290.0, 1250.0, 1240.0, 1230.0),
        )  # fmt: skip
