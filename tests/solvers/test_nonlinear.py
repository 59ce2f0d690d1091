"""Nonlinear runner: known optima, judged by independent optimality conditions."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

from laufruhe.numerics.budget import limit_time
from laufruhe.numerics.norms import softened_lengths
from laufruhe.solvers.mounts.starts import spread_starts
from laufruhe.solvers.smooth.ipopt import Task, _kkt_residual
from laufruhe.solvers.smooth.local_optimum import Ending, describe_starts, distinct_optima, is_explored
from laufruhe.solvers.smooth.nonlinear import NonlinearProgram, solve_nonlinear


def rosenbrock(radius: float = 1.0) -> NonlinearProgram:
    z = ca.SX.sym("z", 2)
    return NonlinearProgram(
        z, (1 - z[0]) ** 2 + 100 * (z[1] - z[0] ** 2) ** 2, np.full(2, -3.0), np.full(2, 3.0),
        constraints=ca.sumsqr(z), constraint_lower=np.array([-np.inf]),
        constraint_upper=np.array([radius]), constraint_names=("disc",),
    )  # fmt: skip


def test_optimum_on_a_constraint_agrees_with_another_solver():
    best = solve_nonlinear(rosenbrock(), [np.array([-1.0, 1.0])])[0]
    other = minimize(
        lambda z: (1 - z[0]) ** 2 + 100 * (z[1] - z[0] ** 2) ** 2, [0.5, 0.5], method="SLSQP",
        constraints={"type": "ineq", "fun": lambda z: 1 - z @ z}, options={"ftol": 1e-14},
    )  # fmt: skip
    assert best.usable
    assert best.kkt_residual < 1e-7
    assert best.x == pytest.approx(other.x, abs=1e-6)
    # the price of the limit is the slope of the optimum over it
    step = 1e-4
    moved = solve_nonlinear(rosenbrock(1.0 + step), [best.x])[0]
    assert best.multipliers[0] == pytest.approx((best.value - moved.value) / step, rel=1e-3)


def test_a_start_whose_time_is_over_stops_where_it_is_and_the_next_does_not():
    """The clock is no part of the program, which is built once."""
    stopped = solve_nonlinear(rosenbrock(), [np.array([-1.0, 1.0])], max_seconds=0.0)[0]
    assert stopped.ending is Ending.UNFINISHED
    assert stopped.iterations <= 1
    assert solve_nonlinear(rosenbrock(), [np.array([-1.0, 1.0])])[0].usable


def test_the_ends_of_starts_are_described():
    """Check texts also for no convergence and for one start."""
    starts = [np.array([-1.0, 1.0]), np.array([0.5, 0.5])]
    stopped = solve_nonlinear(rosenbrock(), starts, max_seconds=0.0)
    met = solve_nonlinear(rosenbrock(), starts)
    assert (
        describe_starts(stopped, len(distinct_optima(stopped, 1.0))) == "IPOPT from 2 starts, none of which converged"
    )
    assert describe_starts(stopped[:1], 0) == "IPOPT from 1 start, which never converged"
    assert describe_starts(met, 1) == "IPOPT from 2 starts, 2 of which ended at one and the same optimum"
    assert describe_starts([*met, *stopped], 2) == "IPOPT from 4 starts, 2 of which ended at 2 different optima"
    assert describe_starts([replace(met[0], starts=1)], 1) == "IPOPT from 1 start, which ended at an optimum"
    assert describe_starts([], 0) == "a design to start from"


def test_no_later_stage_is_begun_after_the_time():
    e = ca.SX.sym("e")
    program = replace(rosenbrock(), parameters=e, stages=((1.0,), (0.1,)))
    whole = solve_nonlinear(program, [np.array([-1.0, 1.0])])[0]
    assert whole.usable
    with limit_time(0.0):
        cut = solve_nonlinear(program, [np.array([-1.0, 1.0])])[0]
    # the first stage has its least time
    assert cut.ending is Ending.UNFINISHED
    assert cut.x == pytest.approx(whole.x, abs=1e-6)


def test_an_optimum_is_recognised_by_its_residual():
    """Check that a start one iteration short of the solver's tolerance counts by its residual."""
    whole = solve_nonlinear(rosenbrock(), [np.array([-1.0, 1.0])])[0]
    cut = solve_nonlinear(rosenbrock(), [np.array([-1.0, 1.0])], max_iterations=whole.iterations - 1)[0]
    assert cut.iterations < whole.iterations
    assert cut.kkt_residual <= 1e-7
    assert cut.usable
    assert cut.x == pytest.approx(whole.x, abs=1e-6)


