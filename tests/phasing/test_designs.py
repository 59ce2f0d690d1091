"""Stars, shafts and unbalances together: cuts and listing agree."""

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from laufruhe.errors import InputError
from laufruhe.files.reader import load_tables
from laufruhe.load_models.star_model import StarModel
from laufruhe.machine.firing import lap_orders
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate
from laufruhe.prove.certificate import Multipliers, Proof, gap_of, lower_bound
from laufruhe.prove.throws.star_cuts import cut_of
from laufruhe.solvers import solve
from laufruhe.solvers.result import Status
from laufruhe.solvers.stars.even_search import search_even
from laufruhe.solvers.stars.families import families_of
from laufruhe.solvers.stars.star_program import (
    SolvedStar,
    _distinct_values,
    coarse_value,
    search_designs,
    shaft_owners,
    solve_design,
)
from laufruhe.solvers.walk import _change_order
from phasing import engines

TWO_SHAFTS = engines.shaft("against", -1) + engines.shaft("second", 2)
CASES = {
    "mean": engines.MOUNTS + engines.WEIGHTS + engines.MOUNT_FORCE,
    "rms": engines.MOUNTS + engines.WEIGHTS + engines.MOUNT_FORCE.replace("mean", "rms"),
    "maximum": engines.MOUNTS + engines.WEIGHTS + engines.MOUNT_FORCE.replace("mean", "maximum"),
    "couple, mean": engines.WEIGHTS + engines.COUPLE.replace("rms", "mean"),
    "balance factor": engines.MOUNTS
    + '[[counterweights]]\nname = "all"\nbalance_factor = { between = [-0.2, 0.8] }\n'
    + engines.MOUNT_FORCE,
    "limited": engines.MOUNTS
    + engines.WEIGHTS.replace("angle", 'radius = "80 mm"\nangle')
    + engines.MOUNT_FORCE
    + '[[constraints]]\nlimit = "counterweight mass"\nmax = "0.5 kg"\n',
    "shafts": engines.MOUNTS + engines.WEIGHTS + TWO_SHAFTS + engines.MOUNT_FORCE,
}


def model_of(problem):
    (family,), _ = families_of(problem.phasing)
    return StarModel(problem.phasing, family.space, family.geometry), family.stars


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("cylinders", [3, 4])
def test_search_equals_solving_every_design(tmp_path, cylinders, name):
    choice = "most_shafts = 1" if name == "shafts" else ""
    problem = engines.problem(tmp_path, cylinders, phasing=choice, rest=CASES[name])
    # averages about the angles, which bound means, come near these
    problem = problem.at(replace(problem.fidelity, samples=4 * problem.fidelity.samples))
    model, stars = model_of(problem)
    nothing = numerical_zero(problem)
    every = search_designs(model, stars, 10**9, 1e-4, zero_level=nothing)
    result = search_designs(model, stars, 1, 1e-4, zero_level=nothing)
    assert len(every.solved) == every.designs
    assert result.solved[0].value == pytest.approx(every.solved[0].value, rel=2e-4, abs=nothing)
    assert result.lower_bound <= every.solved[0].value * (1.0 + 1e-9)
    assert gap_of(result.solved[0].value, result.lower_bound, nothing) <= 2e-4


@pytest.mark.parametrize("name", CASES)
def test_rows_of_a_star_are_those_of_the_exact_model(tmp_path, name):
    problem = engines.problem(tmp_path, 5, "four-stroke", rest=CASES[name])
    model, stars = model_of(problem)
    rng = np.random.default_rng(3)
    for star in stars[rng.integers(0, len(stars), 4)]:
        x = np.concatenate([0.2 * d.scale * rng.uniform(0.0, 1.0, d.width) for d in model.domains])
        star_problem = model.phasing.problem_of(model.phasing.star(star, model.space.phases, model.geometry))
        unbalances = [domain.complex_value(x) for domain in model.domains]
        # decisions at any angle are counted from upright in the model: with equal drives that is the same rotor
        turned = [
            u if not d.set.free_angle else u * _turn(d) for u, d in zip(unbalances, star_problem.decisions, strict=True)
        ]
        value = objective_value(star_problem, evaluate(star_problem, star_problem.design(turned)))
        again = model.at(model.samples).at(star).objective(x)
        tolerance = 2e-3 if name == "maximum" else 1e-9
        assert again == pytest.approx(value, rel=tolerance)


