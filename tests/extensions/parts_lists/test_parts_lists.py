"""Parts from lists: against brute force over all rows, with every stop of the search, and bad lists."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from extensions.parts_lists.scenes import random_scene
from lanes import first_fast
from laufruhe.errors import BoundError, InputError, LaufruheError, SolverError
from laufruhe.extensions.parts_lists import solver
from laufruhe.extensions.parts_lists.lists import RANKED, Outcome
from laufruhe.extensions.parts_lists.price import price_of
from laufruhe.extensions.parts_lists.section import SECTION
from laufruhe.files.reader import load, load_tables
from laufruhe.numerics.witness import collected
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import methods, solve
from laufruhe.solvers.result import Result, Status
from problem_files import FOUR, MOUNTS, PROBLEMS

CLOSE = 1e-6
STOPS = (0, 1, 2, 5, 9, 20)
POINT = '[[operating_points]]\nspeed = "2500 rpm"\n[objective]\nminimise = "rms mount force"\n'
WEB = '[[counterweights]]\nname = "web"\nopposite_throw = 1\nradius = "60 mm"\nmass = "1 kg"\n'
CHOICE = '[[choices]]\nname = "weight"\nfile = "w.csv"\nparts = ["web"]\n'
ROWS = "name, mass [kg], price\nsmall, 0.5, 9\nmiddle, 1.5, 6\nlarge, 3.0, 4\n"


def outcome_of(result: Result) -> Outcome:
    assert isinstance(result.details, Outcome)
    return result.details


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., Problem]:
    def of(text: str = "", rows: str = ROWS, choice: str = CHOICE, point: str = POINT) -> Problem:
        (tmp_path / "w.csv").write_text(rows, encoding="utf-8")
        (tmp_path / "engine.toml").write_text(FOUR + MOUNTS + point + WEB + text + choice, encoding="utf-8")
        return load(tmp_path / "engine.toml")

    return of


@pytest.mark.parametrize("seed", first_fast([2, 25, 11, *sorted({*range(100)} - {2, 11, 25})], 2, 3))
def test_brute_force_finds_no_better_combination(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The value is the least of all combinations, and no bound is above it, whenever the search stops."""
    scene = random_scene(seed)
    values = scene.values()
    best = min((value for value in values.values() if math.isfinite(value)), default=math.inf)
    problem, known = scene.load(tmp_path), dict[int, Result]()

    def decide(part: Problem) -> Result:
        key = hash(repr((part.engine, part.decisions, part.limits, part.search)))
        if key not in known:
            known[key] = methods._solve_reduced(part)
        return known[key]

    # few boxes give weaker bounds, and no other answer
    monkeypatch.setattr(solver, "BOXES", 4)
    # subsets are bounded before they are small too
    for size in (solver.LARGE, 2):
        monkeypatch.setattr(solver, "SMALL", min(solver.SMALL, size))
        monkeypatch.setattr(solver, "LARGE", size)
        for stop in (*STOPS, solver.MAX_NODES):
            with collected() as contradictions:
                result = solver.solve_choices(problem, decide, stop)
            assert not contradictions
            if math.isinf(best):
                assert result.status in (Status.INFEASIBLE, Status.FAILED)
                assert result.status is Status.FAILED or all(value == math.inf for value in values.values())
                continue
            bound = result.certificate.lower_bound if result.certificate is not None else 0.0
            assert bound <= best * (1.0 + CLOSE)
            assert result.status is not Status.INFEASIBLE
            if result.status.has_design and result.objective is not None:
                assert result.objective.value >= best * (1.0 - CLOSE)
                assert values[outcome_of(result).solved[0].rows] == pytest.approx(result.objective.value, rel=CLOSE)
        assert result.objective is not None or math.isinf(best)
        assert result.objective is None or result.objective.value == pytest.approx(best, rel=CLOSE)


def test_bounds_exclude_most_rows(read: Callable[..., Problem]) -> None:
    rows = "name, mass [kg]\n" + "".join(f"w{k}, {0.05 * k + 0.1:.2f}\n" for k in range(60))
    result = solve(read(rows=rows))
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    outcome = outcome_of(result)
    assert outcome.whole == 60
    assert len(outcome.solved) + outcome.excluded == 60
    assert outcome.excluded > 30


def test_ranked_combinations_are_the_best_of_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = random_scene(8)
    monkeypatch.setattr(solver, "SMALL", 1)
    outcome = outcome_of(solve(scene.load(tmp_path)))
    best = sorted(value for value in scene.values().values() if math.isfinite(value))[:RANKED]
    assert [known.value for known in outcome.solved[: len(best)]] == pytest.approx(best, rel=CLOSE)