@pytest.mark.parametrize(
    ("gradient", "multiplier", "bounds", "constraint", "residual"),
    [
        # (-4 + 2 x 3, -2 + 3 - 1) = (2, 0) over the largest sum of sizes, 4 + 2 x 3
        ((-4.0, -2.0), 3.0, (0.0, -1.0), 1.0, 0.2),
        # a multiplier of 3 whose constraint is 0.8 away from its upper side
        ((-6.0, -3.0), 3.0, (0.0, 0.0), 0.2, 3.0 * 0.8 / 12.0),
        # a lower side, here none, can carry nothing
        ((6.0, 3.0), -3.0, (0.0, 0.0), 0.2, 3.0 / 12.0),
        # the second variable at 0.25 has a multiplier of its upper side, 0.75 away; sums under one count as one
        ((0.0, -0.4), 0.0, (0.0, 0.4), 1.0, 0.4 * 0.75),
        # the violation of a limit counts unscaled
        ((-6.0, -3.0), 3.0, (0.0, 0.0), 1.7, 0.7),
    ],
)
def test_the_residual_by_hand(gradient, multiplier, bounds, constraint, residual):
    """Compare the residual of f + 3 g at (0, 1/4) with one constraint of slopes (2, 1) with hand values (N2)."""
    sides = np.array([0.0, 0.0]), np.array([1.0, 1.0]), np.array([-np.inf]), np.array([1.0])
    task = Task("", *sides, np.ones(2), 1.0, ((),), 1, 1.0, False)
    point, slopes = np.array([0.0, 0.25]), np.array([[2.0, 1.0]])
    numbers = (np.array(v, ndmin=1) for v in (constraint, gradient))
    computed, violation = _kkt_residual(task, point, *numbers, slopes, np.array([multiplier]), np.array(bounds))
    assert computed == pytest.approx(residual, rel=1e-12)
    assert violation == pytest.approx(max(constraint - 1.0, 0.0), rel=1e-12)


def test_the_residual_is_not_small_away_from_an_optimum():
    stopped = solve_nonlinear(rosenbrock(), [np.array([-1.0, 1.0])], max_iterations=2)[0]
    assert stopped.ending is Ending.UNFINISHED
    assert stopped.kkt_residual > 1e-3
    assert not stopped.usable


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_mean_of_lengths_reaches_zero_cleanly(workers):
    x, softness = ca.SX.sym("x", 2), ca.SX.sym("e")
    target = np.array([0.3, -0.2])
    slopes = np.random.default_rng(0).normal(size=(50, 3, 2))
    rows = ca.vertcat(*[(ca.DM(a) @ (x - ca.DM(target))).T for a in slopes])
    program = NonlinearProgram(
        x, ca.sum1(softened_lengths(rows, softness)) / 50, np.full(2, -1.0), np.full(2, 1.0),
        parameters=softness, stages=((1e-2,), (1e-5,), (1e-9,)),
    )  # fmt: skip
    result = solve_nonlinear(program, spread_starts(program.lower, program.upper, 4), workers=workers)
    assert len(result) == 4
    for optimum in result:
        assert optimum.usable
        assert optimum.x == pytest.approx(target, abs=1e-12)
        assert optimum.value == pytest.approx(0.0, abs=1e-12)


