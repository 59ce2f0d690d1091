"""Selective assembly: choose the measured piston and rod of each cylinder by branch and bound (R12).

Loads are affine in the masses, so a subgradient bounds a norm from below. The minimum of that bound over all assemblies
is a linear assignment, solved exactly. Free cylinders have a mixture of parts; the bound moves the mixture towards the
assignment, step by step. Each assignment is also tried as an assembly.
"""

from __future__ import annotations

import cmath
import itertools
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from laufruhe.errors import BoundError, ModelError
from laufruhe.extensions.robust.assembly import Assembly, Chosen, Lot, assemble
from laufruhe.extensions.robust.built_engines import BuiltEngines, objective_values
from laufruhe.extensions.robust.result import SHARES, AssemblyResult, Place
from laufruhe.extensions.robust.tolerance import AddedDrive, Error, PistonDrive, Tolerance, Tolerances
from laufruhe.extensions.robust.worst_case import Terms, value_at
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.progress import report_progress
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import is_affine
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.branch_and_bound import BoundedParts, BranchAndBound, OpenNode
from laufruhe.prove.certificate import Proof, ProofStrength, make_certificate, unproven_certificate
from laufruhe.prove.witness import Witness
from laufruhe.solvers import walk
from laufruhe.solvers.accuracy import objective_error
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, limit_values, without_proof
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import ObjectiveValue

MAX_NODES, STEPS, RANDOM = 20_000, 8, 2000
"""Most nodes, steps of each bound, and random assemblies for comparison."""
FREE = 3
"""Cylinders without a part in the node around a known assembly."""
LENGTHS = np.linspace(0.0, 1.0, 9)[1:]
"""Shares of a step towards an assignment that are tried."""
PER_KILOGRAM = 0.01
"""Mass step for the slopes of loads [kg]: small compared with a piston."""


def solve_assembly(problem: Problem, *_: object) -> Result:
    """Return the assignment of measured pistons and rods to cylinders with the least objective, with its proof.

    Raises
    ------
    ModelError
        If other numbers are open, or a measure is not affine in the masses.
    """
    assembly = problem.extra(Assembly)
    if assembly is None:
        raise ValueError("the problem has no [assembly] with measured pistons or rods to choose from")
    refuse(problem)
    started, spent = time.perf_counter(), time.thread_time()
    report_progress("effect of each part")
    terms, lots = _terms(problem), assembly.lots
    search = _Search(terms, lots, len(problem.engine.slider_cranks), problem.tolerance)
    bound = search.run()
    report_progress("the best assembly, and random ones", value=search.value, bound=bound)
    witness = _walk(problem, lots, search.best, bound, max(walk.SHARE * (time.thread_time() - spent), walk.SECONDS))
    chosen = search.best if witness is None else witness
    initial, final = _evaluated(problem, lots, search.initial), _evaluated(problem, lots, chosen)
    value = objective_value(problem, final)
    certificate = unproven_certificate(value, math.inf, "a walk by exact evaluations, which proves nothing")
    if witness is None:
        certificate = make_certificate(
            value, bound, numerical_zero(problem), problem.tolerance, ProofStrength.EXACT, 0.0,
            f"branch and bound over assignments, {search.node_count} nodes bounded by multipliers",
        )  # fmt: skip
    is_feasible = final.violation(problem.limits) <= FEASIBILITY_TOL
    status = Status.OPTIMAL if certificate.kind is Proof.GLOBAL else Status.FEASIBLE
    result = Result(
        problem=problem, status=status if is_feasible else Status.FAILED,
        objective=ObjectiveValue.of(problem, value, objective_value(problem, initial)), certificate=certificate,
        limits=limit_values(problem, final), initial=initial, final=final,
        message="" if is_feasible else "the best assembly violates a limit, which the choice ignores; relax it",
        error=partial(objective_error, problem, final), timing={"solve": time.perf_counter() - started},
        details=search.result(chosen, [part.name for part in problem.engine.slider_cranks]),
    )  # fmt: skip
    return result if witness is None else without_proof(result, BoundError("a walk", bound, value))


def _evaluated(problem: Problem, lots: Sequence[Lot], chosen: Chosen) -> Evaluation:
    return evaluate(problem, assemble(problem.engine, lots, chosen))


def _walk(problem: Problem, lots: Sequence[Lot], start: Chosen, bound: float, seconds: float) -> Chosen | None:
    """Return an assembly with an exact objective below the claimed lower `bound`, or None if none is found.

    A search over neighbouring assemblies (two parts exchanged) looks for it for some seconds.
    """
    random, deadline = np.random.default_rng(walk.SEED), time.thread_time() + seconds
    best_known, best_evaluation, minimum, queue = start, _evaluated(problem, lots, start), math.inf, [start]
    for _ in range(walk.MAX_EVALUATIONS):
        if not queue or time.thread_time() > deadline:
            break
        chosen = queue.pop()
        evaluation = _evaluated(problem, lots, chosen)
        if objective_value(problem, evaluation) < minimum:
            best_known, best_evaluation, minimum = chosen, evaluation, objective_value(problem, evaluation)
            neighbours = list(_neighbours(lots, chosen))
            queue = [neighbours[k] for k in random.permutation(len(neighbours))]
    margin = 1.0 + 2.0 * objective_error(problem, best_evaluation) + walk.ROUNDING
    return best_known if minimum * margin + numerical_zero(problem, best_evaluation.engine) < bound else None