def test_price_is_a_limit_or_a_term(read: Callable[..., Problem]) -> None:
    price = "[parts_price]\ntotal = 5\n"
    free = solve(read(price))
    dear = solve(read(price + '[[constraints]]\nlimit = "parts price"\nmax = 5\n'))
    assert free.objective is not None
    assert dear.objective is not None
    assert dear["parts price"] == 4.0
    assert dear.objective.value > free.objective.value
    forces = {known.rows[0]: known.value for known in outcome_of(free).solved}
    for weight in (1.0, 400.0, 4000.0):
        terms = f'quantity = "rms mount force"\n[[objective.terms]]\nquantity = "parts price"\nweight = {weight}\n'
        point = POINT.replace('[objective]\nminimise = "rms mount force"\n', "[[objective.terms]]\n" + terms)
        both = solve(read(price, point=point))
        assert both.objective is not None
        expected = min(force + weight * (9.0, 6.0, 4.0)[row] for row, force in forces.items())
        assert both.objective.value == pytest.approx(expected, rel=1e-9)
        assert both.certificate is not None
        assert both.certificate.kind is Proof.GLOBAL


def test_a_row_over_the_price_limit_is_not_solved(read: Callable[..., Problem]) -> None:
    """Check limits of the file and of rows: three rows at 9, 6 and 4 under 7, 5 and 4."""
    limit = '[parts_price]\ntotal = 5\n[[constraints]]\nname = "cost"\nlimit = "parts price"\nmax = 7\n'
    of_rows = "name, mass [kg], price, most\nsmall, 0.5, 9, 7\nmiddle, 1.5, 6, 5\nlarge, 3.0, 4, 4\n"
    sets = CHOICE + 'sets = { most = "constraints.cost.max" }\n'
    for rows, choice, allowed in ((ROWS, CHOICE, {6.0, 4.0}), (of_rows, sets, {4.0})):
        problem, prices = read(limit, rows=rows, choice=choice), set[float]()

        def decide(part: Problem, prices: set[float] = prices) -> Result:
            prices.add(price_of(part.engine))
            return methods._solve_reduced(part)

        result = solver.solve_choices(problem, decide)
        assert prices == allowed
        assert result.certificate is not None
        assert result.certificate.kind is Proof.GLOBAL
        assert result["cost"] in allowed


def test_a_solver_that_stops_proves_nothing(read: Callable[..., Problem]) -> None:
    """A combination without a result counts with a bound of zero, and never as infeasible."""
    problem = read()

    def decide(part: Problem) -> Result:
        if part.decisions or any(rotor.name == "web" and abs(rotor.unbalance) < 0.05 for rotor in part.engine.rotors):
            raise SolverError("stopped")
        return methods._solve_reduced(part)

    result = solver.solve_choices(problem, decide)
    assert result.certificate is not None
    assert result.certificate.lower_bound == 0.0
    assert result.certificate.kind is Proof.LOCAL
    assert "'small' (stopped)" in result.message

    def never(_: Problem) -> Result:
        raise SolverError("stopped")

    assert solver.solve_choices(problem, never).status is Status.FAILED


def test_no_time_gives_a_row_and_no_other_design(read: Callable[..., Problem]) -> None:
    """The initial design is no row, so that it is no answer even if the time is over at once."""
    result = solve(read(), time_limit=0.0)
    assert result.status.has_design
    (web,) = (rotor for rotor in result.final.engine.rotors if rotor.name == "web")
    assert abs(web.unbalance) == pytest.approx(0.06 * 0.5)
    failed = solve(
        read('[[constraints]]\nlimit = "counterweight mass"\nmax = "1.2 kg"\n', rows=ROWS.replace("0.5", "2")),
        time_limit=0.0,
    )
    assert not failed.status.has_design


def test_a_broken_bound_is_reported(read: Callable[..., Problem]) -> None:
    """A bound of a subset above a combination in it withholds the proof."""
    rows = "name, mass [kg]\n" + "".join(f"w{k}, {0.2 * k + 0.1:.2f}\n" for k in range(12))
    problem = read(rows=rows)

    class Broken(solver._Search):
        def bound(self, subset: Any) -> float:
            return 1.5 * super().bound(subset)

    with pytest.raises(BoundError):
        Broken(problem, methods._solve_reduced).run(solver.MAX_NODES)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("", "0 rows"),
        ("name, mass [kg]\nsmall, 1, 2\n", "line 2, row 'small'"),
        ("name, mass [kg]\nsmall, 1\nsmall, 2\n", "line 3, row 'small', column 'name': no name"),
        ("name, mass [kg]\nsmall, 1\nlarge, two\n", "line 3, row 'large', column 'mass [kg]': 'two'"),
        ("name, mass [kg]\nsmall, -1\n", "line 2, row 'small', column 'mass [kg]': counterweights[1].mass"),
        ("name, mass [mm]\nsmall, 1\n", "line 2, row 'small', column 'mass [mm]'"),
        ("name, weight [kg]\nsmall, 1\n", "column 'weight [kg]'"),
        ("name, mass [kg], mass [kg]\nsmall, 1, 2\n", "two heads 'mass [kg]'"),
    ],
)
def test_bad_lists_are_refused_in_one_line(read: Callable[..., Problem], rows: str, words: str) -> None:
    with pytest.raises(InputError) as error:
        methods.refuse(read(rows=rows))
    (line,) = str(error.value).splitlines()
    assert 'engine.toml: choices[1].file = "w.csv": has' in line
    assert words in line
    assert "; " in line