def test_softened_length_stays_under_the_length_by_no_more_than_its_softness():
    generator = np.random.default_rng(1)
    rows, e = generator.normal(size=(30, 3)) * 10.0 ** generator.uniform(-6, 3, (30, 1)), 1e-3
    soft = np.asarray(softened_lengths(ca.DM(rows), e)).ravel()
    true = np.linalg.norm(rows, axis=1)
    assert np.all(soft <= true * (1 + 1e-12))
    assert np.all(soft >= true - e * (1 + 1e-9))


def test_limits_that_contradict_are_called_so():
    x = ca.SX.sym("x", 1)
    program = NonlinearProgram(
        x, x[0], np.array([-5.0]), np.array([5.0]), constraints=ca.vertcat(x[0] ** 2, x[0]),
        constraint_lower=np.array([4.0, -1.0]), constraint_upper=np.array([np.inf, 1.0]),
    )  # fmt: skip
    result = solve_nonlinear(program, [np.array([0.5])])
    assert result[0].ending is Ending.INFEASIBLE
    assert not result[0].usable
    assert result[0].violation > 0.1


def test_a_function_without_a_value_is_called_so():
    x = ca.SX.sym("x", 1)
    program = NonlinearProgram(x, ca.log(-1.0 - x[0] ** 2), np.array([0.0]), np.array([1.0]))
    assert solve_nonlinear(program, [np.array([0.5])])[0].ending is Ending.FAILED


def test_many_starts_find_the_best_of_several_optima_in_every_order():
    x = ca.SX.sym("x", 1)
    program = NonlinearProgram(x, ca.sin(5 * x[0]) + 0.1 * x[0] ** 2, np.array([-4.0]), np.array([4.0]))
    values = set()
    for seed in range(3):
        result = solve_nonlinear(program, spread_starts(program.lower, program.upper, 16, seed), workers=1)
        apart = distinct_optima(result, 1.0)
        assert len(apart) >= 3
        assert [o.value for o in apart] == sorted(o.value for o in apart)
        values.add(round(result[0].value, 8))
    assert len(values) == 1


def waves(softness: float = 0.0) -> NonlinearProgram:
    """Return the five optima, one of them best, and the same in two stages, the first of which is under the second."""
    x, e = ca.SX.sym("x", 1), ca.SX.sym("e")
    return NonlinearProgram(
        x, ca.sin(5 * x[0]) + 0.1 * x[0] ** 2 - e, np.array([-4.0]), np.array([4.0]), parameters=e,
        stages=((softness,), (0.0,)),
    )  # fmt: skip


def test_one_of_equal_starts_goes_on_and_no_optimum_is_lost():
    """Check that starts left in the first stage end no better than the best optimum."""
    starts = spread_starts(np.array([-4.0]), np.array([4.0]), 24)
    result = solve_nonlinear(waves(0.3), starts, workers=1, stop_when=lambda optima: False)
    alone = [solve_nonlinear(waves(0.3), [start], workers=1)[0] for start in starts]
    apart = distinct_optima(alone, 1.0, 1e-9)
    assert len(result) == len(apart)
    assert result[0].value == pytest.approx(apart[0].value, abs=1e-12)
    stayed = 0
    for own in apart:
        end = min(result, key=lambda o: abs(o.x[0] - own.x[0]))
        assert end.x == pytest.approx(own.x, abs=1e-3)
        assert end.starts == sum(abs(own.value - a.value) < 1e-9 for a in alone)
        stayed += abs(end.value - own.value) > 1e-9
        assert end.value == pytest.approx(own.value, abs=1e-12) or result[0].value <= end.value < own.value
    assert 0 < stayed < len(apart) - 1