def _neighbours(lots: Sequence[Lot], chosen: Chosen) -> Iterator[Chosen]:
    for k, (lot, parts) in enumerate(zip(lots, chosen, strict=True)):
        for i, part in itertools.product(range(len(parts)), range(len(lot.masses))):
            if part not in parts[: i + 1]:
                exchanged = [parts[i] if current == part else current for current in parts]
                exchanged[i] = part
                yield (*chosen[:k], tuple(exchanged), *chosen[k + 1 :])


def refuse(problem: Problem) -> None:
    """Raise ModelError for problems with other keys than [assembly] supports."""
    if problem.decisions or problem.phasing is not None:
        raise ModelError("[assembly] needs an engine without open numbers; fix them, or leave [assembly] out")
    if len(problem.extras) > 1:
        raise ModelError(
            "[assembly] is for measured parts, and [robust] for parts within tolerances; remove one of the two tables"
        )
    if problem.fidelity.has_uneven_speed:
        raise ModelError("[assembly] assumes a constant crank speed; remove fidelity.crank_inertia")
    for term in problem.objective:
        if not term.measure.is_load or not is_affine(term.measure.channel, {Kind.UNBALANCE, Kind.PISTON}, problem):
            raise ModelError(
                f"[assembly] minimises loads only, not {term.measure.name}; minimise a load such as mount force"
            )
    if not problem.objective:
        raise ModelError("[assembly] has no objective to minimise; add [objective]")


def _terms(problem: Problem) -> Terms:
    """Return the objective terms as norms of the added reciprocating, then rotating, mass of each cylinder [kg]."""
    parts = problem.engine.slider_cranks
    errors = [Error(part.name, (PistonDrive(k, PER_KILOGRAM),)) for k, part in enumerate(parts)]
    errors += [
        Error(
            part.name,
            (AddedDrive(part.name, part.x, cmath.rect(PER_KILOGRAM * part.crank_radius, part.throw), part.shaft),),
        )
        for part in parts
    ]
    unit = Tolerance("a part", "kg", PER_KILOGRAM, tuple(errors))
    engines = BuiltEngines(problem, (), problem.fidelity.samples, Tolerances((unit,)))
    return tuple((weight, replace(norm, slope=norm.slope / PER_KILOGRAM)) for weight, norm in engines.terms)