@pytest.mark.parametrize(
    ("text", "choice", "words"),
    [
        ("", CHOICE.replace("w.csv", "none.csv"), "cannot be read"),
        ("", CHOICE + CHOICE, "one name"),
        ("", CHOICE + CHOICE.replace('"weight"', '"other"'), "which 'mass [kg]' of 'weight' sets"),
        ("", CHOICE + 'sets = { rating = "web.radius" }\n', "is no column of w.csv"),
        ("", CHOICE.replace('parts = ["web"]\n', ""), "sets no number"),
        ("", CHOICE.replace('"web"', '"wob"'), "wob"),
        ('[robust]\nover = "worst case"\n[tolerances]\nresidual_unbalance = "50 g cm"\n', CHOICE, "not supported"),
    ],
)
def test_unsupported_parts_lists_are_refused_in_one_line(
    read: Callable[..., Problem], text: str, choice: str, words: str
) -> None:
    with pytest.raises(LaufruheError) as error:
        methods.refuse(read(text, choice=choice))
    assert words in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_open_and_changed_problems_are_refused(read: Callable[..., Problem], tmp_path: Path) -> None:
    problem = read()
    with pytest.raises(LaufruheError, match="code has changed"):
        solve(problem.changed(limits=()))
    text = (tmp_path / "engine.toml").read_text(encoding="utf-8")
    (tmp_path / "engine.toml").write_text(text.replace('"1 kg"', '{ between = ["0 kg", "2 kg"] }'), encoding="utf-8")
    with pytest.raises(InputError, match="which sets an open number"):
        methods.refuse(load(tmp_path / "engine.toml"))
    (tmp_path / "engine.toml").write_text(text.replace("[1, 3, 4, 2]\n", '[1, 3, 4, 2]\nthrows = "open"\n'), "utf-8")
    with pytest.raises(LaufruheError, match="throws are open"):
        methods.refuse(load(tmp_path / "engine.toml"))


def test_report_shows_rows_and_counts(read: Callable[..., Problem]) -> None:
    result = solve(read('[parts_price]\ntotal = 5\n[[constraints]]\nlimit = "parts price"\nmax = 7\n'))
    chosen, ranked = SECTION.tables(result)
    row = outcome_of(result).solved[0].rows[0]
    assert list(chosen.rows[0][:2]) == ["weight", ["small", "middle", "large"][row]]
    assert len(ranked.rows) == len(outcome_of(result).solved)
    # the price of a row is above the limit
    assert "| small | - | - | infeasible |" in ranked.as_markdown()
    assert "| middle |" in chosen.as_markdown() or "| large |" in chosen.as_markdown()
    assert SECTION.record is not None
    record = SECTION.record(result)
    assert record["combinations"] == 3
    assert record["rows"] == {"weight": ["small", "middle", "large"][row]}


def test_a_result_names_its_rows_and_without_a_design_the_nearest_row(tmp_path: Path) -> None:
    """The cheapest flywheel that keeps the limit is printed; under a sharper limit the heaviest is nearest."""
    tables = tomllib.loads((PROBLEMS / "compressor-two-stage.toml").read_text())
    tables["counterweights"][0] |= {"unbalance": "76 kg mm", "angle": 180}
    tables["engine"]["single_cylinders"][0]["reciprocating_mass"] = "1.9 kg"
    tables["choices"] = [{"name": "flywheel", "file": "f.csv", "parts": ["flywheel"]}]
    tables |= {"parts_price": {"total": 180}, "objective": {"minimise": "parts price"}}
    (tmp_path / "f.csv").write_text("name, inertia [kg m^2], price\nA, 0.6, 180\nB, 1.2, 240\nC, 2.4, 330\n")

    def solved_at(degree: float) -> Result:
        limit = [{"limit": "degree of irregularity", "max": degree}]
        return solve(load_tables({**tables, "constraints": limit}, tmp_path / "compressor.toml"))

    first, *others = (solved_at(degree) for degree in (1.0, 1e-9))
    needed = first.limits[0].value
    result = solved_at(0.6 * needed)
    assert outcome_of(result).rows == {"flywheel": "B"}
    assert "\n  flywheel: B" in repr(result)
    (without,) = others
    assert without.status is Status.INFEASIBLE
    assert without.message.endswith("; 'C' is nearest")
    assert without.nearest is not None
    alone = {**tables, "flywheel": {"inertia": "2.4 kg m^2"}, "choices": [], "parts_price": {"total": 330}}
    alone["constraints"] = [{"limit": "degree of irregularity", "max": 1.0}]
    heaviest = solve(load_tables(alone, tmp_path / "compressor.toml")).limits[0].value
    assert without.nearest.value == pytest.approx(heaviest, rel=1e-9)
    assert heaviest < 0.3 * needed