def test_dependent_variables_distinguish_no_optima():
    """Check a variable of either sign, as that of the shape of a mode."""
    x, e = ca.SX.sym("x", 2), ca.SX.sym("e")
    program = NonlinearProgram(
        x, (x[0] - 0.3) ** 2 - e, np.array([-4.0, -2.0]), np.array([4.0, 2.0]), constraints=x[1] ** 2,
        constraint_lower=np.ones(1), constraint_upper=np.ones(1), parameters=e, stages=((0.1,), (0.0,)),
    )  # fmt: skip
    starts = [np.array([1.0, sign]) for sign in (1.5, -1.5)]
    apart, same = (
        solve_nonlinear(replace(program, leading_variables=count), starts, workers=1, stop_when=lambda optima: False)
        for count in (None, 1)
    )
    assert [o.starts for o in apart] == [1, 1]
    assert [o.starts for o in same] == [2]
    assert same[0].value == pytest.approx(0.0, abs=1e-9)


def test_a_search_ends_by_the_rule_of_boender_and_rinnooy_kan():
    """Check the rule of Boender and Rinnooy Kan: seven starts for one optimum, more for several."""
    x = ca.SX.sym("x", 1)
    bowl = NonlinearProgram(x, (x[0] - 0.3) ** 2, np.array([-4.0]), np.array([4.0]))
    starts = spread_starts(np.array([-4.0]), np.array([4.0]), 60)
    tried = [
        solve_nonlinear(program, starts, workers=1, stop_when=lambda optima: is_explored(optima, 1.0))
        for program in (bowl, waves())
    ]
    assert sum(o.starts for o in tried[0]) == 7
    assert 13 < sum(o.starts for o in tried[1]) <= 25
    assert tried[1][0].starts > 1
    assert tried[1][0].value == pytest.approx(solve_nonlinear(waves(), starts, workers=1)[0].value, abs=1e-9)


def test_an_optimum_that_one_start_met_is_not_the_last_word():
    x = ca.SX.sym("x", 1)
    bowl = NonlinearProgram(x, (x[0] - 0.3) ** 2, np.array([-4.0]), np.array([4.0]))
    end = solve_nonlinear(bowl, [np.zeros(1)], workers=1)[0]
    often, once = replace(end, starts=12), replace(end, value=end.value - 1.0)
    assert is_explored([often], 1.0)
    assert not is_explored([often, once], 1.0)
    assert is_explored([often, replace(once, starts=2)], 1.0)


def test_starts_cover_every_variable_evenly_and_repeat_by_seed():
    low, high = np.array([0.0, -10.0]), np.array([1.0, 30.0])
    starts = spread_starts(low, high, 10, seed=3)
    assert np.array_equal(starts, spread_starts(low, high, 10, seed=3))
    cells = np.sort(np.floor((starts - low) / (high - low) * 10).astype(int), axis=0)
    assert np.array_equal(cells, np.tile(np.arange(10)[:, None], 2))


def test_a_largest_of_many_rows_ends_no_worse_than_where_it_starts():
    """Check ends of near and far starts with a hundred slack rows, which draw a barrier method away (N2)."""
    z = ca.SX.sym("z", 2)
    x, top = z[0], z[1]
    high, rows = 1.0 - 0.2 * ca.exp(-((x / 0.3) ** 2)) - 0.05 * x, 100
    program = NonlinearProgram(
        z, top, np.zeros(2), np.array([1.0, 10.0]), constraints=ca.vertcat(high, *[0.79 - 0.7 * x] * rows) - top,
        constraint_lower=np.full(rows + 1, -np.inf), constraint_upper=np.zeros(rows + 1),
        constraint_names=("row",) * (rows + 1),
    )  # fmt: skip
    near, far = (solve_nonlinear(program, [np.array(start)])[0] for start in ((0.1, 0.86), (0.9, 1.0)))
    assert near.kkt_residual < 1e-7
    assert near.value < 0.8 + 1e-6
    assert far.value == pytest.approx(0.95, abs=1e-4)