def _turn(decision):
    gain = decision.drives[0].gain
    return (gain / abs(gain)).conjugate()


@pytest.mark.parametrize("built", [(), (0,), (1,), (0, 1)])
def test_a_set_of_shafts_has_the_value_of_an_engine_with_these_alone(tmp_path, built):
    """Compare a set of built shafts on one star with the problem of these shafts alone."""
    weight = engines.WEIGHTS.partition('[[counterweights]]\nname = "rear"')[0]
    problem = engines.problem(tmp_path, 3, rest=engines.MOUNTS + weight + TWO_SHAFTS + engines.MOUNT_FORCE)
    model, stars = model_of(problem)
    star = tuple(map(int, stars[0]))
    found, _ = solve_design(model, star, built, 1e-4, numerical_zero(problem))
    candidate = replace(
        model.phasing.star(star, model.space.phases, model.geometry), left_out=model.phasing.without(built)
    )
    alone = solve(replace(model.phasing.problem_of(candidate), phasing=None))
    assert alone.certificate.kind is Proof.GLOBAL
    assert found.value == pytest.approx(alone.objective.value, rel=2e-4)
    assert coarse_value(model, star, built) == pytest.approx(found.value, rel=0.02)


def test_a_shaft_that_has_to_be_heavy_is_left_out_where_it_harms(tmp_path):
    """Compare with every star and every allowed set of shafts, one of which may weigh nothing."""
    heavy = engines.shaft("against", -1).replace('"0 kg m"', '"0.09 kg m"', 1).replace("{ between = [0, 360] }", "0")
    rest = engines.MOUNTS + heavy + engines.shaft("second", 2) + engines.MOUNT_FORCE
    problem = engines.problem(tmp_path, 3, rest=rest)
    model, stars = model_of(problem)
    sets = model.phasing.shafts.allowed
    every = {built: solve_design(model, tuple(map(int, stars[0])), built, 1e-4)[0].value for built in sets}
    assert min(every, key=every.get) == (1,)
    result = search_designs(model, stars[:1], 1, 1e-4)
    assert result.lower_bound <= min(every.values())
    assert result.solved[0].value == pytest.approx(min(every.values()), rel=2e-4)


def test_a_shaft_that_no_design_needs_is_not_built(tmp_path):
    """Check a shaft of order 3 on a three-cylinder engine without that order."""
    shafts = engines.shaft("against", -1) + engines.shaft("third", 3)
    result = solve(engines.problem(tmp_path, 3, rest=engines.MOUNTS + engines.WEIGHTS + shafts + engines.MOUNT_FORCE))
    built = {d.name: d.value for d in result.decisions if d.name.endswith("built")}
    assert built == {"against built": 1.0, "third built": 0.0}


def test_a_constant_limit_leaves_the_optimum_of_a_star(tmp_path):
    """Check that design and bound equal those without the constant limit, with another one active."""
    fixed = '[[constraints]]\nlimit = "mean mount force"\norders = [2]\nmax = "1e6 N"\n'
    binding = CASES["limited"].partition("[[constraints]]")
    found = []
    for limits in ("", fixed):
        problem = engines.problem(tmp_path, 4, rest=binding[0] + limits + "".join(binding[1:]))
        model, stars = model_of(problem)
        design, cut = solve_design(model, tuple(map(int, stars[1])), (), 1e-4)
        assert design.value * (1.0 - 1e-3) <= design.bound <= design.value
        found.append((design.value, design.bound, *cut.bounds(stars, [()], shaft_owners(model))[:, 0]))
    assert found[1] == pytest.approx(found[0], rel=1e-6)


