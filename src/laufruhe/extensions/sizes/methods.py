"""Methods for open sizes of the running gear."""

from __future__ import annotations

from laufruhe.numerics.norms import Norm
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import Dependence
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.method import BUILT, OF_MOUNTS, OF_SIZES_ALONE, Method, imported, is_no_number, is_pointwise

_ALONE = {Kind.SIZE: (Dependence.MASSES,), Kind.UNBALANCE: (Dependence.AFFINE,)}


def _is_of_row_lengths(norm: Norm) -> bool:
    return is_pointwise(norm) and norm.is_monotone_in_lengths


def _minimises_loads(problem: Problem) -> bool:
    return any(not term.measure.is_mounting for term in problem.objective)


ALONE = Method(
    "boxes of sizes", _ALONE, ProofStrength.EXACT, imported("laufruhe.extensions.sizes.solver:solve_sizes"),
    refines_fidelity=True, known_channels=OF_SIZES_ALONE, accepts_norm=_is_of_row_lengths,
    accepts_constant=is_no_number, before="linear matrix inequalities",
    proves="the optimum (Z12, Z14); with an open rod length within a gap, if kinks of a load move with it (Z13)",
)  # fmt: skip
WITH_STARS = Method(
    "stars, each with boxes of sizes", {Kind.STAR: BUILT, **_ALONE}, ProofStrength.EXACT,
    imported("laufruhe.extensions.sizes.solver:solve_star_sizes"),
    refines_fidelity=True, known_channels=OF_SIZES_ALONE, accepts_norm=_is_of_row_lengths,
    accepts_constant=is_no_number,
    before="linear matrix inequalities", proves="the optimum, of 60 even stars or firing orders at most",
)  # fmt: skip
WITH_MOUNTS = Method(
    "local programs of sizes and mounts", {**_ALONE, Kind.STIFFNESS: (), Kind.MOUNT: ()}, ProofStrength.RELAXED,
    imported("laufruhe.extensions.sizes.mounted:solve_mounted_sizes"),
    known_channels=OF_SIZES_ALONE | OF_MOUNTS, accepts_norm=_is_of_row_lengths,
    accepts_problem=_minimises_loads,
    before="stars, each with a smooth program",
    proves="a local optimum, with the bound of any masses that the sizes may have (Z15)",
)  # fmt: skip