class _Search(BranchAndBound[Chosen]):
    """Branch and bound over assemblies; a node has -1 for each cylinder without a part."""

    what = "parts bounded"

    def __init__(self, terms: Terms, lots: Sequence[Lot], cylinders: int, tolerance: float) -> None:
        self.terms, self.lots, self.cylinders, self.tolerance = terms, lots, cylinders, tolerance
        self.differences = [lot.differences for lot in lots]
        self.initial: Chosen = tuple(tuple(range(cylinders)) for _ in lots)
        self.best, self.value = self.initial, self._value(self.initial)
        sizes = [
            sum(weight * norm.norm.value(norm.grid, norm.slope[..., k]) for weight, norm in terms)
            for k in range(2 * cylinders)
        ]
        spread = [np.ptp(differences, axis=0) for differences in self.differences]
        order = [
            (-(sizes[k] * ranges[0] + sizes[cylinders + k] * ranges[1]), lot, k)
            for lot, ranges in enumerate(spread) for k in range(cylinders)
        ]  # fmt: skip
        self.order = [(lot, k) for _, lot, k in sorted(order)]

    def run(self) -> float:
        """Search all assemblies by branch and bound; return a lower bound of the objective over them."""
        free: Chosen = tuple((-1,) * self.cylinders for _ in self.lots)
        bound = self.divide((self.bound(free), free), MAX_NODES)
        near = self.bound(self.around(self.best))
        Witness(self._mass(self.best), self.value).check_near(self.what, near)
        return bound

    def around(self, chosen: Chosen) -> Chosen:
        """Return a small set of assemblies near `chosen`: only the last FREE cylinders of the order are free."""
        free = set(self.order[-FREE:])
        return tuple(
            tuple(-1 if (lot, k) in free else part for k, part in enumerate(parts)) for lot, parts in enumerate(chosen)
        )

    @property
    def cutoff(self) -> float:
        """Bound from which a node is fathomed."""
        return self.value * (1.0 - 0.5 * self.tolerance)

    def is_fathomed(self, node: OpenNode[Chosen]) -> bool:
        """Return True if no assembly of a node is better by half the tolerance."""
        return node.bound >= self.cutoff

    def branch(self, nodes: Sequence[OpenNode[Chosen]]) -> BoundedParts[Chosen]:
        """Yield the parts of a node with their bounds: one for each free part in the next cylinder.

        The next cylinder is the most influential one without a part.
        """
        ((bound, _, chosen),) = nodes
        lot, cylinder = next((position for position in self.order if chosen[position[0]][position[1]] < 0), (-1, -1))
        for part in range(len(self.differences[lot])) if lot >= 0 else ():
            if part in chosen[lot]:
                continue
            parts = tuple(part if k == cylinder else current for k, current in enumerate(chosen[lot]))
            child = (*chosen[:lot], parts, *chosen[lot + 1 :])
            yield max(self.bound(child), bound), child

    def _mass(self, chosen: Chosen) -> Array:
        return np.asarray(
            np.sum([m[list(p)] for m, p in zip(self.differences, chosen, strict=True)], axis=0)
        ).T.reshape(-1)

    def _value(self, chosen: Chosen) -> float:
        return value_at(self.terms, self._mass(chosen))

    def _try(self, chosen: Chosen) -> float:
        value = self._value(chosen)
        if value < self.value:
            self.best, self.value = chosen, value
        return value

    def bound(self, node: Chosen) -> float:
        """Return a lower bound of the objective over the assemblies of a node.

        Better assemblies on the way are stored.
        """
        if all(part >= 0 for parts in node for part in parts):
            return self._try(node)
        point, best = self._middle(node), -math.inf
        for _ in range(STEPS):
            value, slope = 0.0, np.zeros(2 * self.cylinders)
            for weight, norm in self.terms:
                value += weight * norm.value(point)
                slope += weight * np.einsum("kd,kdn->n", norm.subgradient(point), norm.slope)
            assignment = self._assigned(node, slope)
            end = self._mass(assignment)
            best = max(best, value + float(slope @ (end - point)))
            self._try(assignment)
            if best >= self.cutoff or value - best <= 0.1 * self.tolerance * value:
                break
            candidates = [(value_at(self.terms, point + share * (end - point)), share) for share in LENGTHS]
            point = point + min(candidates)[1] * (end - point)
        return best

    def _middle(self, node: Chosen) -> Array:
        total = np.zeros((self.cylinders, 2))
        for differences, parts in zip(self.differences, node, strict=True):
            free_parts = [k for k in range(len(differences)) if k not in parts]
            mean = differences[free_parts].mean(axis=0) if free_parts else np.zeros(2)
            total += np.array([differences[part] if part >= 0 else mean for part in parts])
        return np.asarray(total.T.reshape(-1))

    def _assigned(self, node: Chosen, slope: Array) -> Chosen:
        """Return the assembly of a node with the smallest sum of slope times mass."""
        from scipy.optimize import linear_sum_assignment

        result = []
        for differences, parts in zip(self.differences, node, strict=True):
            cylinders, free_parts = (
                [k for k, part in enumerate(parts) if part < 0],
                [k for k in range(len(differences)) if k not in parts],
            )
            cost = np.outer(slope[: self.cylinders][cylinders], differences[free_parts, 0])
            cost += np.outer(slope[self.cylinders :][cylinders], differences[free_parts, 1])
            assigned = list(parts)
            for row, column in zip(*linear_sum_assignment(cost), strict=True):
                assigned[cylinders[row]] = free_parts[column]
            result.append(tuple(assigned))
        return tuple(result)

    def result(self, chosen: Chosen, names: Sequence[str]) -> AssemblyResult:
        """Return the parts of the best assembly by cylinder, with objectives of random assemblies to compare."""
        random = np.random.default_rng(0)
        random_assemblies = [
            tuple(
                tuple(random.permutation(len(lot_differences))[: self.cylinders])
                for lot_differences in self.differences
            )
            for _ in range(RANDOM)
        ]
        values = objective_values(self.terms, np.array([self._mass(assembly) for assembly in random_assemblies]))
        places = tuple(
            Place(name, tuple(int(lot_parts[k]) + 1 for lot_parts in chosen),
                  tuple(lot.masses[int(lot_parts[k])] for lot, lot_parts in zip(self.lots, chosen, strict=True)))
            for k, name in enumerate(names)
        )  # fmt: skip
        return AssemblyResult(
            tuple(lot.kind for lot in self.lots), places,
            math.prod(float(math.perm(len(lot_differences), self.cylinders)) for lot_differences in self.differences),
            self.node_count,
            tuple(float(quantile) for quantile in np.quantile(values, SHARES)), float(values.max()),
            value_at(self.terms, np.zeros(2 * self.cylinders)), RANDOM,
        )  # fmt: skip