def test_designs_marked_as_proven_are_the_best(tmp_path):
    problem = engines.problem(tmp_path, 5, phasing="best = 2", rest=CASES["rms"])
    model, stars = model_of(problem)
    result = search_even(problem, problem.phasing, families_of(problem.phasing)[0])
    values = _distinct_values(model.space, search_designs(model, stars, 10**9, 1e-4).solved)
    assert result.looked_at < len(stars)
    assert [design.proven for design in result.designs] == [True, True]
    assert [design.value for design in result.designs] == pytest.approx(values[:2], rel=2e-4)


def test_designs_count_once_with_their_mirror_images_alone(tmp_path):
    """Check that mirror images of one value count once, and other stars or values anew."""
    model, _ = model_of(engines.problem(tmp_path, 5, rest=CASES["mean"]))
    first, mirrored, other = (0, 1, 2, 3, 4), (0, 4, 3, 2, 1), (0, 2, 1, 3, 4)
    given = [(first, 1.0), (mirrored, 1.0), (other, 1.0), (mirrored, 2.0)]
    solved = [SolvedStar(star, (), value, value) for star, value in given]
    assert _distinct_values(model.space, solved) == [1.0, 1.0, 2.0]


@pytest.mark.parametrize("name", ["mean", "maximum", "balance factor", "limited"])
def test_a_cut_is_the_certificate_of_every_star(tmp_path, name):
    problem = engines.problem(tmp_path, 4, rest=CASES[name])
    model, stars = model_of(problem)
    fine = model.at(model.samples)
    rng = np.random.default_rng(5)
    multipliers = Multipliers(
        tuple(rng.standard_normal(n.constant.shape) for _, n in fine.terms),
        tuple(0.1 * np.abs(rng.standard_normal(n.constant.shape)) for _, n in fine.limits),
    )
    bounds = cut_of(fine, multipliers).bounds(stars, [()], shaft_owners(model))[:, 0]
    for star, bound in zip(stars, bounds, strict=True):
        assert bound == pytest.approx(lower_bound(fine.at(star), multipliers).value, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("name", ["rms", "mean"])
def test_cuts_never_exceed_an_optimum(tmp_path, name):
    problem = engines.problem(tmp_path, 4, rest=CASES[name])
    model, stars = model_of(problem)
    owners = shaft_owners(model)
    answers = [solve_design(model, tuple(star), (), 1e-6) for star in stars.tolist()]
    for _, cut in answers:
        bounds = cut.bounds(stars, [()], owners)[:, 0]
        assert np.all(bounds <= [s.value * (1.0 + 1e-9) for s, _ in answers])
        assert cut.minimum(model.space) <= min(s.value for s, _ in answers) * (1.0 + 1e-9)


@pytest.mark.slow
def test_limits_that_contradict_each_other_at_one_star_exclude_others(tmp_path):
    """Check that a contradiction at one star excludes many stars, and none that has a design."""
    couple = '[[constraints]]\nlimit = "rms rocking couple"\nmax = "850 N m"\n'
    problem = engines.problem(tmp_path, 5, rest=CASES["limited"] + couple)
    model, stars = model_of(problem)
    owners = shaft_owners(model)
    answers = [solve_design(model, tuple(star), (), 1e-4) for star in stars.tolist()]
    without = np.array([solved is None for solved, _ in answers])
    assert without.sum() == 12
    excluded = np.array([cut.excludes(stars, [()], owners)[:, 0] for solved, cut in answers if solved is None])
    assert not excluded[:, ~without].any()
    assert excluded[:, without].sum() > 2 * without.sum()
    result = search_designs(model, stars, 10**9, 1e-4)
    assert len(result.solved) == (~without).sum()
    assert 0 < result.infeasible < without.sum()
    assert result.solved[0].value == pytest.approx(min(solved.value for solved, _ in answers if solved), rel=2e-4)


@pytest.mark.slow
def test_shafts_keep_the_limits_on_number_and_mass(tmp_path):
    rest = (
        engines.MOUNTS + engines.WEIGHTS + engines.shaft("against", -1, mass="3 kg")
        + engines.shaft("second", 2, mass="1 kg") + engines.shaft("second back", -2, mass="1 kg") + engines.MOUNT_FORCE
    )  # fmt: skip
    built = {}
    for name, limit in (("none", "most_shafts = 0"), ("light", 'most_shaft_mass = "2 kg"'), ("all", "")):
        result = solve(engines.problem(tmp_path, 4, phasing=f"best = 1\n{limit}", rest=rest))
        built[name] = {d.name for d in result.decisions if d.name.endswith("built") and d.value}
        assert result.certificate.kind is Proof.GLOBAL
    assert built["none"] == set()
    assert "against built" not in built["light"]
    assert "against built" in built["all"]


GAS = '[gas]\nmodel = "seiliger"\npeak_pressure = "70 bar"\nimep = "7 bar"\n'


@pytest.mark.parametrize("measure", ["rms roll moment", "mean mount force"])
def test_given_throws_get_the_firing_order_that_gas_likes_best(tmp_path, measure):
    """Check that no firing order of uneven throws is below the bound."""
    rest = engines.MOUNTS + GAS + f'[objective]\nminimise = "{measure}"\n'
    wide = 'intervals = { min = "20 deg", max = "700 deg" }'

    def solved(order):
        engine = f"throws = [0, 90, 200, 300]\nfiring_order = {order}"
        return solve(engines.problem(tmp_path, 4, "four-stroke", engine, wide, rest))

    result = solved('"open"')
    every = []
    for rest_of_order in itertools.permutations((2, 3, 4)):
        try:
            every.append(solved([1, *rest_of_order]).objective.value)
        except InputError:
            # these throws cannot fire in this order within two turns
            continue
    assert max(every) > 1.02 * min(every)
    assert len(every) == result.phasing.ranking[0].order_count
    assert result.objective.value == pytest.approx(min(every), rel=1e-9)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.lower_bound <= min(every) * (1.0 + 1e-12)


def test_given_throws_that_break_a_limit_are_no_design(tmp_path):
    """Check that limits hold for given throws with only the firing order open."""
    limit = '[[constraints]]\nlimit = "maximum mount force"\nmax = "1 N"\n'
    rest = engines.MOUNTS + engines.MOUNT_FORCE + limit
    engine = 'throws = [0, 240, 120]\nfiring_order = "open"'
    result = solve(engines.problem(tmp_path, 3, "four-stroke", engine, rest=rest))
    assert result.status is Status.INFEASIBLE
    assert "limits" in result.message


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("measure", ["rms shaking force", "mean mount force", "rms shaking force, mean rocking couple"])
@pytest.mark.parametrize("cylinders", [3, 4, 5])
def test_a_cancelled_order_sets_no_scale_for_unbalances(tmp_path, cylinders, measure, order):
    """Check that roundings of an order that all stars cancel set no scale for unbalances."""
    names = measure.split(", ")
    terms = f'[[objective.terms]]\nquantity = "{names[0]}"\norders = [{order}]\n'
    terms += "".join(f'[[objective.terms]]\nquantity = "{name}"\n' for name in names[1:])
    half = engines.WEIGHTS.replace("360", "180", 1)
    problem = engines.problem(tmp_path, cylinders, rest=engines.MOUNTS + half + "[objective]\n" + terms, samples=240)
    result = solve(problem)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value <= result.objective.initial * (1.0 + 1e-9)
    if measure == "rms shaking force":
        assert result.objective.value <= 1e-9


def test_a_limit_at_its_edge_excludes_no_star(tmp_path):
    """Check a limit on order 2, whose mean 48 angles overestimate by up to 1 %."""
    rest = engines.MOUNTS + engines.WEIGHTS + engines.MOUNT_FORCE
    free = engines.problem(tmp_path, 5, rest=rest)
    limit = '[[constraints]]\nlimit = "mean mount force"\norders = [2]\nmax = "{:.9g} N"\n'
    model, stars = model_of(engines.problem(tmp_path, 5, rest=rest + limit.format(1e6)))
    ((_, norm),) = model.at(4 * model.samples).limits
    edges = sorted({norm.at(star).value(np.zeros(norm.slope.shape[-1])) for star in stars})
    best = search_designs(model_of(free)[0], stars, 10**9, 1e-4).solved
    for edge in (edges[0], edges[len(edges) // 2]):
        model, _ = model_of(engines.problem(tmp_path, 5, rest=rest + limit.format(edge * (1.0 + 2e-6))))
        found = {s.star for s in search_designs(model, stars, 10**9, 1e-4).solved}
        couples = {s.star: norm.at(s.star).value(np.zeros(norm.slope.shape[-1])) for s in best}
        assert found >= {star for star, value in couples.items() if value <= edge}
        assert found <= {star for star, value in couples.items() if value <= edge * (1.0 + 1e-4)}
        assert 0 < len(found) < len(stars)


@pytest.mark.parametrize(("bank", "split"), [((60, 90), 0), (90, (-30, 30))])
def test_initial_angles_are_those_of_the_evaluated_design(bank, split):
    both = [angle if isinstance(angle, int) else {"between": list(angle)} for angle in (bank, split)]
    text = {
        "title": "ten", "engine": {
            "layout": "vee", "cycle": "four-stroke", "cylinders": 10, "stroke": "80 mm", "rod_ratio": 0.27,
            "reciprocating_mass": "0.5 kg", "rotating_mass": "0.5 kg", "cylinder_spacing": "100 mm", "throws": "open",
            "bank_angle": both[0], "split_pin_angle": both[1],
        },
        "operating_points": [{"speed": "6000 rpm"}], "objective": {"minimise": "rms rocking couple"},
    }  # fmt: skip
    result = solve(load_tables(text, Path("ten.toml")))
    name = "bank angle" if isinstance(split, int) else "split pin angle"
    chosen = next(decision for decision in result.decisions if decision.name == name)
    open_key, given = name.replace(" ", "_"), math.degrees(chosen.initial)
    engine = {**text["engine"], "throws": [math.degrees(d.initial) for d in result.decisions if "throw" in d.name]}
    again = load_tables({**text, "engine": {**engine, open_key: given}}, Path("ten.toml"))
    assert objective_value(again, evaluate(again)) == pytest.approx(result.objective.initial, rel=1e-9)
    assert given == pytest.approx(72.0 if isinstance(split, int) else -18.0)


def test_a_star_that_breaks_a_constant_limit_is_no_design(tmp_path):
    """Check a limit on order 2, which weights of order 1 do not change, star by star."""
    rest = engines.MOUNTS + engines.WEIGHTS + engines.MOUNT_FORCE
    limit = '[[constraints]]\nlimit = "rms rocking couple"\norders = [2]\nmax = "{:.9g} N m"\n'
    model, stars = model_of(engines.problem(tmp_path, 4, rest=rest + limit.format(1e6)))
    ((_, norm),) = model.at(model.samples).limits
    star_values = {star: norm.at(star).value(np.zeros(norm.slope.shape[-1])) for star in map(tuple, stars.tolist())}
    low, high = min(star_values.values()), max(star_values.values())
    assert low < 0.9 * high
    model, _ = model_of(engines.problem(tmp_path, 4, rest=rest + limit.format(0.5 * (low + high))))
    for aim in (min, max):
        star = aim(star_values, key=star_values.__getitem__)
        solved, cut = solve_design(model, star, (), 1e-4)
        assert (solved is None) == (aim is max)
        assert solved is not None or cut.excludes(np.array([star]), [()], shaft_owners(model)).all()


def test_a_walk_tries_every_firing_order_of_the_throws(tmp_path):
    problem = engines.problem(tmp_path, 4, "four-stroke", rest=CASES["mean"])
    phasing, throws = problem.phasing, (0.0, math.pi, math.pi, 0.0)
    start = Candidate(throws, (1, 3, 4, 2))
    orders = [*lap_orders(phasing.cycle, phasing.layout_of(start), throws)]
    assert len(orders) > 1
    for k, order in enumerate(orders):
        assert _change_order(phasing, k, start, 0.0) == replace(start, firing_order=order)
    assert _change_order(phasing, len(orders), start, 0.0) is None


@pytest.mark.parametrize("method", ["auto", "search", "program", "enumeration"])
def test_a_file_may_name_any_method(tmp_path, method):
    phasing = engines.problem(tmp_path, 3, phasing=f'method = "{method}"').phasing
    assert phasing.lists_all is (method == "enumeration")
