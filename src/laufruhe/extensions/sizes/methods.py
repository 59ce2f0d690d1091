"""Method for open sizes of the running gear."""

from __future__ import annotations

from laufruhe.numerics.norms import Norm
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import Dependence
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.method import OF_SIZES_ALONE, Method, imported, is_no_number, is_pointwise


def _is_of_row_lengths(norm: Norm) -> bool:
    return is_pointwise(norm) and norm.is_monotone_in_lengths


ALONE = Method(
    "boxes of sizes", {Kind.SIZE: (Dependence.MASSES,), Kind.UNBALANCE: (Dependence.AFFINE,)}, ProofStrength.EXACT,
    imported("laufruhe.extensions.sizes.solver:solve_sizes"),
    refines_fidelity=True, known_channels=OF_SIZES_ALONE, accepts_norm=_is_of_row_lengths,
    accepts_constant=is_no_number, before="linear matrix inequalities",
    proves="the optimum (Z12, Z14); with an open rod length within a gap, if kinks of a load move with it (Z13)",
)  # fmt: skip
